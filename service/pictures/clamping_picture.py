"""Picture of the clamping of a part: blank, part, fixtures, program zero with its axes, and tool axes.

The left view is oblique. The right view is from above, with the distances of the blank from program zero. Both are in
the frame of one program.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh import F64, TriangleMesh
from geometry.part import Part
from output.header_text import ascii_text, decimal
from service.pictures.annotation import (
    AXES,
    GREY,
    INK,
    PAPER,
    RGB,
    WHITE,
    bytes_of,
    draw_scale,
    font,
)
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas
from service.pictures.scene import add_edges, lit, segments

SIZE = (1760, 780)
HEADER, LEGEND, GUTTER = 44, 66, 8
PART: RGB = (0.62, 0.70, 0.80)
FIXTURE: RGB = (0.80, 0.47, 0.16)
BLANK: RGB = (0.10, 0.45, 0.35)
COMING: RGB = (0.58, 0.10, 0.68)
VEIL = 0.16  # opacity of the blank over the part and fixtures
FAR = 1.5  # times the size of the scene; a program zero farther away is left out
WORDS = 22


@dataclass(frozen=True, eq=False)
class Clamped:
    """The clamping for one program, in its frame, mm.

    part     : Part
    blank    : TriangleMesh, the nominal blank; grown: it is a box around a blank that is grown from the part
    fixtures : each (8, 3) float64, corners of a box, numbered by bits: 1 is +X, 2 is +Y, 4 is +Z of the setup frame
    zero     : name of program zero, 'G54'
    comings  : by name, (3,) float64, unit, from tip to spindle
    """

    part: Part
    blank: TriangleMesh
    grown: bool
    fixtures: tuple[F64, ...]
    zero: str
    comings: tuple[tuple[str, F64], ...]


def box_mesh(corners: F64) -> TriangleMesh:
    """Twelve triangles of a box.

    corners : (8, 3) float64, mm, frame of the program, numbered as in ``Clamped.fixtures``
    """
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    return TriangleMesh(np.asarray(corners, np.float64), faces, np.repeat(np.arange(1, 7, dtype=np.int32), 2))


def corners_of(box: F64) -> F64:
    """Corners of a box, numbered by bits.

    box : (2, 3) float64, mm, lower and upper corner, any frame

    Returns (8, 3) float64, mm, same frame.
    """
    return np.array([[box[i >> k & 1][k] for k in range(3)] for i in range(8)], dtype=np.float64)


def bar_mesh(low: F64, high: F64, radius: float, sides: int = 64) -> TriangleMesh:
    """A round bar as a prism.

    low, high : (3,) float64, mm, frame of the program, centres of its ends
    radius    : mm
    """
    up = (high - low) / np.linalg.norm(high - low)
    one = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    one /= np.linalg.norm(one)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = radius * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * np.cross(up, one))
    k = np.arange(sides)
    n = np.roll(k, -1)
    a, b = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = np.concatenate([np.stack(rows, axis=1) for rows in (
        (k, n, n + sides), (k, n + sides, k + sides), (a, n, k), (b, k + sides, n + sides))])
    ids = np.repeat(np.array([1, 1, 2, 3], np.int32), sides)
    return TriangleMesh(np.concatenate([low + ring, high + ring, [low, high]]), faces.astype(np.int32), ids)


def clamp_picture(held: Clamped, title: str) -> bytes:
    """The picture as a PNG of 1760 x 780 pixels: the same input gives the same bytes."""
    width, height = (SIZE[0] - GUTTER) // 2, SIZE[1] - HEADER - LEGEND
    things = np.concatenate([held.part.mesh.vertices, held.blank.vertices, *held.fixtures])
    low, high = things.min(axis=0), things.max(axis=0)
    size = float(np.linalg.norm(high - low))
    near = bool(np.linalg.norm(np.clip(np.zeros(3), low, high)) <= FAR * size)
    arrows = [(name, *_arrow(0.5 * (low + high), axis, things, size)) for name, axis in held.comings]
    seen = np.concatenate([things, *(np.stack([a, b]) for _, a, b in arrows),
                           *([0.22 * size * np.eye(3), np.zeros((1, 3))] if near else [])])
    slanting = Camera.fit(seen, (2 * width, 2 * height), azimuth=math.radians(-62.0), elevation=math.radians(30.0),
                          margin=0.10)
    flat = np.concatenate([things, np.zeros((1, 3))]) if near else things
    above = Camera.fit(flat, (2 * width, 2 * height), azimuth=math.radians(-90.0), elevation=math.radians(90.0),
                       margin=0.16)
    sheet = Image.new("RGB", SIZE, bytes_of(WHITE))
    for camera, x in ((slanting, 0), (above, width + GUTTER)):
        sheet.paste(Image.fromarray(_scene(held, camera).halved()), (x, HEADER))
    pen = ImageDraw.Draw(sheet)
    pen.text((16, 10), ascii_text(title), font=font(WORDS), fill=bytes_of(INK))
    pen.text((width + GUTTER + 16, 10), "From above (along Z); mm from program zero", font=font(WORDS),
             fill=bytes_of(INK))
    named: list[tuple[float, float]] = []
    for name, tail, head in arrows:
        _draw_arrow(pen, slanting, tail, head, name, named)
    _draw_heights(pen, slanting, held.blank)
    if near:
        _draw_zero(pen, slanting, (0, HEADER), 0.2 * size, held.zero)
        _draw_zero(pen, above, (width + GUTTER, HEADER), 0.2 * size, held.zero, flat=True)
    else:
        pen.text((16, HEADER + 12), f"Program zero {held.zero} lies outside the picture", font=font(WORDS),
                 fill=bytes_of(COMING))
    _draw_distances(pen, above, (width + GUTTER, HEADER), held.blank)
    for camera, x in ((slanting, width), (above, SIZE[0])):
        draw_scale(pen, camera, (x - 24, SIZE[1] - LEGEND - 18))
    _legend(pen, held)
    out = io.BytesIO()
    sheet.save(out, format="PNG", optimize=False, compress_level=6)
    return out.getvalue()


def _scene(held: Clamped, camera: Camera) -> Canvas:
    """Part and fixtures, with the transparent blank and its edges over them."""
    part, count = held.part, len(held.part.faces)
    vertices, faces, ids = [part.mesh.vertices], [part.mesh.faces], [part.mesh.face_ids]
    for k, mesh in enumerate(map(box_mesh, held.fixtures)):
        faces.append((mesh.faces + sum(map(len, vertices))).astype(np.int32))
        vertices.append(mesh.vertices)
        ids.append((mesh.face_ids + count + 6 * k).astype(np.int32))
    colours = np.empty((count + 6 * len(held.fixtures) + 1, 3), dtype=np.float32)
    colours[:count + 1], colours[count + 1:] = PART, FIXTURE
    canvas = lit(TriangleMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(ids)), colours, camera)
    add_edges(canvas, part, camera)
    veil = lit(held.blank, np.full((int(held.blank.face_ids.max()) + 1, 3), BLANK, np.float32), camera)
    covered = (veil.owner > 0) & (veil.depth >= canvas.depth)
    canvas.colour[covered] = (1.0 - VEIL) * canvas.colour[covered] + VEIL * veil.colour[covered]
    for ends in _sharp(held.blank):
        canvas.strokes(segments(camera, ends), BLANK, width=3, alpha=0.9, hidden=0.35, bias=4.0,
                       dash=14.0 if held.grown else 0.0)
    return canvas


def _sharp(mesh: TriangleMesh) -> NDArray[np.float64]:
    """(m, 2, 3) ends of the edges where two faces of a mesh meet."""
    pairs = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    ids = np.tile(mesh.face_ids, 3)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    pairs, ids = pairs[order], ids[order]
    same = (pairs[1:] == pairs[:-1]).all(axis=1) & (ids[1:] != ids[:-1])
    return np.asarray(mesh.vertices[pairs[:-1][same]])


def _arrow(middle: F64, axis: F64, things: F64, size: float) -> tuple[F64, F64]:
    """An arrow along a tool axis, from the tool side to just above the clamped part."""
    reach = float(((things - middle) @ axis).max())
    return middle + (reach + 0.34 * size) * axis, middle + (reach + 0.05 * size) * axis


def _at(camera: Camera, point: F64, corner: tuple[int, int]) -> tuple[float, float]:
    """A point (3,), mm, in the halved picture, whose own corner is at ``corner``, pixels."""
    x, y, _ = (0.5 * camera.screen(point)).tolist()
    return corner[0] + x, corner[1] + y


def _draw_arrow(pen: ImageDraw.ImageDraw, camera: Camera, tail: F64, head: F64, name: str,
                named: list[tuple[float, float]]) -> None:
    """An arrow with its name at the tail, moved up where other names are; ``named`` has their places."""
    a, b = np.array(_at(camera, tail, (0, HEADER))), np.array(_at(camera, head, (0, HEADER)))
    ink, way = bytes_of(COMING), b - a
    length = float(np.hypot(*way))
    pen.line([tuple(a), tuple(b)], fill=ink, width=5)
    if length > 1.0:
        along = way / length
        across = np.array([-along[1], along[0]])
        barb = min(18.0, 0.5 * length)
        pen.polygon([tuple(b + 4.0 * along), tuple(b - barb * along + 0.45 * barb * across),
                     tuple(b - barb * along - 0.45 * barb * across)], fill=ink)
        a = a - 20.0 * along
    x, y = float(a[0]), float(a[1])
    while any(abs(x - u) < 2.0 * WORDS and abs(y - v) < WORDS for u, v in named):
        y -= WORDS + 2.0
    named.append((x, y))
    pen.text((x, y), ascii_text(name), font=font(WORDS), anchor="mm", fill=ink, stroke_width=3,
             stroke_fill=bytes_of(PAPER))


def _draw_zero(pen: ImageDraw.ImageDraw, camera: Camera, corner: tuple[int, int], length: float, name: str, *,
               flat: bool = False) -> None:
    """Program zero: a target with its axes in their usual colours."""
    x, y = _at(camera, np.zeros(3), corner)
    for axis, (letter, colour) in enumerate(AXES[:2] if flat else AXES):
        end = _at(camera, length * np.eye(3)[axis], corner)
        beyond = _at(camera, 1.12 * length * np.eye(3)[axis], corner)
        pen.line([(x, y), end], fill=bytes_of(colour), width=5)
        pen.text(beyond, letter, font=font(WORDS + 2), anchor="mm", fill=bytes_of(colour), stroke_width=3,
                 stroke_fill=bytes_of(WHITE))
    pen.ellipse([x - 9, y - 9, x + 9, y + 9], fill=bytes_of(WHITE), outline=bytes_of(INK), width=3)
    pen.pieslice([x - 9, y - 9, x + 9, y + 9], 0, 90, fill=bytes_of(INK))
    pen.pieslice([x - 9, y - 9, x + 9, y + 9], 180, 270, fill=bytes_of(INK))
    pen.text((x - 14, y + 8), ascii_text(name), font=font(WORDS), anchor="rt", fill=bytes_of(INK), stroke_width=3,
             stroke_fill=bytes_of(WHITE))


def _draw_distances(pen: ImageDraw.ImageDraw, camera: Camera, corner: tuple[int, int], blank: TriangleMesh) -> None:
    """X and Y of the sides of the bounding box of the blank, written beside them."""
    low, high = blank.vertices.min(axis=0), blank.vertices.max(axis=0)
    left, bottom = _at(camera, low, corner)
    right, top = _at(camera, high, corner)
    ink = bytes_of(BLANK)

    def write(at: tuple[float, float], text: str, anchor: str) -> None:
        pen.text(at, text, font=font(WORDS), anchor=anchor, fill=ink, stroke_width=3, stroke_fill=bytes_of(PAPER))

    for x, value in ((left, low[0]), (right, high[0])):
        pen.line([(x, top - 26), (x, top - 6)], fill=ink, width=2)
        write((x, top - 30), f"X{decimal(float(value), 3)}", "mb")
    for y, value in ((bottom, low[1]), (top, high[1])):
        pen.line([(right + 6, y), (right + 26, y)], fill=ink, width=2)
        write((right + 30, y), f"Y{decimal(float(value), 3)}", "lm")


def _draw_heights(pen: ImageDraw.ImageDraw, camera: Camera, blank: TriangleMesh) -> None:
    """Z of top and bottom of the bounding box of the blank, at its rightmost edge in the picture."""
    low, high = blank.vertices.min(axis=0), blank.vertices.max(axis=0)
    x, y, _ = max(corners_of(np.stack([low, high])), key=lambda c: float(camera.screen(c)[0]))
    for z in (low[2], high[2]):
        right, down = _at(camera, np.array([x, y, z]), (0, HEADER))
        pen.line([(right + 6, down), (right + 26, down)], fill=bytes_of(BLANK), width=2)
        pen.text((right + 30, down), f"Z{decimal(float(z), 3)}", font=font(WORDS), anchor="lm", fill=bytes_of(BLANK),
                 stroke_width=3, stroke_fill=bytes_of(PAPER))


def _legend(pen: ImageDraw.ImageDraw, held: Clamped) -> None:
    entries = [("part", PART), ("box round the blank (the part grown)" if held.grown else "blank", BLANK),
               ("tool axis, pointing the way tools come", COMING),
               ("program zero: the round target, drawn also where it lies inside", None)]
    if held.fixtures:
        entries.insert(3, ("fixture: nothing may touch it", FIXTURE))
    x, y = 16.0, SIZE[1] - LEGEND + 18.0
    for text, colour in entries:
        if colour is not None:
            pen.rectangle([x, y, x + 28, y + 20], fill=bytes_of(colour), outline=bytes_of(GREY))
            x += 36.0
        pen.text((x, y + 10), text, font=font(WORDS - 2), anchor="lm", fill=bytes_of(INK))
        x += font(WORDS - 2).getlength(text) + 36.0


__all__ = ["Clamped", "bar_mesh", "box_mesh", "clamp_picture", "corners_of"]
