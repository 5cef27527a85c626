"""Workpiece materials and their default cutting data.

Seven materials have figures of their own: shop practice, deliberately low, for slender coated carbide tools with
coolant. Others get those of their group (``schemas.material_groups``). docs/theory/feeds.md says which figures have
been checked against a source. A shop with its own figures writes a material into the library (``/v1/materials``) or
into the setup, or gives a tool its speed and feed.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, ValidationInfo, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from schemas.base import Number, WireModel, library_entry
from schemas.material_groups import GROUPS, MILLING, built_in_name, group_of, key, similar

SOURCE = "shop practice, deliberately low"
OF_GROUP = "typical of the group, deliberately low"


class FeedPoint(WireModel):
    """Feed per tooth at one cutter diameter; between two points the feed is interpolated linearly."""

    diameter_mm: Annotated[Number, Field(ge=1e-3, le=2000, description="Cutter diameter, mm.")]
    feed_per_tooth_mm: Annotated[Number, Field(ge=1e-5, le=2, description="Feed per tooth at that diameter, mm.")]


class Material(WireModel):
    """A workpiece material with its cutting data."""

    name: Annotated[str, Field(
        min_length=1, max_length=64, description="Name of the material; programs state it in their "
                                                 "header.", examples=["Ti-6Al-4V"])]
    cutting_speed_m_min: Annotated[Number, Field(
        ge=0.1, le=5000, description="Cutting speed at the full diameter, m/min.")]
    feed_per_tooth: Annotated[list[FeedPoint], Field(
        min_length=1, description="Feeds per tooth, by ascending cutter diameter. Below the first and above the last "
                                  "diameter the feed is proportional to the diameter.")]
    specific_cutting_force_n_mm2: Annotated[Number | None, Field(
        ge=1, le=100000, description="kc1.1: cutting force of a chip of 1 mm by 1 mm, N/mm2. The deflection of tools "
                                     "is estimated from it; null: no estimate.")] = None
    chip_thickness_exponent: Annotated[Number | None, Field(
        ge=0, le=0.9, description="mc: the specific cutting force of a chip h mm thick is kc1.1 / h^mc. Give both or "
                                  "none.")
    ] = None
    source: Annotated[str, Field(max_length=200, description="Where the figures come from.")] = "user"
    group: Annotated[str | None, Field(
        max_length=200, description="Group of materials whose figures these are, if the material has none of its own; "
                                    "null: they are figures of the material.")] = None

    @model_validator(mode="after")
    def _both_or_none(self) -> Material:
        if (self.specific_cutting_force_n_mm2 is None) != (self.chip_thickness_exponent is None):
            raise ValueError("specific_cutting_force_n_mm2 and chip_thickness_exponent: give both or none")
        return self

    @model_validator(mode="after")
    def _ascending(self) -> Material:
        d = [p.diameter_mm for p in self.feed_per_tooth]
        if any(b <= a for a, b in pairwise(d)):
            raise ValueError("feed_per_tooth must be listed by strictly ascending diameter_mm")
        return self


def _material(name: str, speed: float, force: float, exponent: float, *feeds: float) -> Material:
    """A built-in material; ``feeds`` in mm per tooth at 1, 3, 6, 12 and 20 mm; kc1.1, N/mm2, and mc."""
    points = [FeedPoint(diameter_mm=d, feed_per_tooth_mm=f)
              for d, f in zip((1.0, 3.0, 6.0, 12.0, 20.0), feeds, strict=True)]
    return Material(name=name, cutting_speed_m_min=speed, feed_per_tooth=points, specific_cutting_force_n_mm2=force,
                    chip_thickness_exponent=exponent, source=SOURCE)


MATERIALS: dict[str, Material] = {m.name: m for m in (
    _material("Ti-6Al-4V", 60.0, 1700.0, 0.23, 0.006, 0.016, 0.030, 0.055, 0.080),
    _material("Inconel 718", 25.0, 3300.0, 0.25, 0.004, 0.011, 0.020, 0.038, 0.055),
    _material("AlMgSi1 6082", 250.0, 564.0, 0.27, 0.010, 0.030, 0.055, 0.100, 0.150),
    _material("AlZnMgCu1.5 7075", 250.0, 705.0, 0.27, 0.010, 0.030, 0.055, 0.100, 0.150),
    _material("1.4301", 80.0, 2400.0, 0.20, 0.006, 0.016, 0.030, 0.055, 0.080),
    _material("316L", 75.0, 2400.0, 0.20, 0.006, 0.016, 0.030, 0.055, 0.080),
    _material("C45", 130.0, 2640.0, 0.24, 0.008, 0.020, 0.038, 0.070, 0.100),
)}
"""The built-in materials by name."""

def known_material(name: str) -> Material | None:
    """The material of that name, as ``find_material``; None where there is none."""
    if (own := built_in_name(name)) is not None:
        return MATERIALS[own]
    found = group_of(name)
    return None if found is None else _of_group(*found)


def find_material(name: str) -> Material:
    """The material of that name: EN, DIN, material number, AISI, UNS or trade name, or a group of materials.

    Case, spaces, hyphens, a standard before the name, and a temper or delivery condition behind it do not matter.

    Raises
    ------
    ValueError
        There is no such material; the message lists similar ones.

    >>> find_material("ti6al4v").name, find_material("AISI D2").name
    ('Ti-6Al-4V', 'X153CrMoV12')
    >>> find_material("AISI D2").group
    'VDI 3323 no. 10, ISO P: high-alloy steel and tool steel, annealed'
    """
    if (found := known_material(name)) is not None:
        return found
    near = similar(name)
    listed = f"similar: {', '.join(near)}" if near else f"with figures of their own: {', '.join(MATERIALS)}"
    raise ValueError(f"unknown material '{name}' ({listed}); give the EN, DIN, AISI or UNS name or the material "
                     "number, a group as 'ISO P' (or M, K, N, S, H), an object with its cutting data, or 'lib:NAME'")


def _of_group(name: str, number: int) -> Material:
    """A material with the figures of a group."""
    g = GROUPS[number]
    small, large = g.feeds
    points = [FeedPoint(diameter_mm=d, feed_per_tooth_mm=round(share * d, 6))
              for d, share in ((3.0, small), (20.0, large))]
    return Material(name=name, cutting_speed_m_min=g.speed, feed_per_tooth=points,
                    specific_cutting_force_n_mm2=round(MILLING * g.force), chip_thickness_exponent=g.exponent,
                    source=OF_GROUP, group=f"VDI 3323 no. {number}, ISO {g.iso}: {g.what}")


def has_own_speed(material: Material) -> bool:
    """Whether the speed is one of those of this module, which hold for slots: a finish may be faster."""
    return material in MATERIALS.values() or material.source == OF_GROUP


def same_material(name: str, other: str) -> bool:
    """Whether two names mean one material: equal but for case, spaces and hyphens, or names of one known material.

    >>> same_material("ti6al4v", "Ti-6Al-4V"), same_material("AISI 304", "1.4301"), same_material("C45", "316L")
    (True, True, False)
    >>> same_material("D2", "1.2379"), same_material("D2", "1.2080")
    (True, False)
    """
    if key(name) == key(other):
        return True
    for known in (built_in_name, group_of):
        if (found := known(name)) is not None:
            return found == known(other)
    return False


def _resolve(value: Any, info: ValidationInfo) -> Any:
    value = library_entry(value, "materials", info)
    return find_material(value) if isinstance(value, str) else value


class _NameOrObject:
    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return BeforeValidator(_resolve).__get_pydantic_core_schema__(source, handler)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"type": "string", "maxLength": 200}, handler(schema)]}


MaterialField = Annotated[Material, _NameOrObject()]
"""A material by built-in name, by ``"lib:NAME"``, or as an object."""
