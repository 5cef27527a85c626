"""The contents of a setup sheet as words, tables and pictures. The web page and the PDF are both made of it."""

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

    title  : what it lists
    heads  : of the columns, with their units
    widths : relative, one for each column
    right  : columns of numbers, index
    none   : text that stands in place of a table without rows
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
    """A title with sentences, one below the other."""

    title: str
    texts: tuple[str, ...]
    kind: str = "lines"


@dataclass(frozen=True)
class Picture:
    """A PNG with a text that describes it."""

    png: bytes
    alt: str
    kind: str = "picture"


@dataclass(frozen=True)
class ToolCard:
    """The drawing of a tool with its facts and cautions."""

    heading: str
    drawing: ToolDrawing
    facts: Facts
    mind: tuple[str, ...] = ()
    kind: str = "tool"


Block = Facts | Table | Lines | Picture | ToolCard


@dataclass(frozen=True)
class SheetSection:
    """A heading and the blocks below it.

    key : its anchor
    """

    key: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class SetupSheet:
    """A whole sheet.

    proved  : whether the job is proved
    verdict : the same in a sentence
    foot    : line at the end of every page
    """

    title: str
    proved: bool
    verdict: str
    foot: str
    sections: tuple[SheetSection, ...]


__all__ = ["Block", "Facts", "Lines", "Picture", "SheetSection", "SetupSheet", "Table", "ToolCard"]
