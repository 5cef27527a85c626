"""Base of all wire models: unknown fields are refused, numbers are finite, and setups may refer to libraries.

A *library reference* is the string ``"lib:NAME"`` or ``"lib:NAME@VERSION"`` in place of an object (a tool, the machine,
the material). The entry of the library replaces it before validation. The validation context holds the entries:
``{"library": {"tools": {...}, "machines": {...}, "materials": {...}}}``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

LIBRARY_PREFIX = "lib:"
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
REFERENCE_PATTERN = r"^lib:[A-Za-z0-9][A-Za-z0-9._-]{0,63}(@[1-9][0-9]{0,8})?$"

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite JSON number; strings and booleans are refused."""
Count = Annotated[int, Field(strict=True)]
"""A JSON integer; strings and booleans are refused."""
LARGEST = 1e6
"""Largest component of a position (mm) or direction. It is a kilometre; double precision resolves 0.001 µm there."""
BoundedNumber = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
"""A number of no more than ``LARGEST`` in size."""
Triple = Annotated[list[BoundedNumber], Field(min_length=3, max_length=3)]
"""A position or direction: three numbers x, y, z within ``LARGEST``."""
FaceId = Annotated[str, Field(pattern=r"^F[1-9][0-9]{0,6}$", examples=["F12"])]
"""A B-rep face by its place in the STEP file."""


class WireModel(BaseModel):
    """Base of everything that a client may send: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, str_max_length=4000)


class ReportModel(BaseModel):
    """Base of everything that the service sends. Later versions may add fields, so unknown fields are kept."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)


def split_reference(text: str) -> tuple[str, int | None]:
    """Name and version of the text after "lib:"; the version is None for the newest.

    >>> split_reference("finisher"), split_reference("finisher@3"), split_reference("finisher@x")
    (('finisher', None), ('finisher', 3), ('finisher@x', None))
    """
    name, at, version = text.rpartition("@")
    if at and version.isascii() and version.isdecimal() and not version.startswith("0") and len(version) < 10:
        return name, int(version)
    return text, None


def library_entry(value: Any, shelf: str, info: ValidationInfo) -> Any:
    """Replace ``"lib:NAME"`` by the entry of that shelf; any other value passes through.

    value : value in the setup
    shelf : 'tools', 'machines' or 'materials'
    info  : has the libraries in ``context["library"]``

    Raises
    ------
    ValueError
        The shelf has no such entry; the message lists the entries it has.
    """
    if not (isinstance(value, str) and value.startswith(LIBRARY_PREFIX)):
        return value
    library: Mapping[str, Mapping[str, Any]] = (info.context or {}).get("library", {})
    entries, name = library.get(shelf, {}), value[len(LIBRARY_PREFIX):]
    if name not in entries:
        known = ", ".join(sorted(entries)) or "none"
        raise ValueError(f"the library of {shelf} has no entry '{name}' (it has: {known})")
    return entries[name]


class Shelf:
    """Annotation: the field also accepts ``"lib:NAME"``, an entry of this shelf. The JSON schema states it too."""

    def __init__(self, shelf: str) -> None:
        self.shelf = shelf

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return BeforeValidator(lambda v, info: library_entry(v, self.shelf, info)).__get_pydantic_core_schema__(
            source, handler)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [handler(schema), {"type": "string", "pattern": REFERENCE_PATTERN,
                                            "title": f"Reference into /v1/{self.shelf}"}]}
