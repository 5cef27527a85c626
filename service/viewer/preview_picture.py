"""preview.png: zones, remainder and tool paths, drawn from ``view.bin``, so that picture and page agree.

The left picture shows the part: each zone in its own colour, the remainder hatched red, ids at walls and connections.
The right one shows the paths of the finishing steps in the colours of their tools, with dashed rapids. A legend stands
below. There is no clock, no random number and no graphics library: the same file gives the same bytes.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh import F64, TriangleMesh
from output.header_text import ascii_text, decimal
from service.pictures.annotation import (
    GREY,
    INK,
    RGB,
    WHITE,
    bytes_of,
    draw_pairs,
    draw_scale,
    draw_swatches,
    draw_triad,
    font,
)
from service.pictures.camera import Camera
from service.pictures.rasterizer import F32, Canvas
from service.pictures.scene import lit, segments
from service.viewer.view_file import read_view
from service.viewer.view_paths import CUT, RAPID

SIZE = (1760, 960)
HEADER, LEGEND, GUTTER = 56, 132, 8
# the same colours as on the page, web/src/scene/colours.ts
CONNECTION: RGB = (1.0, 0.52, 0.0)
REMAINDER: RGB = (0.86, 0.10, 0.14)
HATCHED: RGB = (0.98, 0.86, 0.84)
OTHER: RGB = (0.72, 0.73, 0.75)
RAPID_INK: RGB = (0.35, 0.37, 0.42)
TOOLS: tuple[RGB, ...] = (
    (0.0, 0.33, 0.8), (0.0, 0.5, 0.22), (0.58, 0.1, 0.68), (0.0, 0.48, 0.56), (0.62, 0.36, 0.0),
    (0.8, 0.16, 0.5), (0.25, 0.25, 0.3), (0.36, 0.48, 0.0),
)
FIRST = 2  # label 0 on the canvas; 0 is the background, 1 a face without samples
ROUGH, FINE = 0, 1  # levels of detail
MAX_LABELS, MAX_ZONES, MAX_REASONS = 40, 10, 5
STEEP = 0.7  # share of a feed move along the tool axis, from which on it counts as a move up or down
HATCH, INKED = 14, 5  # px from stripe to stripe, and width of a stripe
_TRIAL = (240, 180)  # px, size of the trial pictures that choose the view
Table = dict[str, NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Drawn:
    """Part and tool paths of a view file, in the setup frame.

    mesh  : facets; their face ids are labels, from ``FIRST``
    face  : (t,) int64, index: face number of each facet
    edges : polylines (k, 3) float64, mm
    ways  : for each step places (n, 3) float64, mm; kinds (n,) int64, index, as in ``service.viewer.view_paths``; and
            tool axes (n, 3) or (3,) float64, dimensionless
    """

    head: Mapping[str, Any]
    mesh: TriangleMesh
    face: NDArray[np.int64]
    edges: Sequence[F64]
    ways: Mapping[int, tuple[F64, NDArray[np.int64], F64]]

    @classmethod
    def of(cls, head: Mapping[str, Any], tables: Sequence[Table], finest: int) -> Drawn:
        """From head and chunks of a view file, with levels of detail up to ``finest``."""
        low, chunks = np.array(head["low_mm"]), list(zip(head["chunks"], tables, strict=True))
        level = max((c["lod"] for c, _ in chunks if c["kind"] == "mesh" and c["lod"] <= finest), default=0)
        parts = [(c["label"], t) for c, t in chunks if c["kind"] == "mesh" and c["lod"] == level]
        begins = np.cumsum([0, *(len(t["place"]) for _, t in parts)])
        vertices = np.concatenate([np.zeros((0, 3)), *(low + head["mesh_grid_mm"] * t["place"] for _, t in parts)])
        corners = np.concatenate([np.zeros((0, 3), np.int64),
                                  *(t["corners"] + n for (_, t), n in zip(parts, begins[:-1], strict=True))])
        face = np.concatenate([np.zeros(0, np.int64), *(t["face"][:, 0] for _, t in parts)])
        label = np.repeat([k + FIRST for k, _ in parts], [len(t["corners"]) for _, t in parts])
        edges = [low + head["mesh_grid_mm"] * t["place"][a:b] for c, t in chunks if c["kind"] == "edges"
                 for a, b in zip(t["begins"][:-1, 0], t["begins"][1:, 0], strict=True)]
        ways = {}
        for c, t in chunks:  # the finer level of a step comes later
            if c["kind"] == "path" and c["lod"] <= finest:
                axis = np.array(t["axis"] / head["axis_unit"] if "axis" in t else head["steps"][c["step"]]["axis"])
                ways[c["step"]] = (low + head["path_grid_mm"] * t["place"], t["kind"][:, 0], axis)
        mesh = TriangleMesh(np.ascontiguousarray(vertices), corners.astype(np.int32), label.astype(np.int32))
        return cls(head, mesh, face[corners[:, 0]] if len(corners) else face, edges, ways)

    def labels(self, kind: str) -> list[int]:
        """Labels of all zones or of all entries of the remainder, in the order of the head.

        kind : 'zone' or 'remainder'
        """
        named = {v[kind]: k + FIRST for k, v in enumerate(self.head["labelled"]) if kind in v}
        wanted = [z["id"] for z in self.head["zones"]] if kind == "zone" else range(len(self.head["remainder"]))
        return [named[w] for w in wanted]

    def finishing(self) -> list[int]:
        """The steps whose paths are drawn: those of finishing, or all where there are none."""
        steps = [k for k, s in enumerate(self.head["steps"]) if s["operation"] == "finishing" and k in self.ways]
        return steps or sorted(self.ways)


def draw_preview(view: bytes, out_path: str | Path, title: str, facts: Mapping[str, str] | None = None) -> None:
    """Draw a view file into a PNG of 1760 x 960 pixels.

    view     : bytes of ``view.bin`` (``service.viewer.view_file``)
    out_path : file to write
    title    : one line of text
    facts    : pairs for the legend, for example {'coverage': '97.2 %'}
    """
    head, tables = read_view(view)
    drawn = Drawn.of(head, tables, FINE)
    width, height = (SIZE[0] - GUTTER) // 2, SIZE[1] - HEADER - LEGEND
    camera = _camera(Drawn.of(head, tables, ROUGH), (2 * width, 2 * height))
    left = _part(drawn, camera, 1.0)
    right = _part(drawn, camera, 0.3)
    tools = _tool_colours(drawn)
    _draw_ways(right, camera, drawn, tools)

    sheet = Image.new("RGB", SIZE, bytes_of(WHITE))
    for canvas, x in ((left, 0), (right, width + GUTTER)):
        sheet.paste(Image.fromarray(canvas.halved()), (x, HEADER))
    pen = ImageDraw.Draw(sheet)
    pen.text((20, 14), ascii_text(title), font=font(26), fill=bytes_of(INK))
    _labels(pen, drawn, camera, left.depth)
    partly = len(drawn.finishing()) < len(drawn.ways)
    for x, caption in ((0, "Zones; hatched: the remainder" if drawn.head["zones"] else "Part"),
                       (width + GUTTER, "Tool paths" + (" of finishing" if partly else ""))):
        pen.text((x + 20, HEADER + 12), caption, font=font(17), fill=bytes_of(GREY))
    draw_triad(pen, camera, (54, SIZE[1] - LEGEND - 54))
    for x in (width, SIZE[0]):
        draw_scale(pen, camera, (x - 24, SIZE[1] - LEGEND - 24))
    _legend(pen, drawn, tools, facts or {})
    sheet.save(out_path, format="PNG", optimize=False, compress_level=6)


def _camera(drawn: Drawn, size: tuple[int, int]) -> Camera:
    """The camera: of twelve azimuths and two elevations the one that shows most of connections and remainder.

    Ties, and parts without both, take the first one, the usual isometric view.
    """
    faces = [f for c in drawn.head["connections"] for f in c["faces"]]
    matters = np.isin(drawn.face, faces) | np.isin(drawn.mesh.face_ids, drawn.labels("remainder"))
    points = drawn.mesh.vertices if len(drawn.mesh.vertices) else np.array(drawn.head["bounds_mm"])
    wanted = TriangleMesh(drawn.mesh.vertices, drawn.mesh.faces, matters.astype(np.int32) + 1)
    views = [(quarter + turn, up) for up in (38.0, 50.0) for turn in (-58.0, -25.0, -65.0)
             for quarter in (0, 90, 180, 270)]
    best, most = views[0], 0.0
    for view in views if matters.any() else ():
        camera = Camera.fit(points, _TRIAL, azimuth=math.radians(view[0]), elevation=math.radians(view[1]))
        area = float((lit(wanted, np.ones((3, 3), np.float32), camera).owner == 2).sum())
        if area > 1.05 * most:
            best, most = view, area
    return Camera.fit(points, size, azimuth=math.radians(best[0]), elevation=math.radians(best[1]), margin=0.1)


def _part(drawn: Drawn, camera: Camera, strength: float) -> Canvas:
    """The part, its colours faded to ``strength``, 0 to 1, with hatching and edges."""
    colours = np.full((FIRST + len(drawn.head["labelled"]), 3), OTHER, np.float32)
    for index, label in enumerate(drawn.labels("zone")):
        colours[label] = zone_colour(index)
    rest = drawn.labels("remainder")
    colours[rest] = HATCHED
    canvas = lit(drawn.mesh, _faded(colours, strength), camera)
    y, x = np.nonzero(np.isin(canvas.owner, rest))
    stripe = (x + y) % HATCH < INKED
    canvas.colour[y[stripe], x[stripe]] = _faded(np.array([REMAINDER], np.float32), 0.4 + 0.6 * strength)
    solid = Canvas(canvas.colour, canvas.depth, np.minimum(canvas.owner, 1).astype(np.int32))
    solid.outline(INK, jump=0.02 * min(camera.size))
    for edge in drawn.edges:
        canvas.strokes(segments(camera, edge), INK, width=2, alpha=0.75, bias=3.0)
    return canvas


def _faded(colours: F32, strength: float) -> F32:
    return np.asarray(strength * colours + (1.0 - strength) * np.float32(0.95), dtype=np.float32)


def zone_colour(index: int) -> RGB:
    """The colour of a zone by its place in the list, as ``zoneColour`` of the page."""
    hue = 0.15 + 0.76 * ((index * 0.381966) % 1.0)
    return colorsys.hls_to_rgb(hue, (0.62, 0.50, 0.72)[index // 2 % 3], (0.52, 0.42, 0.62)[index % 3])


def _tool_colours(drawn: Drawn) -> dict[int, RGB]:
    """Colours of the tools of the drawn steps, by T number."""
    used = {drawn.head["steps"][k]["tool"] for k in drawn.finishing()}
    colours = {t["number"]: TOOLS[k % len(TOOLS)] for k, t in enumerate(drawn.head["tools"]) if t["number"] in used}
    return colours | dict.fromkeys(used - set(colours), GREY)


def _draw_ways(canvas: Canvas, camera: Camera, drawn: Drawn, tools: Mapping[int, RGB]) -> None:
    """Draw rapids and moves up and down faintly, then the cuts over them; the part hides paths behind it."""
    moves: dict[str, list[tuple[F64, RGB]]] = {"rapid": [], "aside": [], "cut": []}
    for step in drawn.finishing():
        place, kinds, axis = drawn.ways[step]
        colour = tools[drawn.head["steps"][step]["tool"]]
        for kind in (RAPID, CUT):
            rows = np.flatnonzero(kinds == kind)
            lines = np.stack([place[rows - 1], place[rows]], axis=1)
            way = lines[:, 1] - lines[:, 0]
            steep = np.abs((way * (axis[rows] if axis.ndim == 2 else axis)).sum(axis=1)) > STEEP * np.linalg.norm(
                way, axis=1)
            if kind == RAPID:
                moves["rapid"].append((lines, RAPID_INK))
            else:
                moves["aside"].append((lines[steep], colour))
                moves["cut"].append((lines[~steep], colour))
    for name, alpha, dash in (("rapid", 0.2, 8.0), ("aside", 0.15, 0.0), ("cut", 0.75, 0.0)):
        for lines, colour in moves[name]:
            canvas.strokes(camera.screen(lines), colour, width=2, alpha=alpha, bias=4.0, dash=dash)


def _labels(pen: ImageDraw.ImageDraw, drawn: Drawn, camera: Camera, depth: F64) -> None:
    """Draw ids of walls and connections on the left picture, where the page has them; hidden ones are faint."""
    named = [x for x in [*drawn.head["connections"], *drawn.head["walls"]] if x["at_mm"]]
    taken: list[tuple[float, float]] = []
    for item in named[:MAX_LABELS]:
        x, y, z = camera.screen(np.array(item["at_mm"])).tolist()
        at = (0.5 * x, HEADER + 0.5 * y)
        if any(abs(at[0] - u) < 28 and abs(at[1] - v) < 18 for u, v in taken):
            continue
        taken.append(at)
        row, column = int(np.clip(y, 0, len(depth) - 1)), int(np.clip(x, 0, depth.shape[1] - 1))
        hidden = depth[row, column] > z + 0.02 * min(camera.size)
        pen.text(at, item["id"], font=font(17), anchor="mm", fill=bytes_of(GREY if hidden else INK), stroke_width=3,
                 stroke_fill=bytes_of(WHITE))


def _legend(pen: ImageDraw.ImageDraw, drawn: Drawn, tools: Mapping[int, RGB], facts: Mapping[str, str]) -> None:
    """Draw the legend: facts, zones, reasons of the remainder, tools and lines."""
    top, head = SIZE[1] - LEGEND + 12, drawn.head
    counts = {"walls": len(head["walls"]), "connections": len(head["connections"]), "zones": len(head["zones"]),
              "steps": len(head["steps"])}
    draw_pairs(pen, [(k, str(v)) for k, v in facts.items()][:5], 20, top, wide=250)
    draw_pairs(pen, [(k, str(v)) for k, v in counts.items()], 265, top, indent=100)
    zones: list[tuple[str, RGB | None]] = [(z["id"], zone_colour(k)) for k, z in enumerate(head["zones"])]
    shown = zones if len(zones) <= MAX_ZONES else zones[:MAX_ZONES - 1]
    if len(shown) < len(zones):
        shown = [*shown, (f"and {len(zones) - len(shown)} more", None)]
    draw_swatches(pen, shown, 420, top, columns=2, step=95)
    reasons = _reasons(head["remainder"])
    for k, text in enumerate(reasons):
        line = top + 21 * k
        _hatched(pen, 640, line + 2)
        pen.text((670, line), ascii_text(text), font=font(15), fill=bytes_of(INK))
    lines: list[tuple[str, RGB | None]] = []
    for t in head["tools"]:
        if t["number"] in tools:
            lines.append((f"T{t['number']} {t['kind']} D{decimal(t['diameter_mm'])}", tools[t["number"]]))
    lines = [*lines[:8], ("rapid", RAPID_INK), ("in no zone", OTHER)]
    draw_swatches(pen, lines, 1400, top, columns=2, step=170)


def _reasons(remainder: Sequence[Mapping[str, Any]]) -> list[str]:
    """The remainder in words, one line for each reason, the largest first; at most ``MAX_REASONS`` lines."""
    area: dict[str, list[float]] = {}
    for entry in remainder:
        area.setdefault(entry["reason"], []).append(entry["area_mm2"])
    rows = sorted(area.items(), key=lambda item: -sum(item[1]))
    lines = [f"{sum(each):.{0 if sum(each) >= 10 else 1}f} mm2 stay: {reason}"
             + (f" ({len(each)} places)" if len(each) > 1 else "") for reason, each in rows]
    if len(lines) > MAX_REASONS:
        left = sum(sum(each) for _, each in rows[MAX_REASONS - 1:])
        lines = [*lines[:MAX_REASONS - 1], f"{left:.1f} mm2 for {len(lines) - MAX_REASONS + 1} more reasons"]
    return [line if len(line) <= 84 else line[:81] + "..." for line in lines]


def _hatched(pen: ImageDraw.ImageDraw, x: int, y: int) -> None:
    pen.rectangle([x, y, x + 22, y + 12], fill=bytes_of(HATCHED), outline=bytes_of((0.5, 0.5, 0.5)))
    for k in (1, 8, 15):
        pen.line([(x + k, y + 12), (x + min(k + 10, 22), y)], fill=bytes_of(REMAINDER), width=2)
