"""The public family of test parts: free-form walls, channels and internal connections, with known features.

``make_part(seed)`` gives a random part, ``make_part(seed, recipe="leaning_pair")`` a named one. Every part stands on
its
seat at z = 0 and is cut from +Z. The truth is recorded from the generating curves, never measured on the finished
shape.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from shapely.errors import GEOSException
from shapely.geometry import Point

from examples.family import linear
from examples.family.connections import TRUTH_KIND, ConnectionSpec
from examples.family.fillets import filleted
from examples.family.freewall import FreeWall
from examples.family.gaps import Gap
from examples.family.impeller import impeller
from examples.family.joins import ForkSpec, takes_fillets
from examples.family.layout import LayoutError, PartLayout, WindowSpec, check
from examples.family.mixed import mixed, mixed_linear, mixed_radial
from examples.family.walls import WallSpec
from examples.setups import suggest_setup

RECIPES: dict[str, Callable[..., PartLayout]] = {
    "random": linear.random,
    "demo": linear.demo,
    "narrow": linear.narrow,
    "leaning_pair": linear.leaning_pair,
    "three_walls": linear.three_walls,
    "wavy": linear.wavy,
    "impeller": impeller,
    "mixed": mixed,
    "mixed_linear": mixed_linear,
    "mixed_radial": mixed_radial,
}
"""Name of each recipe and the function that draws it from a random generator."""

NUMBERS = {"demo": 0, "impeller": 1, "leaning_pair": 2, "narrow": 3, "random": 4, "three_walls": 5, "wavy": 6,
           "mixed": 7, "mixed_linear": 8, "mixed_radial": 9}
"""Offset of the seeds of each recipe; a number stays with its recipe, so that new recipes change no part."""
DRAWS, BUILDS = 60, 6
SEAM = 0.03
"""mm; an edge as near as this to both a connection and a wall is their seam."""

STEP_TIME = "1970-01-01T00:00:00"


@dataclass(frozen=True, eq=False)
class FamilyPart:
    """A part of the family.

    name   : recipe and seed, for example 'demo-0'
    shape  : cadquery Solid, valid and closed, mm, seat at z = 0
    truth  : plain data, see ``truth_of``
    setup  : a suggested setup in the form of the setup schema
    layout : the layout of the shape
    """

    name: str
    shape: Any
    truth: dict[str, Any]
    setup: dict[str, Any]
    layout: PartLayout

    def write(self, directory: str | Path, *, reach: bool = False) -> tuple[Path, Path, Path]:
        """Write NAME.step, NAME.truth.json and NAME.setup.json; the same part gives the same bytes.

        reach : whether the truth also has the area that the setup can reach, see ``examples.family.reach`` (some
                seconds)

        Returns the three paths.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        step, truth, setup = (folder / f"{self.name}.{end}" for end in ("step", "truth.json", "setup.json"))
        step.write_bytes(step_bytes(self.shape, self.name))
        facts = dict(self.truth)
        if reach:
            from examples.family.reach import reach_of

            facts["reach"] = reach_of(step, self.setup)
        truth.write_text(json.dumps(facts, indent=1) + "\n")
        setup.write_text(json.dumps(self.setup, indent=1) + "\n")
        return step, truth, setup


def make_part(seed: int = 0, recipe: str = "random", *, fillet: float = 0.0, **overrides: Any) -> FamilyPart:
    """Make one part of the family.

    seed      : the same seed gives the same part
    recipe    : a key of RECIPES
    fillet    : mm, radius between walls and floor; 0 for sharp
    overrides : passed to the recipe; the random one takes walls, connections and gap

    Raises LayoutError where 60 draws gave no valid layout, or the union is not a single valid solid.
    """
    rng = _generator(seed, recipe)
    for attempt in range(BUILDS):
        layout = _draw(rng, seed, recipe, overrides)
        layout = replace(layout, fillet=fillet) if fillet else layout
        try:
            layout, shape = _built(layout)
            break
        except LayoutError:
            if attempt == BUILDS - 1:
                raise
    name = f"{recipe}-{seed}"
    truth = truth_of(layout, name)
    return FamilyPart(name, shape, truth, suggest_setup(layout, truth), layout)


def _built(layout: PartLayout) -> tuple[PartLayout, Any]:
    """The layout and its solid; without fillets at the connections where the kernel cannot make them."""
    if layout.rounded > 0:
        try:
            return layout, build_solid(layout)
        except LayoutError:
            layout = replace(layout, rounded=0.0)
    return layout, build_solid(layout)


def draw_layout(seed: int, recipe: str = "random", **overrides: Any) -> PartLayout:
    """The layout of a part without building it; draws again, up to 60 times, until the rules hold.

    Raises LayoutError where they do not hold even then.
    """
    return _draw(_generator(seed, recipe), seed, recipe, overrides)


def _generator(seed: int, recipe: str) -> np.random.Generator:
    if recipe not in RECIPES:
        raise LayoutError(f"there is no recipe {recipe!r}; there are {', '.join(sorted(RECIPES))}")
    return np.random.default_rng([seed, NUMBERS[recipe]])


def _draw(rng: np.random.Generator, seed: int, recipe: str, overrides: dict[str, Any]) -> PartLayout:
    reason: Exception | None = None
    for _ in range(DRAWS):
        try:
            layout = RECIPES[recipe](rng, **overrides)
            check(layout)
        except (LayoutError, GEOSException) as error:  # outlines that touch themselves are not a layout either
            reason = error
            continue
        return layout
    raise LayoutError(f"no {recipe} layout for seed {seed}: {reason}")


def build_solid(layout: PartLayout) -> Any:
    """Unite base, walls and connections into one cadquery Solid.

    Raises
    ------
    LayoutError
        The solid is not valid.
    """
    tools = [w.solid() for w in layout.walls] + [c.solid() for c in layout.connections]
    if not all(t.isValid() and _volume(t) > 0 for t in tools):
        raise LayoutError(f"a wall or connection of {layout.name} is no valid solid")
    union = layout.base.solid().fuse(*tools)
    if layout.windows:
        union = union.cut(*(w.solid() for w in layout.windows))
    solids = union.clean().Solids()
    if len(solids) != 1 or not solids[0].isValid() or _volume(solids[0]) <= 0:
        raise LayoutError(f"the union of {layout.name} is no single valid solid")
    solid = solids[0]
    if layout.rounded > 0:
        seams = _seams(solid, layout)
        solid = filleted(solid, layout.rounded, seams) if seams else None
        if solid is None or _volume(solid) <= 0:
            raise LayoutError(f"fillets of {layout.rounded} mm do not fit")
    return _filleted(solid, layout) if layout.fillet > 0 else solid


def _seams(solid: Any, layout: PartLayout) -> list[int]:
    """Indices of the edges of a solid where its first connection with fillets meets its walls."""
    outlines = [(c.footprint().buffer(SEAM), c) for c in layout.connections if takes_fillets(c)][:1]
    out = []
    for number, edge in enumerate(solid.Edges()):
        at = edge.positionAt(0.5)
        p = Point(at.x, at.y)
        for outline, c in outlines:
            if c.z_range[0] - SEAM <= at.z <= c.z_range[1] + SEAM and outline.contains(p) and any(
                layout.walls[k].section(at.z).boundary.distance(p) < SEAM for k in set(c.indices)
            ):
                out.append(number)
                break
    return out


def _with_fillets(solid: Any, radius: float, edges: list[Any]) -> Any:
    try:
        solids = solid.fillet(radius, edges).Solids() if edges else []
    except Exception as error:  # the classes of the kernel, and errors that pass through them
        raise LayoutError(f"fillets of {radius} mm do not fit: {error}") from None
    if len(solids) != 1 or not solids[0].isValid() or _volume(solids[0]) <= 0:
        raise LayoutError(f"fillets of {radius} mm do not fit")
    return solids[0]


def _volume(solid: Any) -> float:
    """Volume, mm³; adaptive, because plain quadrature may be off by its sign on faces with a hundred knots."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    props = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.wrapped, props, 1e-3, True, False)
    return float(props.Mass())


def _filleted(solid: Any, layout: PartLayout) -> Any:
    """Fillet every edge where a wall meets the floor."""
    z = layout.walls[0].z_floor
    feet = [e for e in solid.Edges() if all(abs(c - z) < 1e-6 for c in (e.BoundingBox().zmin, e.BoundingBox().zmax))]
    base = layout.base.solid()
    rims = [e for e in feet if not _on_rim(e, base)]
    return _with_fillets(solid, layout.fillet, rims)


def _on_rim(edge: Any, base: Any) -> bool:
    box, p = base.BoundingBox(), edge.positionAt(0.5)
    return min(p.x - box.xmin, box.xmax - p.x, p.y - box.ymin, box.ymax - p.y) < 1e-6


def truth_of(layout: PartLayout, name: str = "") -> dict[str, Any]:
    """The known features of a layout, as plain data; all lengths mm.

    It has walls (index, kind, height, thickness, z range, a point on each side), connections (wall indices, kind, z
    range
    outside the walls, floor contact, a point inside), channels and the seat. A channel has wall indices, gap_min within
    0.5 %, the place of it, whether that is on the border of a side, and facing area. It is primary where at least a
    quarter
    of the smaller side faces the other wall.
    """
    gaps = layout.gaps()
    free = any(isinstance(w, FreeWall) for w in layout.walls)
    return {
        "name": name,
        "recipe": layout.name,
        "unit": "mm",
        "seat_z": 0.0,
        "fillet": layout.fillet,
        **({"features": features_of(layout, gaps)} if free else {}),
        "walls": [_wall_truth(layout, k, w) for k, w in enumerate(layout.walls)],
        "connections": [_connection_truth(k, c) for k, c in enumerate(layout.connections)],
        **({"windows": [_window_truth(w) for w in layout.windows]} if free else {}),
        "channels": [
            {"walls": list(g.walls), "gap_min": round(g.gap_min, 6), "at": [round(c, 4) for c in g.at],
             "border": g.border, "facing_area": round(g.area, 3), "primary": _primary(layout, g)}
            for g in gaps
        ],
    }


def features_of(layout: PartLayout, gaps: list[Gap]) -> list[str]:
    """Features of a part, as sorted words, so that a failure can be attributed to a cause.

    layout : with FreeWall walls
    gaps   : its true channels
    """
    words = set(layout.features) | {f"connection_{c.kind}" for c in layout.connections}
    for wall in layout.walls:
        if isinstance(wall, FreeWall):
            words |= wall.features
    for c in layout.connections:
        words |= {"floor_contact"} if c.floor_contact else set()
        words |= {"same_wall"} if len(set(c.indices)) == 1 else set()
        words |= {"fork_of_three_walls"} if len(set(c.indices)) > 2 else set()
    outlines = [c.footprint() for c in layout.connections]
    if any(a.intersects(b) for k, a in enumerate(outlines) for b in outlines[:k]):
        words.add("levels")
    if any(g.gap_min < 1.0 and _primary(layout, g) for g in gaps):
        words.add("narrow")
    words |= {"window"} if layout.windows else set()
    words |= {"foot_fillet"} if layout.fillet > 0 else set()
    words |= {"connection_fillet"} if layout.rounded else set()
    return sorted(words)


def _primary(layout: PartLayout, gap: Gap) -> bool:
    smaller = min(layout.walls[k].length * layout.walls[k].height for k in gap.walls)
    return bool(gap.area >= 2 * 0.25 * smaller)


def _side_point(layout: PartLayout, wall: WallSpec, side: int) -> Any:
    """A point of a side, (3,) float64, mm: in the middle, on a free wall where the solid has the side there."""
    tries = [(u, v) for v in (0.5, 0.65, 0.35, 0.8) for u in (0.5, 0.42, 0.58, 0.66, 0.34, 0.74, 0.26, 0.82, 0.18)]
    others = [w for w in layout.walls if w is not wall]
    for u, v in tries if isinstance(wall, FreeWall) else ():
        p = wall.side_point(side, np.array([u]), np.array([v]))[0]
        at = Point(p[:2])
        mine = [c for c in layout.connections if any(layout.walls[k] is wall for k in c.indices)]
        covers = [(c.footprint(), c.z_range) for c in mine]
        covers += [(w.footprint(), w.z) for w in layout.windows if w.wall is wall]
        free = not any(z[0] - 0.5 < p[2] < z[1] + 0.5 and outline.distance(at) < 0.5 for outline, z in covers)
        free &= not layout.meets or all(w.section(p[2]).distance(at) > 0.2 for w in others)
        if free and not layout.base.blocked(p[None], p[None] * [1.05, 1.05, 1.0])[0]:
            return p
    return wall.side_point(side, np.array([0.5]), np.array([0.5]))[0]


def _wall_truth(layout: PartLayout, index: int, wall: WallSpec) -> dict[str, Any]:
    shape: dict[str, Any] = {}
    if isinstance(wall, FreeWall):
        p = wall.profile
        shape = {"drawn": p.type, "profiles": list(p.labels), "closed": p.closed, "strips": wall.strips,
                 "merged": wall.merged,
                 "control_points": [[round(float(c), 6) for c in q] for q in p.control]}
    return {
        "index": index,
        "kind": wall.kind,
        "height": wall.height,
        "length": round(wall.length, 3),
        "thickness": round(wall.thickness_mid, 4),
        "thickness_floor_top": list(wall.thickness),
        "lean": list(wall.lean),
        "z": [wall.z_floor, wall.z_top],
        "side_points": [[round(float(c), 4) for c in _side_point(layout, wall, s)] for s in (1, -1)],
        **shape,
    }


def _window_truth(window: WindowSpec) -> dict[str, Any]:
    middle = window.wall.axis_point(window.u, 0.5 * sum(window.z))
    return {"wall": window.index, "width": round(window.width, 3), "z": [round(v, 3) for v in window.z],
            "at": [round(float(c), 3) for c in middle]}


def _connection_truth(index: int, c: ConnectionSpec | ForkSpec) -> dict[str, Any]:
    return {
        "index": index,
        "walls": list(c.indices),
        "kind": TRUTH_KIND[c.kind],
        "shape": c.kind,
        "z": [round(v, 4) for v in c.z_range],
        "width": round(c.width, 4),
        "floor_contact": c.floor_contact,
        "void_share": round(c.void_share, 3),
        "point": [round(float(v), 4) for v in c.point],
    }


def step_bytes(shape: Any, name: str) -> bytes:
    """The shape as STEP AP214 text whose header has no date and no machine.

    shape : cadquery Shape, mm
    name  : file and product name in the header
    """
    import tempfile

    import cadquery as cq

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        cq.exporters.export(cq.Workplane(obj=shape), str(path))
        text = path.read_text()
    header = f"FILE_NAME('{name}','{STEP_TIME}',('zonemill'),('zonemill'),'zonemill family','Open CASCADE','');"
    text = re.sub(r"FILE_NAME\(.*?\);", header, text, count=1, flags=re.DOTALL)
    return re.sub(r"Open CASCADE STEP translator [\d.]+ [\d.]+", name, text).encode()
