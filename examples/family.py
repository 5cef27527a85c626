"""The public family of test parts: free-form walls, channels and internal connections, with truth.

``make_part(seed)`` gives a random part, ``make_part(seed, recipe="leaning_pair")`` a
named one. Every part stands on its seat at z = 0 and is cut from +Z. The truth is
recorded from the generating curves, never measured on the finished shape.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from examples import linear
from examples.connections import TRUTH_KIND, ConnectionSpec
from examples.gaps import Gap
from examples.impeller import impeller
from examples.layout import Layout, LayoutError, check
from examples.setups import suggest_setup
from examples.walls import WallSpec

RECIPES: dict[str, Callable[..., Layout]] = {
    "random": linear.random,
    "demo": linear.demo,
    "narrow": linear.narrow,
    "leaning_pair": linear.leaning_pair,
    "three_walls": linear.three_walls,
    "wavy": linear.wavy,
    "impeller": impeller,
}
"""Name of each recipe and the function that draws it from a random generator."""

STEP_TIME = "1970-01-01T00:00:00"


@dataclass(frozen=True, eq=False)
class FamilyPart:
    """A part of the family.

    name   : recipe and seed, for example 'demo-0'
    shape  : cadquery Solid, valid and closed, mm, seat at z = 0
    truth  : plain data, see ``truth_of``
    setup  : a suggested setup in the form of the setup schema
    layout : what the shape was made from
    """

    name: str
    shape: Any
    truth: dict[str, Any]
    setup: dict[str, Any]
    layout: Layout

    def write(self, directory: str | Path) -> tuple[Path, Path, Path]:
        """Write NAME.step, NAME.truth.json and NAME.setup.json; the same part gives the same bytes.

        Returns the three paths.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        step, truth, setup = (folder / f"{self.name}.{end}" for end in ("step", "truth.json", "setup.json"))
        step.write_bytes(step_bytes(self.shape, self.name))
        truth.write_text(json.dumps(self.truth, indent=1) + "\n")
        setup.write_text(json.dumps(self.setup, indent=1) + "\n")
        return step, truth, setup


def make_part(seed: int = 0, recipe: str = "random", *, fillet: float = 0.0, **overrides: Any) -> FamilyPart:
    """Make one part of the family.

    seed      : the same seed gives the same part
    recipe    : a key of RECIPES
    fillet    : mm, radius between walls and floor; 0 for sharp
    overrides : passed to the recipe; the random one takes walls, connections and gap
    Raises LayoutError where 60 draws gave no layout that keeps the rules, or the union is no single valid solid.
    """
    layout = draw_layout(seed, recipe, **overrides)
    layout = replace(layout, fillet=fillet)
    shape = build_solid(layout)
    name = f"{recipe}-{seed}"
    truth = truth_of(layout, name)
    return FamilyPart(name, shape, truth, suggest_setup(layout, truth), layout)


def draw_layout(seed: int, recipe: str = "random", **overrides: Any) -> Layout:
    """The layout of a part without building it; draws again, up to 60 times, until the rules hold."""
    rng = np.random.default_rng([seed, sorted(RECIPES).index(recipe)])
    reason: LayoutError | None = None
    for _ in range(60):
        try:
            layout = RECIPES[recipe](rng, **overrides)
            check(layout)
        except LayoutError as error:
            reason = error
            continue
        return layout
    raise LayoutError(f"no {recipe} layout for seed {seed}: {reason}")


def build_solid(layout: Layout) -> Any:
    """Unite base, walls and connections into one cadquery Solid; raises LayoutError unless it is valid."""
    tools = [w.solid() for w in layout.walls] + [c.solid() for c in layout.connections]
    if not all(t.isValid() and t.Volume() > 0 for t in tools):
        raise LayoutError(f"a wall or connection of {layout.name} is no valid solid")
    solids = layout.base.solid().fuse(*tools).clean().Solids()
    if len(solids) != 1 or not solids[0].isValid() or solids[0].Volume() <= 0:
        raise LayoutError(f"the union of {layout.name} is no single valid solid")
    solid = solids[0]
    return _filleted(solid, layout) if layout.fillet > 0 else solid


def _filleted(solid: Any, layout: Layout) -> Any:
    """Fillet every edge where a wall meets the floor."""
    z = layout.walls[0].z_floor
    feet = [e for e in solid.Edges() if all(abs(c - z) < 1e-6 for c in (e.BoundingBox().zmin, e.BoundingBox().zmax))]
    base = layout.base.solid()
    rims = [e for e in feet if not _on_rim(e, base)]
    filleted = solid.fillet(layout.fillet, rims)
    solids = filleted.Solids()
    if len(solids) != 1 or not solids[0].isValid():
        raise LayoutError(f"fillets of {layout.fillet} mm do not fit")
    return solids[0]


def _on_rim(edge: Any, base: Any) -> bool:
    box, p = base.BoundingBox(), edge.positionAt(0.5)
    return min(p.x - box.xmin, box.xmax - p.x, p.y - box.ymin, box.ymax - p.y) < 1e-6


def truth_of(layout: Layout, name: str = "") -> dict[str, Any]:
    """What is true of a layout, as plain data.

    Returns walls (index, kind, height, thickness, z range, a point on each side), connections (wall indices, kind,
    z range outside the walls, floor contact, a point inside), channels (wall indices, gap_min within 0.5 %,
    the point where, whether on the border of a side, facing area, and primary: at least a quarter of the smaller
    side faces the other wall, not a glimpse past or over a wall between) and the seat; all lengths mm.
    """
    gaps = layout.gaps()
    return {
        "name": name,
        "recipe": layout.name,
        "unit": "mm",
        "seat_z": 0.0,
        "fillet": layout.fillet,
        "walls": [_wall_truth(k, w) for k, w in enumerate(layout.walls)],
        "connections": [_connection_truth(k, c) for k, c in enumerate(layout.connections)],
        "channels": [
            {"walls": list(g.walls), "gap_min": round(g.gap_min, 6), "at": [round(c, 4) for c in g.at],
             "border": g.border, "facing_area": round(g.area, 3), "primary": _primary(layout, g)}
            for g in gaps
        ],
    }


def _primary(layout: Layout, gap: Gap) -> bool:
    smaller = min(layout.walls[k].length * layout.walls[k].height for k in gap.walls)
    return bool(gap.area >= 2 * 0.25 * smaller)


def _wall_truth(index: int, wall: WallSpec) -> dict[str, Any]:
    middle = np.array([0.5])
    return {
        "index": index,
        "kind": wall.kind,
        "height": wall.height,
        "length": round(wall.length, 3),
        "thickness": round(wall.thickness_mid, 4),
        "thickness_floor_top": list(wall.thickness),
        "lean": list(wall.lean),
        "z": [wall.z_floor, wall.z_top],
        "side_points": [[round(float(c), 4) for c in wall.side_point(s, middle, middle)[0]] for s in (1, -1)],
    }


def _connection_truth(index: int, c: ConnectionSpec) -> dict[str, Any]:
    s = np.array([0.5 * (c.span[0] + c.span[1])])
    xy = c.start[:2] + (c.end - c.start)[:2] * s[0]
    if c.kind == "bow":
        xy = 0.5 * (c.start + c.end)[:2] + c.bend * c.lateral
    return {
        "index": index,
        "walls": list(c.indices),
        "kind": TRUTH_KIND[c.kind],
        "shape": c.kind,
        "z": [round(v, 4) for v in c.z_range],
        "width": round(c.width, 4),
        "floor_contact": c.floor_contact,
        "void_share": round(c.void_share, 3),
        "point": [round(float(v), 4) for v in (*xy, c.axis_height(s)[0])],
    }


def step_bytes(shape: Any, name: str) -> bytes:
    """The shape as STEP AP214 text whose header holds no date and no machine.

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
