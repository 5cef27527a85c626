"""Deep parts: a plate with one window, slot or pocket that is deeper than the tool is wide.

``deep_part(seed)`` draws the outline from lines and arcs: a crescent, a straight or a bent slot, an arm, a frame round
an island, a window with tongues, or a polygon with round corners. The opening goes right through or has a floor. One
tool cuts it, at times followed by a thinner one; its flutes are shorter or longer than the opening is deep.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from examples.family.layout import LayoutError
from examples.family.recipes import step_bytes

COUNT = 60
"""Parts of the series; ``deep_part`` draws any other seed too."""

DRAWS = 20
EQUAL = 5  # of so many parts one has flutes just as long as its opening is deep
THINNEST, WIDEST = 4.0, 20.0  # mm, diameters of tools
SHALLOWEST, DEEPEST = 5.0, 60.0  # mm, openings


@dataclass(frozen=True, eq=False)
class DeepPart:
    """A plate with one deep opening and the setup that cuts it.

    name    : 'deep-SEED'
    outline : kind of the opening, a key of OUTLINES
    through : whether the opening goes right through
    depth   : mm
    shape   : cadquery Solid, mm, seat at z = 0
    setup   : plain data, in the form of the setup schema
    """

    name: str
    outline: str
    through: bool
    depth: float
    shape: Any
    setup: dict[str, Any]

    def write(self, directory: str | Path) -> tuple[Path, Path]:
        """Write NAME.step and NAME.setup.json; the same part gives the same bytes. Returns both paths."""
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        step, setup = folder / f"{self.name}.step", folder / f"{self.name}.setup.json"
        step.write_bytes(step_bytes(self.shape, self.name))
        setup.write_text(json.dumps(self.setup, indent=1) + "\n")
        return step, setup


def deep_part(seed: int) -> DeepPart:
    """Draw one part; the same seed gives the same part.

    Raises
    ------
    LayoutError
        No draw gave one valid solid.
    """
    rng = np.random.default_rng([seed, 0xD33])
    outline = list(OUTLINES)[seed % len(OUTLINES)]
    share = (seed * 37 % COUNT) / (COUNT - 1)  # each diameter once in the series, thin ones more often
    diameter = float(np.round(2.0 * THINNEST * (WIDEST / THINNEST) ** share ** 2.2) / 2.0)
    through = outline != "frame" and bool(rng.random() < 0.55)
    depth = round(min(max(diameter * float(rng.uniform(1.05, 4.0)), SHALLOWEST), DEEPEST), 1)
    tools = _tools(rng, diameter, depth, seed % EQUAL == 0)
    for _ in range(DRAWS):
        opening = OUTLINES[outline](rng, diameter, 3.0 * depth)
        shape = _plate(rng, opening, depth, through)
        if shape is not None:
            stock = {"kind": "box", "margin_mm": 1.0} if rng.random() < 0.6 else {
                "kind": "part_offset", "margin_mm": 0.5, "uncertainty_mm": 0.3}
            skipped = {} if rng.random() < 0.15 else {"operations": {"exclude_faces": _outer_sides(shape)}}
            setup = {"tools": tools, "machine": {"kind": "3-axis", "dialects": ["linuxcnc"]}, "stock": stock,
                     "quality": {"scallop_height_mm": 0.05}, "material": "AlMgSi1 6082", **skipped}
            return DeepPart(f"deep-{seed}", outline, through, depth, shape, setup)
    raise LayoutError(f"no deep part for seed {seed}")


def _tools(rng: Generator, diameter: float, depth: float, equal: bool) -> list[dict[str, Any]]:
    """One tool whose neck follows its flutes to the depth, and at times a second one of two thirds the width.

    equal : whether the flutes are as long as the opening is deep
    """
    kind = ("flat", "bull", "flat", "ball", "flat")[int(rng.integers(5))]
    tools = [_tool(rng, 1, kind, diameter, depth, equal)]
    if rng.random() < 0.2 and diameter >= 1.5 * THINNEST:
        tools.append(_tool(rng, 2, "flat", round(diameter / 1.5, 1), depth, equal))
    return tools


def _tool(rng: Generator, number: int, kind: str, diameter: float, depth: float, equal: bool) -> dict[str, Any]:
    share = float(rng.uniform(0.45, 1.5))
    flutes = round(max(depth * (1.0 if equal else share), 1.1 * diameter), 1)
    neck = round(max(flutes, depth) + 6.0, 1)
    return {
        "id": f"T{number}", "number": number, "kind": kind, "diameter_mm": diameter,
        **({"corner_radius_mm": round(diameter * float(rng.uniform(0.06, 0.25)), 2)} if kind == "bull" else {}),
        "flutes": 2 if kind == "ball" else 4, "flute_length_mm": flutes, "neck_length_mm": neck,
        "neck_diameter_mm": round(0.95 * diameter - 0.1, 2), "shank_diameter_mm": diameter, "stickout_mm": neck + 12.0,
        "holder": [{"diameter_mm": round(1.4 * diameter + 8.0, 1), "length_mm": 30.0}]}


def _plate(rng: Generator, opening: Any, depth: float, through: bool) -> Any | None:
    """A plate with an opening whose prism stands from z = 0 up, cut in from the top; None where it is no solid."""
    import cadquery as cq

    if opening is None or not opening.isValid() or len(opening.Solids()) != 1:
        return None
    box, rim = opening.BoundingBox(), float(rng.uniform(2.0, 4.0))
    floor = 0.0 if through else round(float(rng.uniform(2.0, 4.0)), 1)
    size = box.xlen + 2.0 * rim, box.ylen + 2.0 * rim, depth + floor
    plate = cq.Solid.makeBox(*size, cq.Vector(box.xmin - rim, box.ymin - rim, 0.0))
    solids = plate.cut(opening.translate(cq.Vector(0.0, 0.0, floor))).clean().Solids()
    return solids[0] if len(solids) == 1 and solids[0].isValid() else None


def _outer_sides(plate: Any) -> list[str]:
    """Ids of the outer side faces of a plate: they are plain, and without them a plan takes seconds."""
    box, out = plate.BoundingBox(), []
    for number, face in enumerate(plate.Faces(), start=1):
        b = face.BoundingBox()
        if max(b.xmin - box.xmin, b.xmax - box.xmin) < 1e-3 or max(box.xmax - b.xmin, box.xmax - b.xmax) < 1e-3 or \
                max(b.ymin - box.ymin, b.ymax - box.ymin) < 1e-3 or max(box.ymax - b.ymin, box.ymax - b.ymax) < 1e-3:
            out.append(f"F{number}")
    return out


def _disc(x: float, y: float, radius: float, high: float) -> Any:
    import cadquery as cq

    return cq.Solid.makeCylinder(radius, high, cq.Vector(x, y, 0.0))


def _prism(points: list[tuple[float, float]], high: float) -> Any:
    import cadquery as cq

    return cq.Workplane("XY").polyline(points).close().extrude(high).val()


def _rounded(prism: Any, radius: float) -> Any | None:
    """A prism with its upright edges rounded; None where the kernel cannot."""
    import cadquery as cq

    try:
        out = cq.Workplane(obj=prism).edges("|Z").fillet(radius).val()
    except Exception:  # the classes of the kernel, and errors that pass through them
        return None
    return out if out.isValid() else None


def _bar(a: tuple[float, float], b: tuple[float, float], ends: tuple[float, float], high: float) -> Any:
    """The hull of two discs, as a prism: tangents and arcs."""
    (ax, ay), (bx, by), (ra, rb) = a, b, ends
    far, way = math.hypot(bx - ax, by - ay), math.atan2(by - ay, bx - ax)
    turn = math.acos((ra - rb) / far)
    corners = [(x + r * math.cos(way + s * turn), y + r * math.sin(way + s * turn))
               for x, y, r, s in ((ax, ay, ra, 1.0), (ax, ay, ra, -1.0), (bx, by, rb, -1.0), (bx, by, rb, 1.0))]
    return _disc(ax, ay, ra, high).fuse(_disc(bx, by, rb, high), _prism(corners, high)).clean()


def crescent(rng: Generator, diameter: float, high: float) -> Any | None:
    """Half of a disc less another disc, its corners rounded."""
    outer = diameter * float(rng.uniform(1.7, 2.4))
    inner, wide = outer * float(rng.uniform(0.55, 0.7)), diameter * float(rng.uniform(1.3, 1.8))
    moon = _disc(0.0, 0.0, outer, high).cut(_disc(wide - outer + inner, 0.0, inner, high))
    low = -outer * float(rng.uniform(0.05, 0.3))
    half = _prism([(-3.0 * outer, low), (-3.0 * outer, -3.0 * outer), (3.0 * outer, -3.0 * outer), (3.0 * outer, low)],
                  high)
    solids = moon.intersect(half).Solids()
    return _rounded(max(solids, key=lambda s: s.Volume()), diameter * float(rng.uniform(0.2, 0.4))) if solids else None


def slot(rng: Generator, diameter: float, high: float) -> Any | None:
    """A straight slot with round ends, 1.05 to 1.8 tools wide."""
    end, long = 0.5 * diameter * float(rng.uniform(1.05, 1.8)), diameter * float(rng.uniform(1.0, 3.0))
    return _bar((0.0, 0.0), (long, long * float(rng.uniform(-0.5, 0.5))), (end, end * float(rng.uniform(0.99, 1.0))),
                high)


def bent_slot(rng: Generator, diameter: float, high: float) -> Any | None:
    """A slot along an arc of 60 to 200 degrees with round ends."""
    wide = diameter * float(rng.uniform(1.05, 1.7))
    radius, sweep = 0.5 * wide + diameter * float(rng.uniform(0.5, 1.0)), math.radians(float(rng.uniform(60, 200)))
    ring = _disc(0.0, 0.0, radius + 0.5 * wide, high).cut(_disc(0.0, 0.0, radius - 0.5 * wide, high))
    far = 4.0 * radius
    fan = [(far * math.cos(t), far * math.sin(t)) for t in np.linspace(0.0, sweep, 6).tolist()]
    ends = [_disc(radius * math.cos(t), radius * math.sin(t), 0.5 * wide, high) for t in (0.0, sweep)]
    return ring.intersect(_prism([(0.0, 0.0), *fan], high)).fuse(*ends).clean()


def arm(rng: Generator, diameter: float, high: float) -> Any | None:
    """Two bars that taper from a common joint, at an angle of 50 to 150 degrees."""
    joint, turn = 0.5 * diameter * float(rng.uniform(1.3, 1.9)), math.radians(float(rng.uniform(50, 150)))
    bars = []
    for way in (0.0, turn):
        long, end = diameter * float(rng.uniform(1.2, 2.2)), 0.5 * diameter * float(rng.uniform(1.05, 1.5))
        bars.append(_bar((0.0, 0.0), (long * math.cos(way), long * math.sin(way)), (joint, end), high))
    return bars[0].fuse(bars[1]).clean()


def frame(rng: Generator, diameter: float, high: float) -> Any | None:
    """A groove with round corners round an island, 1.1 to 1.6 tools wide."""
    wide = diameter * float(rng.uniform(1.1, 1.6))
    x, y = (diameter * float(rng.uniform(0.5, 1.4)) for _ in range(2))  # half the sides of the island
    outer = _rounded(_prism([(s * (x + wide), t * (y + wide)) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))], high),
                     diameter * float(rng.uniform(0.4, 0.6)))
    inner = _rounded(_prism([(s * x, t * y) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))], high), 0.2 * diameter)
    return None if outer is None or inner is None else outer.cut(inner)


def tongues(rng: Generator, diameter: float, high: float) -> Any | None:
    """A window into which one tongue or two reach from the sides."""
    x, y = diameter * float(rng.uniform(1.5, 2.2)), diameter * float(rng.uniform(1.3, 1.7))
    window = _prism([(-x, -y), (x, -y), (x, y), (-x, y)], high)
    thick = diameter * float(rng.uniform(0.2, 0.4))
    for side in (1.0, -1.0)[: int(rng.integers(1, 3))]:
        at, reach = x * float(rng.uniform(-0.2, 0.2)), y * float(rng.uniform(0.1, 0.5))
        window = window.cut(_prism([(at - thick, side * 2.0 * y), (at - thick, side * (y - reach)),
                                    (at + thick, side * (y - reach)), (at + thick, side * 2.0 * y)], high))
    return _rounded(window, thick * float(rng.uniform(0.6, 0.95)))


def polygon(rng: Generator, diameter: float, high: float) -> Any | None:
    """A polygon of 4 to 7 corners, rounded."""
    corners = int(rng.integers(4, 8))
    angles = np.sort(2.0 * np.pi * (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) / corners)
    radii = diameter * rng.uniform(1.2, 2.4, corners)
    points = list(zip((radii * np.cos(angles)).tolist(), (radii * np.sin(angles)).tolist(), strict=True))
    return _rounded(_prism(points, high), diameter * float(rng.uniform(0.25, 0.55)))


OUTLINES: dict[str, Callable[[Generator, float, float], Any | None]] = {
    "crescent": crescent, "slot": slot, "arm": arm, "frame": frame, "bent_slot": bent_slot, "polygon": polygon,
    "tongues": tongues}
"""Function that draws each kind of opening as a prism, from a generator, a tool diameter and a height, mm."""
