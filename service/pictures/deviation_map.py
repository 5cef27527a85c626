"""deviation.png: the part coloured by the deviation that the proof measured.

There are two views. Red is cut too deep, green is within the budget, blue is too high. Hatched grey was never reached
by
a cut; pale was not judged. Every pixel has the class of the nearest sample of its face. Samples outside the budget are
drawn as dots over it, so that none is lost between pixels. Rings mark the deepest gouges and the place with most stock
left. The same input gives the same bytes, without clock and random numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh import F64
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from output.header_text import ascii_text, decimal
from service.pictures.annotation import (
    GREY,
    INK,
    RGB,
    WHITE,
    bytes_of,
    draw_pairs,
    draw_scale,
    draw_triad,
    font,
)
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas
from service.pictures.scene import add_edges, lit
from service.pictures.view_selection import choose_views, seen

SIZE = (1760, 960)
HEADER, LEGEND, GUTTER = 56, 132, 8
STEPS = (3.0, 10.0)  # times the budget at which a class ends
GREEN, UNCUT = 3, 7  # classes; 0 to 2 are gouges, the deepest first, 4 to 6 are too high, the highest last
COLOURS: tuple[RGB, ...] = ((0.45, 0.0, 0.10), (0.86, 0.06, 0.06), (1.0, 0.52, 0.32), (0.60, 0.83, 0.56),
                            (0.55, 0.78, 1.0), (0.18, 0.48, 0.95), (0.06, 0.14, 0.58), (0.66, 0.66, 0.68))
PALE: RGB = (0.93, 0.92, 0.89)
HATCH: RGB = (0.36, 0.36, 0.40)
MAX_RINGS, RING = 5, 14  # and their radius, pixels
MAX_RING_PLACES = 200  # of equal places for a ring
Box = tuple[float, float, float, float]
INT8 = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements of the proof at the samples.

    samples : SurfaceSamples, n of them, in the frame of the part
    excess  : (n,) float64, mm over the allowance, negative where cut too deep
    reached : (n,) bool, whether a feed move removed stock there
    scallop, gouge : mm, the budget: -gouge <= excess <= scallop
    """

    samples: SurfaceSamples
    excess: F64
    reached: NDArray[np.bool_]
    scallop: float
    gouge: float

    @property
    def classes(self) -> INT8:
        """(n,) int8, index of the row of ``COLOURS`` for each sample."""
        out = np.searchsorted(self.limits, self.excess, side="left").astype(np.int8)
        out[~self.reached & (out > GREEN)] = UNCUT
        return out

    @property
    def limits(self) -> F64:
        """(6,) float64, mm: upper end of excess for each class but the last."""
        low, high = self.gouge + 1e-6, self.scallop + 1e-6  # tolerance of the proof
        return np.array([-STEPS[1] * low, -STEPS[0] * low, -low, high, STEPS[0] * high, STEPS[1] * high])


@dataclass(frozen=True, eq=False)
class Mark:
    """A place with a ring and text beside it.

    places : (k, 3) float64, mm, frame of the part; equally good places, of which a visible one gets the ring
    """

    places: F64
    text: str
    colour: RGB


def draw_deviation(part: Part, measured: Measured, marks: Sequence[Mark], out_path: str | Path, title: str,
                   facts: Mapping[str, str]) -> None:
    """Draw the deviations into a PNG of 1760 x 960 pixels.

    part     : Part, mm; measured : Measured in its frame
    marks    : most severe first; five are drawn
    out_path : file to write
    title    : one line of text
    facts    : up to ten pairs for the legend, for example {'coverage': '97.2 %'}
    """
    width, height = (SIZE[0] - GUTTER) // 2, SIZE[1] - HEADER - LEGEND
    classes = measured.classes
    near = measured.samples.by_face
    cameras = choose_views(part.mesh, measured.samples, classes != GREEN, (2 * width, 2 * height))
    sheet = Image.new("RGB", SIZE, bytes_of(WHITE))
    pen = ImageDraw.Draw(sheet)
    free = list(marks[:MAX_RINGS])
    for k, camera in enumerate(cameras):
        x = k * (width + GUTTER)
        canvas = _painted(part, measured, classes, near, camera)
        sheet.paste(Image.fromarray(canvas.halved()), (x, HEADER))
        taken: list[Box] = []
        for mark in list(free):
            visible = mark.places[seen(canvas, camera, mark.places)]
            if len(visible) or k == 1:
                free.remove(mark)
                _ring(pen, camera, mark, visible, x, width, taken)
        draw_triad(pen, camera, (x + 54, SIZE[1] - LEGEND - 54))
        draw_scale(pen, camera, (x + width - 24, SIZE[1] - LEGEND - 24))
    pen.text((20, 14), ascii_text(title), font=font(26), fill=bytes_of(INK))
    for k, caption in enumerate(("What the program leaves on the part", "The same from another side")):
        pen.text((20 + k * (width + GUTTER), HEADER + 12), caption, font=font(17), fill=bytes_of(GREY))
    top = SIZE[1] - LEGEND + 12
    draw_pairs(pen, list(facts.items()), 20, top, wide=330, indent=130)
    _scale(pen, measured, 720, top)
    _signs(pen, 1490, top)
    sheet.save(out_path, format="PNG", optimize=False, compress_level=6)


def _painted(part: Part, measured: Measured, classes: INT8, near: KeyedPoints, camera: Camera) -> Canvas:
    """One view: light, classes, dots of samples outside the budget, edges."""
    canvas = lit(part.mesh, np.ones((len(part.faces) + 1, 3), np.float32), camera)
    shown = _class_of_pixels(canvas, camera, near, classes)
    table = np.array([*COLOURS, PALE], np.float32)  # -1, not judged, is the last
    solid = canvas.owner > 0
    aside = solid & (shown < 0)
    canvas.colour[aside] = 0.5 + 0.5 * canvas.colour[aside]  # less shade, so that it stays pale
    canvas.colour[solid] *= table[shown[solid]]
    y, x = np.nonzero(shown == UNCUT)
    stripe = (x + y) % 14 < 4
    canvas.colour[y[stripe], x[stripe]] = HATCH
    for k in (4, 5, 6, 2, 1, 0):
        canvas.dots(camera.screen(measured.samples.points[classes == k]), COLOURS[k], bias=0.05 * camera.scale)
    add_edges(canvas, part, camera)
    return canvas


def _class_of_pixels(canvas: Canvas, camera: Camera, near: KeyedPoints, classes: INT8) -> INT8:
    """(h, w): class of the nearest sample of the visible face; -1 where the face has none or no face is visible.

    near : the samples by face
    """
    out = np.full(canvas.owner.shape, -1, np.int8)
    y, x = np.nonzero(np.isin(canvas.owner, near.keys) & (canvas.owner > 0))
    places = camera.places(np.column_stack([x + 0.5, y + 0.5, canvas.depth[y, x]]))
    row = near.nearest(canvas.owner[y, x].astype(np.int64), places)[:, 0]
    out[y, x] = np.where(row >= 0, classes[row], -1)
    return out


# --- text and symbols ------------------------------------------------------------------------------------------


def _ring(pen: ImageDraw.ImageDraw, camera: Camera, mark: Mark, visible: F64, left: int, width: int,
          taken: list[Box]) -> None:
    """A ring around a place, with text where no other text is; nothing where rings of more severe marks are at all
    places.
    """
    places = visible if len(visible) else mark.places[:1]
    spots = [(left + x - RING, HEADER + y - RING, left + x + RING, HEADER + y + RING)
             for x, y, _ in (0.5 * camera.screen(places[::-(-len(places) // MAX_RING_PLACES)])).tolist()]
    apart = [spot for spot in spots if not any(_meet(spot, ring) for ring in taken[::2])]
    if not apart:
        return
    here = next((spot for spot in apart if not any(_meet(spot, words) for words in taken[1::2])), apart[0])
    x, y = here[0] + RING, here[1] + RING
    for radius, colour, line in ((RING + 1, WHITE, 5), (RING, INK, 2)):
        pen.ellipse([x - radius, y - radius, x + radius, y + radius], outline=bytes_of(colour), width=line)
    text = ascii_text(mark.text + ("" if len(visible) else " (behind)"))
    for at, anchor in _beside(x, y, x < left + 0.6 * width):
        box = pen.textbbox(at, text, font=font(16), anchor=anchor, stroke_width=3)
        if not any(_meet(box, other) for other in taken):
            break
    pen.text(at, text, font=font(16), anchor=anchor, fill=bytes_of(mark.colour), stroke_width=3,
             stroke_fill=bytes_of(WHITE))
    taken += [here, box]


def _beside(x: float, y: float, right: bool) -> list[tuple[tuple[float, float], str]]:
    """Positions for text beside a ring with their anchors, the side with more room first."""
    sides = [(x + RING + 6, "lm"), (x - RING - 6, "rm")]
    return [((at, y + down), anchor) for down in (0, -26, 26, -52, 52)
            for at, anchor in (sides if right else sides[::-1])]


def _meet(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _scale(pen: ImageDraw.ImageDraw, measured: Measured, x: int, y: int) -> None:
    """The seven classes as a strip, with their limits in mm and the budget between two marks."""
    box, ink = 98, bytes_of(INK)
    for k, colour in enumerate(COLOURS[:UNCUT]):
        pen.rectangle([x + k * box, y + 22, x + (k + 1) * box, y + 46], fill=bytes_of(colour), outline=ink)
    for k, limit in enumerate(measured.limits, 1):
        tall = k in (GREEN, GREEN + 1)
        at = x + k * box
        pen.line([(at, y + (14 if tall else 42)), (at, y + 52)], fill=ink, width=3 if tall else 1)
        pen.text((at, y + 55), f"{'+' if limit > 0 else '-'}{decimal(round(abs(float(limit)), 4))}", font=font(14),
                 anchor="mt", fill=ink)
    middle = x + (GREEN + 0.5) * box
    pen.text((middle, y + 10), "allowed", font=font(15), anchor="mm", fill=ink)
    pen.text((x + 1.5 * box, y + 10), "cut too deep", font=font(15), anchor="mm", fill=bytes_of(COLOURS[1]))
    pen.text((x + 5.5 * box, y + 10), "stock left", font=font(15), anchor="mm", fill=bytes_of(COLOURS[5]))
    pen.text((middle, y + 86), "mm along the surface normal, 0 = the surface asked for", font=font(15), anchor="mm",
             fill=bytes_of(GREY))


def _signs(pen: ImageDraw.ImageDraw, x: int, y: int) -> None:
    grey = bytes_of((0.5, 0.5, 0.5))
    pen.rectangle([x, y + 2, x + 22, y + 14], fill=bytes_of(COLOURS[UNCUT]), outline=grey)
    for k in (1, 8, 15):
        pen.line([(x + k, y + 14), (x + min(k + 12, 22), y + 2)], fill=bytes_of(HATCH), width=2)
    pen.rectangle([x, y + 23, x + 22, y + 35], fill=bytes_of(PALE), outline=grey)
    pen.ellipse([x + 3, y + 42, x + 19, y + 58], outline=bytes_of(INK), width=2)
    for k, text in enumerate(("never reached by a cut", "not to be judged", "deepest gouges, most left")):
        pen.text((x + 30, y + 21 * k), text, font=font(15), fill=bytes_of(INK))
