"""STEP-NC with one attribute broken: refused with the instance named, or listed here with the reason why not.

Every attribute of a small job in both forms is broken in every way a value can be (``tests.broken_stepnc``). What is
left of the entities comes from a job with all there is: a fresh cutter, exact faces, meshes, a tool axis that swings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InternalError, ProgramError
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from tests.broken_stepnc import broken
from tests.synthetic_plan import clamped, shaped, tiny
from verify.comparison.stepnc_agreement import check_agreement
from verify.kinematics import Kinematics
from verify.program.program import Program
from verify.stepnc.part21 import Part21File
from verify.stepnc.reader import ap238, iso14649, read_stepnc

MACHINE = Kinematics("table-table-AC", None)

# Words for people, or names the standard fixes that nothing is looked up by: another word is the same job.
OTHER_WORDS = """
    ACTION_PROPERTY.description ACTION_PROPERTY_REPRESENTATION.description ACTION_PROPERTY_REPRESENTATION.name
    ACTION_RESOURCE_RELATIONSHIP.description ACTION_RESOURCE_RELATIONSHIP.name ACTION_RESOURCE_TYPE.name
    APPLICATION_CONTEXT.application APPLICATION_PROTOCOL_DEFINITION.application_interpreted_model_schema_name
    APPLICATION_PROTOCOL_DEFINITION.status AXIS2_PLACEMENT_3D.name CARTESIAN_POINT.name
    CONVERSION_BASED_UNIT.name COORDINATES_LIST.name CYLINDRICAL_SHAPE_REPRESENTATION.name
    DESCRIPTIVE_REPRESENTATION_ITEM.name DIRECTION.name DOCUMENT.description DOCUMENT.id DOCUMENT.name
    DOCUMENT_TYPE.product_data_type FREEFORM_MILLING_OPERATION.consequence
    FREEFORM_MILLING_OPERATION.description FREEFORM_MILLING_OPERATION.name FREEFORM_MILLING_OPERATION.purpose
    FREEFORM_MILLING_STRATEGY.consequence FREEFORM_MILLING_STRATEGY.description FREEFORM_MILLING_STRATEGY.name
    FREEFORM_MILLING_STRATEGY.purpose FREEFORM_MILLING_TOLERANCE_REPRESENTATION.name
    INSTANCED_FEATURE.description INSTANCED_FEATURE.name INSTANCED_FEATURE.shape_description
    INSTANCED_FEATURE.shape_name MACHINING_CUTTING_COMPONENT.description MACHINING_CUTTING_COMPONENT.name
    MACHINING_CUTTING_COMPONENT.object_description MACHINING_CUTTING_COMPONENT.object_name
    MACHINING_FEATURE_PROCESS.consequence MACHINING_FEATURE_PROCESS.description MACHINING_FEATURE_PROCESS.name
    MACHINING_FEATURE_PROCESS.purpose MACHINING_FEATURE_RELATIONSHIP.description
    MACHINING_FEATURE_RELATIONSHIP.name MACHINING_FEED_SPEED_REPRESENTATION.name MACHINING_FUNCTIONS.consequence
    MACHINING_FUNCTIONS.description MACHINING_FUNCTIONS.name MACHINING_FUNCTIONS.purpose
    MACHINING_FUNCTIONS_RELATIONSHIP.description MACHINING_FUNCTIONS_RELATIONSHIP.name
    MACHINING_NC_FUNCTION.consequence MACHINING_NC_FUNCTION.name MACHINING_NC_FUNCTION.purpose
    MACHINING_OPERATION_RELATIONSHIP.description MACHINING_OPERATION_RELATIONSHIP.name
    MACHINING_OPERATOR_INSTRUCTION.consequence MACHINING_OPERATOR_INSTRUCTION.description
    MACHINING_OPERATOR_INSTRUCTION.name MACHINING_OPERATOR_INSTRUCTION.purpose
    MACHINING_OPERATOR_INSTRUCTION_RELATIONSHIP.description MACHINING_OPERATOR_INSTRUCTION_RELATIONSHIP.name
    MACHINING_PROCESS_EXECUTABLE.consequence MACHINING_PROCESS_EXECUTABLE.name
    MACHINING_PROCESS_EXECUTABLE.purpose MACHINING_PROCESS_SEQUENCE_RELATIONSHIP.description
    MACHINING_PROCESS_SEQUENCE_RELATIONSHIP.name MACHINING_PROJECT.description MACHINING_PROJECT.id
    MACHINING_PROJECT.name MACHINING_PROJECT_WORKPIECE_RELATIONSHIP.description
    MACHINING_PROJECT_WORKPIECE_RELATIONSHIP.id MACHINING_PROJECT_WORKPIECE_RELATIONSHIP.name
    MACHINING_SETUP.description MACHINING_SETUP.id MACHINING_SETUP.name
    MACHINING_SETUP_WORKPIECE_RELATIONSHIP.description MACHINING_SETUP_WORKPIECE_RELATIONSHIP.id
    MACHINING_SETUP_WORKPIECE_RELATIONSHIP.name MACHINING_SPINDLE_SPEED_REPRESENTATION.name
    MACHINING_STRATEGY_RELATIONSHIP.description MACHINING_STRATEGY_RELATIONSHIP.name
    MACHINING_TECHNOLOGY.consequence MACHINING_TECHNOLOGY.description MACHINING_TECHNOLOGY.name
    MACHINING_TECHNOLOGY.purpose MACHINING_TECHNOLOGY_RELATIONSHIP.description
    MACHINING_TECHNOLOGY_RELATIONSHIP.name MACHINING_TOOLPATH.consequence MACHINING_TOOLPATH.name
    MACHINING_TOOLPATH.purpose MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP.description
    MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP.name MACHINING_TOOLPATH_SPEED_PROFILE_REPRESENTATION.name
    MACHINING_TOOL_BODY_REPRESENTATION.name MACHINING_WORKINGSTEP.consequence MACHINING_WORKINGSTEP.description
    MACHINING_WORKINGSTEP.name MACHINING_WORKINGSTEP.purpose MACHINING_WORKPLAN.consequence
    MACHINING_WORKPLAN.description MACHINING_WORKPLAN.name MACHINING_WORKPLAN.purpose MATERIAL_DESIGNATION.name
    MEASURE_REPRESENTATION_ITEM.name NAME_ATTRIBUTE.attribute_value PLANE.name POLYLINE.name
    PROCESS_PRODUCT_ASSOCIATION.description PROCESS_PRODUCT_ASSOCIATION.name
    PROCESS_PROPERTY_ASSOCIATION.description PROCESS_PROPERTY_ASSOCIATION.name PRODUCT.description PRODUCT.id
    PRODUCT.name PRODUCT_CONTEXT.discipline_type PRODUCT_CONTEXT.name PRODUCT_DEFINITION.description
    PRODUCT_DEFINITION.id PRODUCT_DEFINITION_CONTEXT.life_cycle_stage PRODUCT_DEFINITION_CONTEXT.name
    PRODUCT_DEFINITION_FORMATION.description PRODUCT_DEFINITION_FORMATION.id
    PRODUCT_DEFINITION_PROCESS.description PRODUCT_DEFINITION_PROCESS.identification
    PRODUCT_DEFINITION_RELATIONSHIP.description PRODUCT_DEFINITION_RELATIONSHIP.id
    PRODUCT_DEFINITION_RELATIONSHIP.name PRODUCT_DEFINITION_SHAPE.description PRODUCT_DEFINITION_SHAPE.name
    PROPERTY_DEFINITION.description PROPERTY_PROCESS.description PROPERTY_PROCESS.identification
    PROPERTY_PROCESS.name REPRESENTATION.name REPRESENTATION_CONTEXT.context_identifier
    REPRESENTATION_CONTEXT.context_type RESOURCE_PROPERTY.description
    RESOURCE_PROPERTY_REPRESENTATION.description RESOURCE_PROPERTY_REPRESENTATION.name
    SHAPE_REPRESENTATION_WITH_PARAMETERS.name TESSELLATED_SHAPE_REPRESENTATION.name TESSELLATED_SOLID.name
    TRIANGULATED_FACE.name
""".split()

# Descriptions the schema lets one leave out, of relationships and products; no path depends on them.
NO_DESCRIPTION = """
    ACTION_RESOURCE_RELATIONSHIP.description DOCUMENT.description INSTANCED_FEATURE.description
    INSTANCED_FEATURE.shape_description MACHINING_CUTTING_COMPONENT.description
    MACHINING_CUTTING_COMPONENT.object_description MACHINING_FEATURE_RELATIONSHIP.description
    MACHINING_FUNCTIONS_RELATIONSHIP.description MACHINING_OPERATION_RELATIONSHIP.description
    MACHINING_OPERATOR_INSTRUCTION_RELATIONSHIP.description MACHINING_PROCESS_SEQUENCE_RELATIONSHIP.description
    MACHINING_PROJECT.description MACHINING_PROJECT_WORKPIECE_RELATIONSHIP.description
    MACHINING_SETUP.description MACHINING_SETUP_WORKPIECE_RELATIONSHIP.description
    MACHINING_STRATEGY_RELATIONSHIP.description MACHINING_TECHNOLOGY_RELATIONSHIP.description
    MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP.description PRODUCT.description PRODUCT_DEFINITION.description
    PRODUCT_DEFINITION_FORMATION.description PRODUCT_DEFINITION_PROCESS.description
    PRODUCT_DEFINITION_RELATIONSHIP.description PRODUCT_DEFINITION_SHAPE.description
    PROPERTY_DEFINITION.description PROPERTY_PROCESS.description
""".split()

WITHOUT_INFLUENCE = {
    # how: {attribute: why what is read does not change}
    "another word": {
        "CONTEXT_DEPENDENT_UNIT.name": "only where it is the unit of teeth, which no move depends on: see below",
        "MACHINING_TOOL.name": "a tool without a number is known by its size, and a note says so",
        "REPRESENTATION_ITEM.name": "of the life of a cutter, which no move depends on; those of sizes are refused",
    },
    "left out": {
        "AXIS1_PLACEMENT.axis": "of the blank; the standard's default is Z",
        "AXIS2_PLACEMENT_3D.axis": "the standard's default is Z, which it was",
        "AXIS2_PLACEMENT_3D.ref_direction": "the standard's default is X, which it was",
        "BALL_ENDMILL.coolant_through_tool": "what the tool can do, not what it does",
        "BALL_ENDMILL.hand_of_cut": "right-hand where nothing is said",
        "FREEFORM_OPERATION.its_machining_strategy": "for information beside an explicit path",
        "FREEFORM_OPERATION.retract_plane": "for information beside an explicit path",
        "MILLING_CUTTING_TOOL.overall_assembly_length": "lengths are those of the setup",
        "MILLING_TOOL_DIMENSION.cutting_edge_length": "lengths are those of the setup; where given they are compared",
        "MILLING_TOOL_DIMENSION.edge_center_horizontal": "follows from diameter and edge radius",
        "MILLING_TOOL_DIMENSION.edge_center_vertical": "follows from diameter and edge radius",
        "MILLING_TOOL_DIMENSION.edge_radius": "of a ball; it is half the diameter",
        "PLANE_CL_STRATEGY.stepover": "for information beside an explicit path",
        "UV_STRATEGY.stepover": "for information beside an explicit path",
        "SETUP.its_origin": "where the setup stands on the machine; paths are in the frame of the first setup",
        "SETUP_INSTRUCTION.description": "for people",
        "WORKPIECE.its_bounding_geometry": "the blank is that of the setup",
        "WORKPIECE.its_material": "for people",
        "WORKPIECE.its_rawpiece": "the blank is that of the setup",
        "WORKPLAN.its_channel": "there is one",
        "WORKPLAN.its_setup": "the workpiece stands at its origin, as without",
    },
    "empty": {
        "PROJECT.its_workpieces": "the workpiece is named by setup and features",
        "SETUP.its_workpiece_setup": "the workpiece stands at its origin, as without",
        "TRIANGULATED_FACE.pnindex": "a shape; the part is that of the STEP file",
        "WORKPIECE_SETUP.its_instructions": "for people",
    },
    "of another type": {
        "SETUP_INSTRUCTION.external_document": "'text' is what it may be: it was left out",
    },
}

# Right by the schema and another job by the standard; that it is not ours shows beside the program.
ANOTHER_JOB = {
    "CUTTER_LOCATION_TRAJECTORY.its_speed": "no rapid then, but at the feed of the operation",
    "CUTTER_LOCATION_TRAJECTORY.its_technology": "at the feed of the operation then",
    "SI_UNIT.prefix": "metres then",
}


def two_steps():
    """A step along exact faces with a tool axis that swings, and one with a fresh cutter, of a round blank."""
    last = replace(clamped().steps[4], access="A1")
    first = replace(last, id="S01", strategy="isoparametric", trajectories=last.trajectories[:3])
    job = shaped(job=clamped())
    return replace(job, steps=(first, replace(last, fresh=True, trajectories=last.trajectories[2:4])))


def same(a: Program, b: Program) -> bool:
    words = ("start", "end", "kind", "feed", "tool", "unknown", "speed", "coolant")
    if not all(np.array_equal(getattr(a, w), getattr(b, w), equal_nan=True) for w in words):
        return False
    if a.poses is not None and b.poses is not None:
        if not np.array_equal(a.poses.end_axis, b.poses.end_axis):
            return False
    return (a.poses is None) == (b.poses is None) and a.remarks == b.remarks and len(a.stops) == len(b.stops)


def entities(text):
    file = Part21File(text, "job")
    return frozenset(" ".join(n for n, _ in file.records(k)) for of in file.entities().values() for k in of)


@pytest.mark.parametrize(("write", "form", "names"), [(write_stepnc_arm, iso14649, False),
                                                      (write_stepnc_aim, ap238, True)], ids=["arm", "aim"])
@pytest.mark.parametrize("rest", [False, True], ids=["all of a small job", "what that has not"])
def test_what_is_broken_is_refused_by_name(write, form, names, rest):
    job = two_steps() if rest else tiny()
    text = write(job)
    good = read_stepnc(text, tools=job.tools, kinematics=MACHINE)
    tables = {**form.TABLE, **{f"+{name}": kinds for name, kinds in form.RECORDS.items()}}
    without = entities(write(tiny())) | {"CARTESIAN_POINT"} if rest else frozenset()
    refused = 0
    for b in broken(text, tables, names=names, most=1 if rest else None, without=without):
        what = f"{b.entity}.{b.attribute}"
        try:
            read = read_stepnc(b.text, tools=job.tools, kinematics=MACHINE)
        except ProgramError as error:
            assert f"#{b.number}" in error.subjects, (b, error.message)
            refused += 1
            continue
        if same(good, read):
            assert (what in WITHOUT_INFLUENCE.get(b.how, {}) or (b.how == "another word" and what in OTHER_WORDS)
                    or (b.how == "left out" and what in NO_DESCRIPTION)), (what, b.how, b.number)
        else:
            assert b.how == "left out" and what in ANOTHER_JOB, (what, b.how, b.number)
            with pytest.raises(InternalError) as differs:
                check_agreement(good, read)
            assert differs.value.code == "stepnc_differs"
    assert refused > (100 if rest else 500)


def test_the_unit_of_a_feed_has_to_be_known():
    """The exception among the names: of the two units that are said by name, the one that counts is refused."""
    text = write_stepnc_aim(tiny()).replace("'revolution')", "'no such word')")
    with pytest.raises(ProgramError, match="revolution, count|'revolution', 'count'"):
        read_stepnc(text)


@pytest.mark.parametrize("schema", ["AUTOMOTIVE_DESIGN", "CONFIG_CONTROL_DESIGN", ""])
def test_a_step_file_that_is_no_step_nc_is_refused_by_its_schema(schema):
    text = write_stepnc_arm(tiny()).replace("('MACHINING_SCHEMA','MILLING_SCHEMA')", f"('{schema}')")
    with pytest.raises(ProgramError, match="not STEP-NC"):
        read_stepnc(text)


@pytest.mark.parametrize(("what", "instead", "message"), [
    ("ENDSEC;\nEND-ISO-10303-21;\n", "", "an instance"),
    ("END-ISO-10303-21;\n", "", "END-ISO-10303-21"),
    ("DATA;", "", "line [0-9]+: "),
    ("#9=PLANE(", "#10=PLANE(", "appears twice"),
    ("#9=PLANE('security plane',#8);", "#9=PLANE('security plane',#8;", "#9 PLANE"),
    ("#9=PLANE('security plane',#8);", "#9=PLANE('security plane',#8));", "#9 PLANE"),
    ("#9=PLANE('security plane',#8);", "#9=PLANE('security plane' #8);", "#9 PLANE"),
    ("#9=PLANE('security plane',#8);", "#9=PLANE('security plane,#8);", "instance"),
    ("#9=PLANE('security plane',#8);", "#9=(PLANE('security plane',#8)", "#9|instance"),
])
def test_text_that_breaks_the_grammar_is_refused_by_its_place(what, instead, message):
    text = write_stepnc_arm(tiny())
    assert what in text
    with pytest.raises(ProgramError, match=message):
        read_stepnc(text.replace(what, instead, 1))


@pytest.mark.parametrize("write", [write_stepnc_arm, write_stepnc_aim], ids=["arm", "aim"])
def test_whatever_is_done_to_the_text_the_answer_is_an_error_of_ours_or_a_reading(write):
    rng, text = np.random.default_rng(5), write(tiny())
    letters = "#0123456789.,()'$*;=/ \n\\EAX-+_\""
    for _ in range(150):
        at = int(rng.integers(len(text)))
        letter = letters[int(rng.integers(len(letters)))]
        broken_text = text[:at] + ("", letter, letter + text[at])[int(rng.integers(3))] + text[at + 1:]
        try:
            read_stepnc(broken_text, tools=tiny().tools)
        except ProgramError as error:
            assert error.message


@pytest.mark.parametrize(("what", "instead"), [
    ("#9=PLANE('security plane',#8);", "#9=PLANE(" + "(" * 5000 + ");"),
    ("#9=PLANE('security plane',#8);", "#9=PLANE('security plane',#" + "9" * 5000 + ");"),
    ("(0.,0.,25.)", "(0.,0.,1.E999)"),
    ("(10.0000,0.0000,5.0000)", "(10.0000,0.0000,1.E999)"),
    ("(10.0000,0.0000,5.0000)", "(10.0000,0.0000,5.E7)"),
    ("WORKPLAN('setup G54',(", "WORKPLAN('setup G54',(#2,"),
])
def test_what_has_no_end_or_no_size_is_refused(what, instead):
    text = write_stepnc_arm(tiny())
    assert what in text
    with pytest.raises(ProgramError):
        read_stepnc(text.replace(what, instead, 1))


def test_a_unit_that_is_made_of_itself_is_refused():
    text = write_stepnc_aim(tiny())
    with pytest.raises(ProgramError, match="contain themselves"):
        read_stepnc(text.replace("#21=DERIVED_UNIT_ELEMENT(#18,-1.)", "#21=DERIVED_UNIT_ELEMENT(#23,-1.)"))
