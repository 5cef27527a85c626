"""preview.png: the part as the planner understands it, and what will be cut.

Left the shaded part: every wall its own colour, connections in one strong
colour, floors light, edges dark, ids at their places. Right the same view with
the finishing paths in the colours of their tools, rapids dashed, and what no
tool reaches in red. Below a legend. No clock, no random number, no graphics
library: the same input gives the same bytes.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh import F64
from geometry.part import Part
from output.text import ascii_text, decimal
from service.camera import Camera
from service.lettering import (
    GREY,
    INK,
    PAPER,
    RGB,
    WHITE,
    bytes_of,
    draw_pairs,
    draw_scale,
    draw_swatches,
    draw_triad,
    font,
)
from service.raster import F32, Canvas
from service.scene import segments, shaded
from toolpath.motion import Motion, Trajectory, Workingstep
from zones.model import Decomposition

SIZE = (1760, 960)
HEADER, LEGEND, GUTTER = 56, 132, 8
CONNECTION: RGB = (1.0, 0.52, 0.0)
REMAINDER: RGB = (0.88, 0.0, 0.08)
RAPID: RGB = (0.35, 0.37, 0.42)
ROLES: dict[str, RGB] = {
    "floor": (0.90, 0.89, 0.82), "base": (0.66, 0.68, 0.71), "fillet": (0.80, 0.82, 0.85), "free": (0.74, 0.77, 0.81),
    "wall": (0.55, 0.68, 0.80), "connection": CONNECTION,
}
TOOLS: tuple[RGB, ...] = (
    (0.00, 0.33, 0.80), (0.00, 0.55, 0.25), (0.58, 0.10, 0.68), (0.00, 0.52, 0.60), (0.62, 0.36, 0.00),
    (0.85, 0.20, 0.55), (0.25, 0.25, 0.30), (0.40, 0.55, 0.00),
)
_MOST_LABELS = 40
_TRIAL = (240, 180)  # pixels of the pictures that views are chosen with


def draw_preview(
    part: Part, decomposition: Decomposition, zone_of_face: Mapping[int, str] | None, steps: Sequence[Workingstep],
    remainder_points: F64 | None, out_path: str | Path, title: str, facts: Mapping[str, str] | None = None,
) -> None:
    """Draw part, walls, connections, paths and remainder into a PNG of 1760 x 960 pixels.

    part             : Part, setup frame, mm
    decomposition    : its walls, connections and face roles
    zone_of_face     : face number -> zone id; faces without one are drawn darker on the right. None: all alike
    steps            : the plan; paths of the finishing steps are drawn, of all steps where none is finishing
    remainder_points : (n, 3) float64, mm, points no tool of the setup reaches, or None
    out_path         : file to write
    title            : one line of text
    facts            : more pairs for the legend, for example {'coverage': '97.2 %'}
    """
    width, height = (SIZE[0] - GUTTER) // 2, SIZE[1] - HEADER - LEGEND
    shown = [s for s in steps if s.operation == "finishing"] or list(steps)
    camera = _camera(part, decomposition, shown, (2 * width, 2 * height))
    left = shaded(part, _face_colours(part, decomposition), camera)
    _draw_hidden_connections(left, part, decomposition, camera)
    pale = shaded(part, _pale_colours(part, decomposition, zone_of_face), camera)
    tools = _tool_colours(steps)
    _draw_paths(pale, camera, shown, tools)
    if remainder_points is not None and len(remainder_points):
        pale.dots(camera.screen(remainder_points), REMAINDER, width=5, alpha=0.9, hidden=0.35, bias=0.15 * camera.scale)

    sheet = Image.new("RGB", SIZE, bytes_of(WHITE))
    for canvas, x in ((left, 0), (pale, width + GUTTER)):
        sheet.paste(Image.fromarray(canvas.halved()), (x, HEADER))
    pen = ImageDraw.Draw(sheet)
    pen.text((20, 14), ascii_text(title), font=font(26), fill=bytes_of(INK))
    _labels(pen, part, decomposition, camera)
    _captions(pen, width, shown is not steps and len(shown) != len(steps))
    draw_triad(pen, camera, (54, SIZE[1] - LEGEND - 54))
    for x in (width, SIZE[0]):
        draw_scale(pen, camera, (x - 24, SIZE[1] - LEGEND - 24))
    _legend(pen, decomposition, zone_of_face, steps, tools, remainder_points, facts or {})
    sheet.save(out_path, format="PNG", optimize=False, compress_level=6)


def _camera(part: Part, decomposition: Decomposition, steps: Sequence[Workingstep], size: tuple[int, int]) -> Camera:
    """Where the viewer stands: of twelve slanting azimuths and two heights, where the connections fill most pixels.

    Ties, and parts without connections, go to the first, the usual isometric view.
    """
    cuts = [t.points for s in steps for t in s.trajectories if t.motion is Motion.CUT]
    points = np.concatenate([part.mesh.vertices, *cuts])
    wanted = [f for c in decomposition.connections for f in c.faces]
    views = [(quarter + turn, up) for up in (38.0, 50.0) for turn in (-58.0, -25.0, -65.0)
             for quarter in (0, 90, 180, 270)]
    best, most = views[0], -1.0
    for view in views if wanted else ():
        camera = Camera.fit(points, _TRIAL, azimuth=math.radians(view[0]), elevation=math.radians(view[1]))
        seen = _owners(part, camera)
        area = float(np.isin(seen, wanted).sum())
        if area > 1.05 * most:
            best, most = view, area
    return Camera.fit(points, size, azimuth=math.radians(best[0]), elevation=math.radians(best[1]))


def _owners(part: Part, camera: Camera) -> NDArray[np.int32]:
    """(h, w): the face number seen in every pixel."""
    canvas = Canvas.blank(*camera.size, PAPER)
    front = np.flatnonzero(part.mesh.normals @ camera.basis[2] > 0.0)
    canvas.triangles(camera.screen(part.mesh.triangles[front]), np.zeros((len(front), 3), np.float32),
                     part.mesh.face_ids[front])
    return canvas.owner


def _draw_hidden_connections(canvas: Canvas, part: Part, decomposition: Decomposition, camera: Camera) -> None:
    """Edges of connections shine through what stands before them."""
    faces = {f for c in decomposition.connections for f in c.faces}
    for edge in part.edges:
        if faces & set(edge.faces) and len(edge.points) > 1:
            canvas.strokes(segments(camera, edge.points), CONNECTION, width=3, alpha=0.0, hidden=0.8, bias=4.0,
                           dash=7.0)


def wall_colour(index: int) -> RGB:
    """A soft colour for the wall of that index; neighbours differ, none comes near the orange of connections."""
    hue = (0.40 + 0.381966 * 0.62 * index) % 0.62 + 0.30
    return colorsys.hsv_to_rgb(hue % 1.0, (0.46, 0.34, 0.56)[index % 3], (0.80, 0.90, 0.72)[index % 3])


def _face_colours(part: Part, decomposition: Decomposition) -> F32:
    """(n + 1, 3): colour of every face number; 0 is a triangle without a face."""
    colours = np.empty((len(part.faces) + 1, 3), dtype=np.float32)
    colours[:] = ROLES["free"]
    for number, role in decomposition.face_role.items():
        colours[number] = ROLES.get(role, ROLES["free"])
    for index, wall in enumerate(decomposition.walls):
        colours[list(wall.faces)] = wall_colour(index)
    for connection in decomposition.connections:
        colours[list(connection.faces)] = CONNECTION
    return colours


def _pale_colours(part: Part, decomposition: Decomposition, zone_of_face: Mapping[int, str] | None) -> F32:
    """The same, faded, so that paths stand out; faces without a zone grey."""
    colours = np.asarray(0.25 * _face_colours(part, decomposition) + 0.75 * np.float32(0.95), dtype=np.float32)
    if zone_of_face is not None:
        out = [f.number for f in part.faces if f.number not in zone_of_face]
        colours[out] = (0.70, 0.71, 0.73)
    return colours


def _tool_colours(steps: Sequence[Workingstep]) -> dict[int, RGB]:
    numbers = sorted({s.tool.number for s in steps})
    return {n: TOOLS[i % len(TOOLS)] for i, n in enumerate(numbers)}


def _draw_paths(canvas: Canvas, camera: Camera, steps: Sequence[Workingstep], tools: Mapping[int, RGB]) -> None:
    """Links and rapids faint and first, the cuts over them."""
    for step in steps:
        rapids = _of_motion(camera, step.trajectories, (Motion.RAPID,))
        canvas.strokes(rapids, RAPID, width=1, alpha=0.35, hidden=0.04, bias=4.0, dash=8.0)
        links = _of_motion(camera, step.trajectories, (Motion.CONNECT, Motion.APPROACH, Motion.LIFT))
        canvas.strokes(links, tools[step.tool.number], width=1, alpha=0.30, hidden=0.04, bias=4.0)
    for step in steps:
        cuts = _of_motion(camera, step.trajectories, (Motion.CUT,))
        canvas.strokes(cuts, tools[step.tool.number], width=2, alpha=0.75, hidden=0.10, bias=4.0)


def _of_motion(camera: Camera, trajectories: Sequence[Trajectory], motions: tuple[Motion, ...]) -> F64:
    """(n, 2, 3) screen segments of all trajectories of these motions."""
    lines = [np.stack([t.points[:-1], t.points[1:]], axis=1) for t in trajectories if t.motion in motions]
    return camera.screen(np.concatenate(lines)) if lines else np.zeros((0, 2, 3))


def _labels(pen: ImageDraw.ImageDraw, part: Part, decomposition: Decomposition, camera: Camera) -> None:
    """Ids of walls at their upper rims and of connections at their tops, on the left picture."""
    named = [(c.id, c.faces) for c in decomposition.connections] + [(w.id, w.faces) for w in decomposition.walls]
    if len(named) > _MOST_LABELS:
        named = named[-_MOST_LABELS:] if len(decomposition.walls) >= _MOST_LABELS else named
    for name, faces in named[:_MOST_LABELS]:
        points = part.mesh.triangles[np.isin(part.mesh.face_ids, faces)].reshape(-1, 3)
        if not len(points):
            continue
        rim = points[points[:, 2] >= points[:, 2].max() - 0.05 * max(float(np.ptp(points[:, 2])), 1e-9)]
        wall = name.startswith("W")
        at = rim[np.argmax(camera.screen(rim)[:, 1])] if wall else rim.mean(axis=0)
        x, y, _ = 0.5 * camera.screen(at)
        pen.text((x, HEADER + y + (6 if wall else 0)), name, font=font(17), anchor="mt" if wall else "mm",
                 fill=bytes_of(INK), stroke_width=3, stroke_fill=bytes_of(WHITE))


def _captions(pen: ImageDraw.ImageDraw, width: int, partly: bool) -> None:
    grey = bytes_of(GREY)
    pen.text((20, HEADER + 12), "Walls and connections", font=font(17), fill=grey)
    text = "Finishing paths and remainder" + (" (roughing not drawn)" if partly else "")
    pen.text((width + GUTTER + 20, HEADER + 12), text, font=font(17), fill=grey)


def _legend(pen: ImageDraw.ImageDraw, decomposition: Decomposition, zone_of_face: Mapping[int, str] | None,
            steps: Sequence[Workingstep], tools: Mapping[int, RGB], remainder: F64 | None,
            facts: Mapping[str, str]) -> None:
    """Three columns below the pictures: counts and facts, surfaces, tools and lines."""
    top = SIZE[1] - LEGEND + 12
    zones = {s.zone for s in steps if s.zone} | set((zone_of_face or {}).values())
    counts = {"walls": len(decomposition.walls), "connections": len(decomposition.connections),
              "channels": len(decomposition.channels), "zones": len(zones), "steps": len(steps)}
    pairs = [(k, str(v)) for k, v in counts.items()] + [(k, str(v)) for k, v in facts.items()]
    draw_pairs(pen, pairs, 20, top)
    surfaces: list[tuple[str, RGB | None]] = [(w.id, wall_colour(i)) for i, w in enumerate(decomposition.walls[:12])]
    if len(decomposition.walls) > 12:
        surfaces.append((f"and {len(decomposition.walls) - 12} more walls", None))
    surfaces += [("connection", CONNECTION), ("floor", ROLES["floor"]), ("fillet", ROLES["fillet"]),
                 ("base", ROLES["base"])]
    draw_swatches(pen, surfaces, 610, top, columns=4, step=140)
    lines: list[tuple[str, RGB | None]] = []
    for number, colour in tools.items():
        body = next(s.tool for s in steps if s.tool.number == number)
        lines.append((f"T{number} {body.kind} D{decimal(body.diameter)}"
                      + (f" R{decimal(body.corner_radius)}" if body.kind == "bull" else ""), colour))
    lines.append(("rapid", RAPID))
    if remainder is not None and len(remainder):
        lines.append(("no tool reaches", REMAINDER))
    if zone_of_face is not None:
        lines.append(("face without zone", (0.70, 0.71, 0.73)))
    draw_swatches(pen, lines, 1180, top, columns=3, step=190)
