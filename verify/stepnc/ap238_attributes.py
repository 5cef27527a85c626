"""Attributes of the entities of AP238 in order, each with its kind [ISO10303-238]."""

from __future__ import annotations

from verify.stepnc.attribute_checks import (
    FLAG,
    Attributes,
    Either,
    Many,
    Maybe,
    Named,
    Nothing,
    OneOf,
    Real,
    Table,
    Text,
    To,
    Whole,
    attributes,
)
from verify.stepnc.curves import CURVE_TABLE

_METHOD = {"name": Text(), "description": Text(), "consequence": Text(), "purpose": Text()}
EXECUTABLES = ("MACHINING_WORKPLAN", "MACHINING_WORKINGSTEP", "MACHINING_NC_FUNCTION", "MACHINING_PROCESS_EXECUTABLE")
METHODS = (*EXECUTABLES, "FREEFORM_MILLING_OPERATION", "MACHINING_TOOLPATH", "MACHINING_TECHNOLOGY",
            "MACHINING_FUNCTIONS", "MACHINING_FEATURE_PROCESS", "FREEFORM_MILLING_STRATEGY")
_LENGTH_TYPES = tuple((n, Real()) for n in ("LENGTH_MEASURE", "POSITIVE_LENGTH_MEASURE"))
_MEASURES = Named((*_LENGTH_TYPES, *((n, Real()) for n in (
    "TIME_MEASURE", "NUMERIC_MEASURE", "COUNT_MEASURE", "PLANE_ANGLE_MEASURE", "RATIO_MEASURE"))))
UNITS = ("SI_UNIT", "CONVERSION_BASED_UNIT", "CONTEXT_DEPENDENT_UNIT", "DERIVED_UNIT")
_MEASURED = {"value_component": _MEASURES, "unit_component": To(UNITS)}
_CONTEXT = To(("REPRESENTATION_CONTEXT",))
_REPRESENTATION = {"name": Text(), "items": Many(To(), 1), "context_of_items": _CONTEXT}
REPRESENTATIONS = ("REPRESENTATION", "MACHINING_TOOLPATH_SPEED_PROFILE_REPRESENTATION",
                    "MACHINING_SPINDLE_SPEED_REPRESENTATION", "MACHINING_FEED_SPEED_REPRESENTATION",
                    "FREEFORM_MILLING_TOLERANCE_REPRESENTATION", "MACHINING_TOOL_BODY_REPRESENTATION")
SHAPES = ("SHAPE_REPRESENTATION_WITH_PARAMETERS", "BLOCK_SHAPE_REPRESENTATION", "CYLINDRICAL_SHAPE_REPRESENTATION",
           "TESSELLATED_SHAPE_REPRESENTATION", "SHAPE_REPRESENTATION", "ADVANCED_BREP_SHAPE_REPRESENTATION")
_PRODUCTS = ("PRODUCT", "MACHINING_PROJECT", "MACHINING_SETUP")
_PRODUCT = {"id": Text(), "name": Text(), "description": Maybe(Text()),
            "frame_of_reference": Many(To(("PRODUCT_CONTEXT",)), 1)}
_DEFINITION = To(("PRODUCT_DEFINITION",))


def _between(relating: tuple[str, ...], related: tuple[str, ...], *, ordered: bool = False) -> Attributes:
    """Attributes of a relationship between methods."""
    place = {"sequence_position": Real()} if ordered else {}
    return attributes(name=Text(), description=Maybe(Text()), relating_method=To(relating), related_method=To(related),
                      **place)


def _of_products(relating: To, related: To) -> Attributes:
    """Attributes of a relationship between products."""
    return attributes(id=Text(), name=Text(), description=Maybe(Text()), relating_product_definition=relating,
                      related_product_definition=related)


TABLE: Table = {
    **{name: attributes(**_METHOD) for name in METHODS},
    **{name: attributes(**_PRODUCT) for name in _PRODUCTS},
    **{name: attributes(**_REPRESENTATION) for name in (*REPRESENTATIONS, *SHAPES)},
    "APPLICATION_CONTEXT": attributes(application=Text()),
    "APPLICATION_PROTOCOL_DEFINITION": attributes(
        status=Text(), application_interpreted_model_schema_name=Text(), application_protocol_year=Whole(),
        application=To(("APPLICATION_CONTEXT",))),
    "PRODUCT_CONTEXT": attributes(name=Text(), frame_of_reference=To(("APPLICATION_CONTEXT",)), discipline_type=Text()),
    "PRODUCT_DEFINITION_CONTEXT": attributes(name=Text(), frame_of_reference=To(("APPLICATION_CONTEXT",)),
                                             life_cycle_stage=Text()),
    "PRODUCT_DEFINITION_FORMATION": attributes(id=Text(), description=Maybe(Text()), of_product=To(_PRODUCTS)),
    "PRODUCT_DEFINITION": attributes(id=Text(), description=Maybe(Text()),
                                     formation=To(("PRODUCT_DEFINITION_FORMATION",)),
                                     frame_of_reference=To(("PRODUCT_DEFINITION_CONTEXT",))),
    "PRODUCT_DEFINITION_PROCESS": attributes(name=Text(), description=Maybe(Text()), chosen_method=To(METHODS),
                                             identification=Text()),
    "PROCESS_PRODUCT_ASSOCIATION": attributes(name=Text(), description=Text(), defined_product=_DEFINITION,
                                              process=To(("PRODUCT_DEFINITION_PROCESS",))),
    "MACHINING_PROJECT_WORKPIECE_RELATIONSHIP": _of_products(_DEFINITION, _DEFINITION),
    "MACHINING_SETUP_WORKPIECE_RELATIONSHIP": _of_products(_DEFINITION, _DEFINITION),
    "PRODUCT_DEFINITION_RELATIONSHIP": _of_products(_DEFINITION, _DEFINITION),
    "PRODUCT_DEFINITION_SHAPE": attributes(name=Text(), description=Maybe(Text()),
                                           definition=To(("PRODUCT_DEFINITION", "INSTANCED_FEATURE"))),
    "PROPERTY_DEFINITION": attributes(name=Text(), description=Maybe(Text()), definition=To()),
    "PROPERTY_DEFINITION_REPRESENTATION": attributes(definition=To(("PROPERTY_DEFINITION",)),
                                                     used_representation=To(REPRESENTATIONS)),
    "SHAPE_DEFINITION_REPRESENTATION": attributes(definition=To(("PRODUCT_DEFINITION_SHAPE",)),
                                                  used_representation=To(SHAPES)),
    "MATERIAL_DESIGNATION": attributes(name=Text(), definitions=Many(To(), 1)),
    "MACHINING_PROCESS_SEQUENCE_RELATIONSHIP": _between(("MACHINING_WORKPLAN",), EXECUTABLES, ordered=True),
    "MACHINING_OPERATION_RELATIONSHIP": _between(("MACHINING_WORKINGSTEP",), ("FREEFORM_MILLING_OPERATION",)),
    "MACHINING_FEATURE_RELATIONSHIP": _between(("MACHINING_WORKINGSTEP",), ("MACHINING_FEATURE_PROCESS",)),
    "MACHINING_TECHNOLOGY_RELATIONSHIP": _between(("FREEFORM_MILLING_OPERATION", "MACHINING_TOOLPATH"),
                                                  ("MACHINING_TECHNOLOGY",)),
    "MACHINING_FUNCTIONS_RELATIONSHIP": _between(("FREEFORM_MILLING_OPERATION", "MACHINING_TOOLPATH"),
                                                 ("MACHINING_FUNCTIONS",)),
    "MACHINING_STRATEGY_RELATIONSHIP": _between(("FREEFORM_MILLING_OPERATION",), ("FREEFORM_MILLING_STRATEGY",)),
    "MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP": _between(("FREEFORM_MILLING_OPERATION",), ("MACHINING_TOOLPATH",),
                                                         ordered=True),
    "MACHINING_OPERATOR_INSTRUCTION": attributes(**_METHOD, documents=Many(To(("DOCUMENT",)), 1)),
    "MACHINING_OPERATOR_INSTRUCTION_RELATIONSHIP": _between(
        ("MACHINING_PROCESS_EXECUTABLE",), ("MACHINING_OPERATOR_INSTRUCTION",), ordered=True),
    "DOCUMENT": attributes(id=Text(), name=Text(), description=Maybe(Text()), kind=To(("DOCUMENT_TYPE",))),
    "DOCUMENT_TYPE": attributes(product_data_type=Text()),
    "PROPERTY_PROCESS": attributes(name=Text(), description=Maybe(Text()),
                                   chosen_method=To(("MACHINING_FEATURE_PROCESS",)), identification=Text()),
    "PROCESS_PROPERTY_ASSOCIATION": attributes(name=Text(), description=Text(), process=To(("PROPERTY_PROCESS",)),
                                               property_or_shape=To(("INSTANCED_FEATURE",))),
    "INSTANCED_FEATURE": attributes(name=Text(), description=Maybe(Text()), shape_name=Text(),
                                    shape_description=Maybe(Text()), of_shape=To(("PRODUCT_DEFINITION_SHAPE",)),
                                    product_definitional=FLAG),
    "ACTION_PROPERTY": attributes(name=Text(), description=Text(), definition=To(METHODS)),
    "ACTION_PROPERTY_REPRESENTATION": attributes(name=Text(), description=Text(), property=To(("ACTION_PROPERTY",)),
                                                 representation=To(REPRESENTATIONS)),
    "DESCRIPTIVE_REPRESENTATION_ITEM": attributes(name=Text(), description=Text()),
    "MEASURE_REPRESENTATION_ITEM": attributes(name=Text(), **_MEASURED),
    "MACHINING_TOOL": attributes(name=Text(), description=Text(), usage=Many(To(("FREEFORM_MILLING_OPERATION",)), 1),
                                 kind=To(("ACTION_RESOURCE_TYPE",))),
    "MACHINING_CUTTING_COMPONENT": attributes(
        name=Text(), description=Maybe(Text()), usage=Many(To(("FREEFORM_MILLING_OPERATION",)), 1),
        kind=To(("ACTION_RESOURCE_TYPE",)), object_name=Text(), object_description=Maybe(Text())),
    "ACTION_RESOURCE_TYPE": attributes(name=Text()),
    "ACTION_RESOURCE_RELATIONSHIP": attributes(
        name=Text(), description=Maybe(Text()), relating_resource=To(("MACHINING_TOOL",)),
        related_resource=To(("MACHINING_CUTTING_COMPONENT",))),
    "RESOURCE_PROPERTY": attributes(name=Text(), description=Text(),
                                    resource=To(("MACHINING_TOOL", "MACHINING_CUTTING_COMPONENT"))),
    "RESOURCE_PROPERTY_REPRESENTATION": attributes(name=Text(), description=Text(), property=To(("RESOURCE_PROPERTY",)),
                                                   representation=To(REPRESENTATIONS)),
    "DERIVED_UNIT": attributes(elements=Many(To(("DERIVED_UNIT_ELEMENT",)), 1)),
    "DERIVED_UNIT_ELEMENT": attributes(unit=To(UNITS), exponent=Real()),
    "CONTEXT_DEPENDENT_UNIT": attributes(dimensions=To(("DIMENSIONAL_EXPONENTS",)), name=Text()),
    "DIMENSIONAL_EXPONENTS": attributes(**{n: Real() for n in (
        "length", "mass", "time", "current", "temperature", "amount", "intensity")}),
    "NAME_ATTRIBUTE": attributes(attribute_value=Text(), named_item=To()),
    **{name: attributes(**_MEASURED) for name in (
        "TIME_MEASURE_WITH_UNIT", "LENGTH_MEASURE_WITH_UNIT", "PLANE_ANGLE_MEASURE_WITH_UNIT")},
    "REPRESENTATION_CONTEXT": attributes(context_identifier=Text(), context_type=Text()),
    "PLANE": attributes(name=Text(), position=To(("AXIS2_PLACEMENT_3D",))),
    "AXIS2_PLACEMENT_3D": attributes(name=Text(), location=To(("CARTESIAN_POINT",)), axis=Maybe(To(("DIRECTION",))),
                                     ref_direction=Maybe(To(("DIRECTION",)))),
    "DIRECTION": attributes(name=Text(), direction_ratios=Many(Real(), 3, 3)),
    "CARTESIAN_POINT": attributes(name=Text(), coordinates=Many(Real(), 3, 3)),
    "POLYLINE": attributes(name=Text(), points=Many(To(("CARTESIAN_POINT",)), 2)),
    "COORDINATES_LIST": attributes(name=Text(), npoints=Whole(), position_coords=Many(Many(Real(), 3, 3), 1)),
    "TRIANGULATED_FACE": attributes(
        name=Text(), coordinates=To(("COORDINATES_LIST",)), pnmax=Whole(), normals=Many(Many(Real(), 3, 3)),
        geometric_link=Maybe(To()), pnindex=Many(Whole()), triangles=Many(Many(Whole(), 3, 3), 1)),
    "TESSELLATED_SOLID": attributes(name=Text(), items=Many(To(("TRIANGULATED_FACE",)), 1), geometric_link=Maybe(To())),
    **CURVE_TABLE,
}
RECORDS: Table = {
    "NAMED_UNIT": attributes(dimensions=Either((Nothing(), To(("DIMENSIONAL_EXPONENTS",))))),
    "SI_UNIT": attributes(
        prefix=Maybe(OneOf(("EXA", "PETA", "TERA", "GIGA", "MEGA", "KILO", "HECTO", "DECA", "DECI", "CENTI", "MILLI",
                            "MICRO", "NANO", "PICO", "FEMTO", "ATTO"))),
        name=OneOf(("METRE", "SECOND", "RADIAN", "STERADIAN", "GRAM"))),
    "CONVERSION_BASED_UNIT": attributes(name=Text(), conversion_factor=To((
        "TIME_MEASURE_WITH_UNIT", "LENGTH_MEASURE_WITH_UNIT", "PLANE_ANGLE_MEASURE_WITH_UNIT"))),
    "MEASURE_WITH_UNIT": attributes(**_MEASURED),
    "REPRESENTATION_ITEM": attributes(name=Text()),
    "GEOMETRIC_REPRESENTATION_CONTEXT": attributes(coordinate_space_dimension=Whole()),
    "GLOBAL_UNIT_ASSIGNED_CONTEXT": attributes(units=Many(To(UNITS), 1)),
    "REPRESENTATION_CONTEXT": attributes(context_identifier=Text(), context_type=Text()),
}


__all__ = ["EXECUTABLES", "METHODS", "RECORDS", "REPRESENTATIONS", "SHAPES", "TABLE", "UNITS"]
