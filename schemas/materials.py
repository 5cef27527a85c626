"""Workpiece materials and their default cutting data.

The figures are shop practice, deliberately low, for slender coated carbide tools with coolant. docs/theory/feeds.md
says
which of them have been checked against a source. A shop with its own figures writes a material into the library
(``/v1/materials``) or into the setup, or gives a tool its speed and feed.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, ValidationInfo, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from schemas.base import Number, WireModel, library_entry

SOURCE = "shop practice, deliberately low"


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

ALIASES: dict[str, str] = {
    "ti6al4v": "Ti-6Al-4V", "titaniumgrade5": "Ti-6Al-4V", "3.7165": "Ti-6Al-4V",
    "in718": "Inconel 718", "2.4668": "Inconel 718",
    "6082": "AlMgSi1 6082", "almgsi1": "AlMgSi1 6082", "enaw6082": "AlMgSi1 6082", "al6082": "AlMgSi1 6082",
    "7075": "AlZnMgCu1.5 7075", "enaw7075": "AlZnMgCu1.5 7075", "al7075": "AlZnMgCu1.5 7075",
    "304": "1.4301", "aisi304": "1.4301", "x5crni1810": "1.4301",
    "1.4404": "316L", "aisi316l": "316L",
    "1.0503": "C45", "1045": "C45", "aisi1045": "C45",
}


def _key(name: str) -> str:
    return name.casefold().replace(" ", "").replace("-", "").replace("_", "")


_BY_KEY = {_key(n): n for n in MATERIALS} | {_key(a): n for a, n in ALIASES.items()}


def find_material(name: str) -> Material:
    """The built-in material of that name; case, spaces and hyphens do not matter.

    Raises
    ------
    ValueError
        There is no such material; the message lists those that exist.

    >>> find_material("ti6al4v").name
    'Ti-6Al-4V'
    """
    found = _BY_KEY.get(_key(name))
    if found is None:
        raise ValueError(f"unknown material '{name}' (known: {', '.join(MATERIALS)}); "
                         "give one of these, an object with its cutting data, or 'lib:NAME'")
    return MATERIALS[found]


def same_material(name: str, other: str) -> bool:
    """Whether two names mean one material: equal but for case, spaces and hyphens, or names of one built-in material.

    >>> same_material("ti6al4v", "Ti-6Al-4V"), same_material("AISI 304", "1.4301"), same_material("C45", "316L")
    (True, True, False)
    """
    keys = _key(name), _key(other)
    return keys[0] == keys[1] or (keys[0] in _BY_KEY and _BY_KEY[keys[0]] == _BY_KEY.get(keys[1]))


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
