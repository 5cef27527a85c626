"""The setup sheet on A4 pages, drawn by fpdf2: text in a font that every reader has, lines, areas and PNGs."""

from __future__ import annotations

import io
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import zip_longest

from fpdf import FPDF
from fpdf.enums import TableBordersLayout
from fpdf.fonts import FontFace
from PIL import Image

from output.header_text import ascii_text
from output.stepnc.part21 import time_stamp
from service.pictures.tool_drawing import HEIGHT, LETTER, WIDTH, ToolDrawing
from service.setup_sheet.model import Block, Facts, Lines, Picture, SetupSheet, SheetSection, Table, ToolCard

MARGIN, FOOT = 12.0, 14.0  # mm
INK, QUIET, BAD, GOOD = (20, 24, 29), (74, 82, 92), (163, 13, 23), (11, 90, 42)
SOFT, LINE, PAPER = (238, 241, 245), (138, 146, 156), (255, 255, 255)
FILLS = {"flutes": (106, 165, 221), "neck": (185, 195, 206), "shank": (213, 220, 228), "holder": (152, 161, 171)}
STROKES = {"measure": 0.12, "axis": 0.08, "spindle": 0.35}
POINTS_PER_MM = 72.0 / 25.4
CELL = 240  # characters of a table cell; a longer text goes on in a row below, since a row must fit onto a page
MIN_BELOW_HEADING = 34.0  # mm that a heading needs below it on its page; else it goes onto the next page
PAGES = "\x7f\x7f"  # placeholder for the number of pages; ``latin`` keeps these letters out of the sheet
BESIDE = 11  # facts beside the drawing of a tool; the others stand below it


def latin(text: str) -> str:
    """Text in the letters of the standard PDF fonts; other letters are spelt out or become '?'.

    >>> latin("Ø8 ±0.1 → Łódź")
    'Ø8 ±0.1 ? Lódz'
    """
    known = (c if " " <= c <= "~" or "\xa1" <= c <= "\xff" else " " if c.isspace() else ascii_text(c) for c in text)
    return "".join(known)


class _Pages(FPDF):
    """A4 pages, each with the title of the sheet and its number."""

    def __init__(self, sheet: SetupSheet) -> None:
        super().__init__("portrait", "mm", "A4")
        self.sheet = sheet
        self.set_margin(MARGIN)
        self.set_auto_page_break(True, FOOT + 4.0)
        self.set_creation_date(datetime.fromisoformat(time_stamp()).replace(tzinfo=UTC))
        self.set_title(latin(sheet.title))
        self.set_lang("en")
        self.set_producer("zonemill")
        self.alias_nb_pages(PAGES)
        self.add_page()

    def write_as(self, size: float, style: str = "", colour: tuple[int, int, int] = INK) -> None:
        """Write in Helvetica from here on, size in points."""
        self.set_font("Helvetica", style, size)
        self.set_text_color(*colour)

    def header(self) -> None:
        """Title from the second page on, with a warning where the job is not proved."""
        if self.page_no() == 1:
            return
        self.write_as(8, "B", INK if self.sheet.proved else BAD)
        state = "" if self.sheet.proved else "UNPROVED: nothing may be run. "
        self.cell(0, 5, self.fitted(state + self.sheet.title, self.epw), new_x="LMARGIN", new_y="NEXT")
        self.ln(1)

    def footer(self) -> None:
        """The foot line and the number of the page."""
        self.set_y(-FOOT)
        self.write_as(7, "", QUIET)
        self.cell(self.epw - 24.0, 5, self.fitted(self.sheet.foot, self.epw - 26.0))
        self.cell(24.0, 5, f"page {self.page_no()} of {PAGES}", align="R")

    def fitted(self, text: str, width: float) -> str:
        """The beginning of a text that fits into ``width`` mm."""
        shown = latin(text)
        while self.get_string_width(shown) > width - 2.0:
            shown = shown.removesuffix("...")[:-1] + "..."
        return shown

    def need(self, height: float) -> None:
        """Begin a new page where less than ``height`` mm are left on this one."""
        if self.will_page_break(height):
            self.add_page()


def pdf_of(sheet: SetupSheet) -> bytes:
    """The sheet as a PDF; the same sheet gives the same bytes.

    Raises
    ------
    OutputError
        Code 'bad_epoch': SOURCE_DATE_EPOCH is no number.
    """
    pages = _Pages(sheet)
    _head(pages)
    for section in sheet.sections:
        _section(pages, section)
    return bytes(pages.output())


def _head(p: _Pages) -> None:
    p.write_as(16, "B")
    p.multi_cell(0, 8, latin(p.sheet.title), align="L", new_x="LMARGIN", new_y="NEXT")
    p.ln(1)
    p.set_fill_color(*(GOOD if p.sheet.proved else BAD))
    p.write_as(14 if p.sheet.proved else 36, "B", PAPER)
    p.cell(0, 8 if p.sheet.proved else 17, "PROVED" if p.sheet.proved else "UNPROVED", fill=True, new_x="LMARGIN",
           new_y="NEXT")
    p.write_as(10, "", PAPER)
    p.multi_cell(0, 6, latin(p.sheet.verdict), fill=True, align="L", new_x="LMARGIN", new_y="NEXT")


def _section(p: _Pages, section: SheetSection) -> None:
    first = section.blocks[0]
    p.need(_height(p, first) + 20.0 if isinstance(first, Picture) else MIN_BELOW_HEADING)
    p.ln(4)
    p.start_section(latin(section.title))
    p.write_as(12, "B")
    p.cell(0, 7, latin(section.title), border="B", new_x="LMARGIN", new_y="NEXT")
    p.ln(1.5)
    for block in section.blocks:
        _block(p, block)


def _block(p: _Pages, block: Block) -> None:
    if isinstance(block, Facts):
        _facts(p, block)
    elif isinstance(block, Table):
        _table(p, block)
    elif isinstance(block, Lines):
        p.need(5.0 + 3.0 * 4.4)
        p.write_as(8.5, "I", QUIET)
        p.cell(0, 5, latin(block.title), new_x="LMARGIN", new_y="NEXT")
        p.write_as(8.5)
        for text in block.texts:
            p.multi_cell(0, 4.4, latin(f"\xb7 {text}"), align="L", new_x="LMARGIN", new_y="NEXT")
        p.ln(1.5)
    elif isinstance(block, Picture):
        _picture(p, block)
    else:
        _card(p, block)


def _facts(p: _Pages, facts: Facts) -> None:
    p.write_as(8.5)
    p.set_fill_color(*PAPER)
    rows = [[latin(cell) for cell in piece] for pair in facts.pairs for piece in _pieces(pair)]
    with p.table(rows=rows, col_widths=(40, 146), borders_layout=TableBordersLayout.NONE,
                 first_row_as_headings=False, text_align="LEFT", v_align="TOP", line_height=4.4):
        pass
    p.ln(1.5)


def _table(p: _Pages, table: Table) -> None:
    if not table.rows:
        p.write_as(8.5)
        p.multi_cell(0, 4.4, latin(table.none), align="L", new_x="LMARGIN", new_y="NEXT")
        p.ln(1.5)
        return
    p.need(24.0)
    p.write_as(8, "I", QUIET)
    p.multi_cell(0, 5, latin(table.title), align="L", new_x="LMARGIN", new_y="NEXT")
    p.write_as(7)
    p.set_fill_color(*PAPER)  # rows are filled with whatever was last set
    p.set_draw_color(*LINE)
    p.set_line_width(0.1)
    right = ["RIGHT" if k in table.right else "LEFT" for k in range(len(table.heads))]
    rows = [table.heads, *(piece for row in table.rows for piece in _pieces(row))]
    with p.table(rows=[[latin(cell) for cell in row] for row in rows], col_widths=table.widths, text_align=right,
                 v_align="TOP", line_height=3.3, padding=(0.4, 0.7),
                 headings_style=FontFace(emphasis="BOLD", fill_color=SOFT)):
        pass
    p.ln(2.5)


def _pieces(row: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """A row as several rows where its longest cell needs them."""
    for parts in zip_longest(*(list(_cut(cell)) for cell in row), fillvalue=""):
        yield tuple(parts)


def _cut(text: str) -> Iterator[str]:
    """Text in pieces of at most ``CELL`` characters, split between words where possible."""
    while len(text) > CELL:
        at = text.rfind(" ", 1, CELL)
        at = CELL if at < 0 else at
        yield text[:at]
        text = text[at:].lstrip()
    yield text


def _height(p: _Pages, picture: Picture) -> float:
    """Height, mm, of a picture as wide as the page."""
    with Image.open(io.BytesIO(picture.png)) as image:
        return p.epw * image.height / image.width


def _picture(p: _Pages, picture: Picture) -> None:
    p.need(_height(p, picture) + 8.0)
    p.image(io.BytesIO(picture.png), x=p.l_margin, w=p.epw, alt_text=latin(picture.alt))
    p.write_as(7.5, "", QUIET)
    p.multi_cell(0, 3.8, latin(picture.alt), align="L", new_x="LMARGIN", new_y="NEXT")
    p.ln(1.5)


def _card(p: _Pages, card: ToolCard) -> None:
    """The drawing of a tool with its facts beside it; further facts and cautions below."""
    p.need(HEIGHT + 14.0)
    p.write_as(10, "B")
    p.cell(0, 6, latin(card.heading), new_x="LMARGIN", new_y="NEXT")
    x, top = p.l_margin, p.get_y()
    _drawing(p, card.drawing, x, top)
    left, y = x + WIDTH + 3.0, top + 4.0
    for name, value in card.facts.pairs[:BESIDE]:
        p.set_xy(left, y)
        p.write_as(8, "", QUIET)
        p.multi_cell(24.0, 3.8, latin(name), align="L", new_x="LEFT", new_y="NEXT")
        under = p.get_y()
        p.set_xy(left + 24.0, y)
        p.write_as(8)
        p.multi_cell(p.epw - WIDTH - 27.0, 3.8, latin(value), align="L", new_x="LMARGIN", new_y="NEXT")
        y = max(under, p.get_y()) + 0.6
    p.set_xy(p.l_margin, max(top + HEIGHT + 1.0, y))
    if len(card.facts.pairs) > BESIDE:
        _facts(p, Facts(card.facts.pairs[BESIDE:]))
    p.write_as(8.5, "", BAD)
    for text in card.mind:
        p.multi_cell(0, 4.4, latin(text), align="L", new_x="LMARGIN", new_y="NEXT")
    p.ln(3.0)


def _drawing(p: _Pages, drawing: ToolDrawing, x: float, y: float) -> None:
    """The shapes of a drawing with its corner at (x, y) mm of the page."""
    p.set_draw_color(*INK)
    p.set_line_width(0.2)
    for area in drawing.areas:
        p.set_fill_color(*FILLS[area.part])
        p.polygon([(x + a, y + b) for a, b in area.points], style="DF")
    for stroke in drawing.strokes:
        p.set_line_width(STROKES[stroke.kind])
        p.polyline([(x + a, y + b) for a, b in stroke.points])
    p.write_as(LETTER * POINTS_PER_MM)
    for word in drawing.words:
        text = latin(word.text)
        back = {"start": 0.0, "middle": 0.5, "end": 1.0}[word.anchor] * p.get_string_width(text)
        p.text(x + word.at[0] - back, y + word.at[1], text)


__all__ = ["latin", "pdf_of"]
