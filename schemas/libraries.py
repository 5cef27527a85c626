"""Import of a tool library: what became of each entry."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.tools import Tool

LengthUnit = Literal["mm", "in"]
Verdict = Literal["taken", "noted", "left_out"]


class ImportedEntry(ReportModel):
    """One entry of a library, and what became of it."""

    place: Annotated[str, Field(description="Where the entry stands in the library.", examples=["entry 3", "row 7"])]
    verdict: Annotated[Verdict, Field(
        description="taken: everything that the tool needs is stated. noted: the entry is taken, and notes say which "
                    "default was used and what was left out. left_out: the entry is not taken, for the reason given.")]
    reason: Annotated[str | None, Field(description="Why the entry is left out.")] = None
    notes: Annotated[list[str], Field(description="Defaults that were used, and what was left out.")] = []
    library_id: Annotated[str, Field(description="Id of the entry in its library; empty where it states none. It is "
                                                 "never a pocket.")] = ""
    stated_kind: Annotated[str, Field(description="Kind of the tool in the words of the library.")] = ""
    description: Annotated[str, Field(description="Description in the library.")] = ""
    order_code: Annotated[str, Field(description="Order number of the cutter.")] = ""
    t_number: Annotated[int | None, Field(description="T number in the library.")] = None
    h_number: Annotated[int | None, Field(description="H number (length offset) in the library.")] = None
    d_number: Annotated[int | None, Field(description="D number (diameter offset) in the library.")] = None
    pocket: Annotated[int | None, Field(description="Pocket of the magazine in the library. It is not used.")] = None
    name: Annotated[str | None, Field(description="Name in /v1/tools, and id of the tool. null for an entry that is "
                                                  "left out.")] = None
    version: Annotated[int | None, Field(description="Version that was written. null in a dry run and for an entry "
                                                     "that is left out.")] = None
    tool: Annotated[Tool | None, Field(description="The tool. null for an entry that is left out.")] = None


class LibraryImport(ReportModel):
    """Result of the import of a tool library."""

    format: Annotated[str, Field(description="Format as which the library was read.")]
    dry_run: Annotated[bool, Field(description="true: nothing was stored.")]
    taken: Annotated[int, Field(ge=0, description="Number of entries with verdict taken.")]
    noted: Annotated[int, Field(ge=0, description="Number of entries with verdict noted.")]
    left_out: Annotated[int, Field(ge=0, description="Number of entries with verdict left_out.")]
    entries: Annotated[list[ImportedEntry], Field(description="All entries, in the order of the library.")]
