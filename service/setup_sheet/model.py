"""What stands on a setup sheet, as plain words, tables and pictures: the web page and the PDF are made of the same."""

from __future__ import annotations

from dataclasses import dataclass

from service.pictures.tool_drawing import ToolDrawing


@dataclass(frozen=True)
class Facts:
    """Names and values."""

    pairs: tuple[tuple[str, str], ...]
    kind: str = "facts"


@dataclass(frozen=True)
class Table:
    """A table whose first column names its rows.

    title  : what it lists; heads : of the columns, units with them
    widths : relative, one per column; right : columns of numbers
    none   : what is said where there is no row
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    widths: tuple[float, ...]
    right: frozenset[int] = frozenset()
    none: str = "None."
    kind: str = "table"


@dataclass(frozen=True)
class Lines:
    """Sentences, one below the other, and what they are."""

    title: str
    texts: tuple[str, ...]
    kind: str = "lines"


@dataclass(frozen=True)
class Picture:
    """A PNG, and in words what is to be seen on it."""

    png: bytes
    alt: str
    kind: str = "picture"


@dataclass(frozen=True)
class ToolCard:
    """The drawing of a tool with what does not fit on it, and what to mind."""

    heading: str
    drawing: ToolDrawing
    facts: Facts
    mind: tuple[str, ...] = ()
    kind: str = "tool"


Block = Facts | Table | Lines | Picture | ToolCard


@dataclass(frozen=True)
class SheetSection:
    """A heading with what stands below it. key : its anchor."""

    key: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class SetupSheet:
    """A whole sheet. proved : the job is; verdict : that in a sentence; foot : at the end of every page."""

    title: str
    proved: bool
    verdict: str
    foot: str
    sections: tuple[SheetSection, ...]


__all__ = ["Block", "Facts", "Lines", "Picture", "SheetSection", "SetupSheet", "Table", "ToolCard"]
