"""Hand-made parts with walls and connections, and their exact counts, for the tests of the decomposition.

Each builder returns a cadquery Workplane; plates lie from z = 0 to 4, walls reach 0.5 to 1 mm into them.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry.part import Part

Shape = Any
Counts = tuple[int, int, int]
"""Walls, connections, channels."""


def to_part(shape: Shape, chord: float = 0.03) -> Part:
    """Write a shape as STEP and read it back, in this process."""
    import cadquery as cq

    from geometry.step_import.occ.loading import load_part

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.step"
        cq.exporters.export(shape if hasattr(shape, "vals") else cq.Workplane(obj=shape), str(path))
        return load_part(path, chord=chord)


def box(dx: float, dy: float, dz: float, x: float, y: float, z: float) -> Shape:
    """A box with its least corner at x, y, z."""
    import cadquery as cq

    return cq.Workplane().box(dx, dy, dz, centered=(False, False, False)).translate((x, y, z))


def plate(dx: float = 60, dy: float = 40) -> Shape:
    """A base plate 4 mm thick."""
    return box(dx, dy, 4, -5, -15, 0)


def pair() -> Shape:
    """Two parallel walls 2 mm thick, 13 high, 8 apart."""
    return plate().union(box(50, 2, 14, 0, -10, 3)).union(box(50, 2, 14, 0, 0, 3))


def three() -> Shape:
    """Three parallel walls, 8 apart."""
    return pair().union(box(50, 2, 14, 0, 10, 3))


def rod(p: tuple[float, float, float], q: tuple[float, float, float], r: float) -> Shape:
    """A round bar from p to q."""
    import cadquery as cq

    a, b = cq.Vector(*p), cq.Vector(*q)
    return cq.Workplane(obj=cq.Solid.makeCylinder(r, (b - a).Length, a, b - a))


def outline(plane: str, points: list[tuple[float, float]], length: float, at: tuple[float, float, float]) -> Shape:
    """A polygon pulled out along the normal of a plane, then moved."""
    import cadquery as cq

    return cq.Workplane(plane).polyline(points).close().extrude(length).translate(at)


def rounded(shape: Shape, low: tuple[float, float, float], high: tuple[float, float, float], radius: float) -> Shape:
    """Fillet the edges whose centres lie in a box."""
    import cadquery as cq

    return shape.edges(cq.selectors.BoxSelector(low, high)).fillet(radius)


def wavy_wall(y: float, *, strips: int = 0) -> Shape:
    """A 2 mm wall along a sine; cut into strips that stay separate faces when asked."""
    import cadquery as cq

    near = [(50 * i / 12, y + 2 * math.sin(50 * i / 96)) for i in range(13)]
    far = [(a, b + 2) for a, b in near[::-1]]
    wall = cq.Workplane().moveTo(*near[0]).spline(near[1:], includeCurrent=True).lineTo(*far[0])
    wall = wall.spline(far[1:], includeCurrent=True).close().extrude(14).translate((0, 0, 3))
    if not strips:
        return wall
    pieces = [wall.intersect(box(50 / strips, 80, 40, i * 50 / strips, -30, 0)) for i in range(strips)]
    out = pieces[0]
    for piece in pieces[1:]:
        out = out.union(piece, clean=False)
    return out


def ring() -> Shape:
    """A closed round wall on a disc."""
    import cadquery as cq

    wall = cq.Workplane().circle(20).circle(18).extrude(16).translate((0, 0, 3))
    return cq.Workplane().circle(22).extrude(4).union(wall)


def wheel(*, bore: float = 0, splitters: bool = True, struts: bool = False, rim: float = 28) -> Shape:
    """A hub on a disc with five blades, optionally splitters between them, struts and a bore."""
    import cadquery as cq

    profile = [(0, 0), (30, 0), (30, 4), (12, 5), (7, 18), (0, 18)]
    part = cq.Workplane("XZ").polyline(profile).close().revolve(360, (0, 0, 0), (0, 1, 0))
    if bore:
        part = part.cut(cq.Workplane().circle(bore).extrude(30))
    for k in range(5):
        turned = [box(rim - 6, 1.6, 14, 6, -0.8, 2)] + ([box(13, 1.6, 11, 15, -0.8, 2)] if splitters else [])
        for wall, angle in zip(turned, (72 * k, 72 * k + 36), strict=False):
            part = part.union(wall.rotate((0, 0, 0), (0, 0, 1), angle))
        if struts:
            end = (20 * math.cos(math.radians(36)), 20 * math.sin(math.radians(36)), 10)
            part = part.union(rod((20, 0, 10), end, 0.9).rotate((0, 0, 0), (0, 0, 1), 72 * k))
    return part.intersect(cq.Workplane().circle(29).extrude(40)) if rim > 29 else part


def _bar() -> Shape:
    return pair().union(box(3, 9, 3, 10, -9, 9))


def _round_bar() -> Shape:
    return pair().union(rod((10, -9, 11), (10, 1, 11), 1.5))


def _web(z: float, height: float) -> Shape:
    return pair().union(box(2, 9, height, 10, -9, z))


FORK = [(10, -9), (13, -9), (13, -6), (18, 0.5), (15, 0.5), (11.5, -4), (8, 0.5), (5, 0.5), (10, -6)]

SLENDER_FORK = [(10, -9), (11, -9), (11, -5), (16, 0.5), (14.8, 0.5), (10.5, -4.4), (6.2, 0.5), (5, 0.5), (10, -5)]

SHORT_STEM = [(9, -9.3), (11, -9.3), (10.6, -6), (14.06, 0.5), (12.7, 0.5), (10, -4.57), (7.3, 0.5), (5.94, 0.5),
              (9.4, -6)]


def aslant() -> Shape:
    """Two walls 3 apart and a steep bar that meets both slantwise: rays across the bar leave by the back of a wall."""
    bar = outline("XZ", [(-5, 2), (-5, -3), (5, 1), (5, 6)], -2.2, (0, -1.1, 9)).rotate((0, 0, 0), (0, 0, 1), 55)
    bar = bar.translate((20, -1.5, 0)).intersect(box(60, 5, 40, -5, -4, 0))
    return plate().union(box(50, 2, 14, 0, -5, 3)).union(box(50, 2, 14, 0, 0, 3)).union(bar)


def steep() -> Shape:
    """Two walls 1.5 apart and a bar that rises 3 between them: rays from its underside leave by the back of a wall."""
    bar = outline("YZ", [(-0.6, 4.8), (2.1, 10.2), (2.1, 11.7), (-0.6, 6.3)], 1.6, (20, 0, 0))
    return plate().union(box(50, 1.2, 16, 0, -1.2, 3)).union(box(50, 1.2, 16, 0, 1.5, 3)).union(bar)


def steeper() -> Shape:
    """Two walls 1.5 mm apart and a bar that climbs 4.4 mm between them: its underside looks like a side of a wall."""
    bar = outline("YZ", [(-0.6, 3.7), (2.1, 11.6), (2.1, 14.2), (-0.6, 6.3)], 3.5, (20, 0, 0))
    return plate().union(box(50, 1.2, 16, 0, -1.2, 3)).union(box(50, 1.2, 16, 0, 1.5, 3)).union(bar)


def both_sides() -> Shape:
    """A plate with two walls above, two in line with them below, and a bar on each side."""
    above = box(50, 2, 14, 0, -10, 3).union(box(50, 2, 14, 0, 0, 3)).union(box(3, 9, 3, 10, -9, 9))
    return plate().union(above).union(above.mirror("XY").translate((0, 0, 3)))


def far_leaning() -> Shape:
    """Two walls that lean 40 degrees."""
    one = outline("YZ", [(-10, 3), (-7.4, 3), (4.3, 17), (1.7, 17)], 50, (0, 0, 0))
    return plate(60, 60).union(one).union(one.translate((0, 12, 0)))


def at_corners() -> Shape:
    """Two leaning walls and two bars, one over the other, that end round the corners at the ends of the walls."""
    walls = [outline("YZ", [(y, 3), (y + 2, 3), (y + 4, 17), (y + 2, 17)], 50, (0, 0, 0)) for y in (-13, 0)]
    return plate().union(walls[0]).union(walls[1]).union(box(1, 13, 3, -0.4, -11, 6)).union(
        box(1, 13, 3, -0.2, -11, 9.5))


SHAPES: dict[str, tuple[Callable[[], Shape], Counts]] = {
    "two walls": (pair, (2, 0, 1)),
    "square bar": (_bar, (2, 1, 1)),
    "round bar": (_round_bar, (2, 1, 1)),
    "bar level with the wall tops": (lambda: pair().union(box(4, 9, 3, 10, -9, 14)), (2, 1, 1)),
    "two bars over each other": (lambda: _bar().union(box(3, 9, 2, 10, -9, 5)), (2, 2, 1)),
    "steep bar": (lambda: pair().union(outline("YZ", [(-9, 5), (1, 13), (1, 16), (-9, 8)], 2, (10, 0, 0))), (2, 1, 1)),
    "bent bar": (lambda: pair().union(outline(
        "YZ", [(-9, 8), (-4, 12), (0.5, 8), (0.5, 10), (-4, 14), (-9, 10)], 3, (10, 0, 0))), (2, 1, 1)),
    "bar from the floor": (lambda: pair().union(outline(
        "YZ", [(-9, 3.5), (0.5, 10), (0.5, 13), (-9, 6.5)], 3, (10, 0, 0))), (2, 1, 1)),
    "fork": (lambda: pair().union(outline("XY", FORK, 3, (0, 0, 9))), (2, 1, 1)),
    "fork of rods": (lambda: pair().union(rod((10, -9, 10), (10, -4.5, 10), 1.5)).union(
        rod((10, -4.6, 10), (16, 0.5, 12), 1.2)).union(rod((10, -4.6, 10), (4, 0.5, 9), 1.2)), (2, 1, 1)),
    "slender fork": (lambda: pair().union(outline("XY", SLENDER_FORK, 2.2, (0, 0, 9))), (2, 1, 1)),
    "slender fork with an arm at a hub in a wall": (lambda: pair().union(outline(
        "XY", SLENDER_FORK, 2.2, (0, 0, 9))).union(rod((15.5, 1.5, 0), (15.5, 1.5, 22), 4)), (3, 1, 2)),
    "fork with a short stem": (lambda: pair().union(outline("XY", SHORT_STEM, 2.2, (0, 0, 9))), (2, 1, 1)),
    "short bar aslant between walls": (aslant, (2, 1, 1)),
    "short steep bar between walls": (steep, (2, 1, 1)),
    "walls above and below a plate": (both_sides, (4, 2, 2)),
    "walls that lean 40 degrees": (far_leaning, (2, 0, 1)),
    "short bar steeper than that": (steeper, (2, 1, 1)),
    "bars round the corners of leaning walls": (at_corners, (2, 2, 1)),
    "slab": (lambda: pair().union(box(30, 9, 1.5, 10, -9, 8)), (2, 1, 1)),
    "web above the floor": (lambda: _web(7, 9), (2, 1, 1)),
    "web above the floor, level with the tops": (lambda: _web(7, 10), (2, 1, 1)),
    "web on the floor": (lambda: _web(3, 10), (3, 0, 1)),
    "three walls in H": (lambda: _web(3, 14), (3, 0, 1)),
    "bar against a pier": (lambda: pair().union(box(24, 9, 16, -4, -9, 3)).union(box(3, 9, 3, 19.5, -9, 9)), (2, 1, 1)),
    "web with a gate": (lambda: _web(3, 10).cut(box(10, 3, 3, 6, -6, 4)), (2, 1, 1)),
    "web with a window": (lambda: _web(3, 10).cut(box(10, 3, 3, 6, -6, 6)), (3, 0, 1)),
    "leaning web on the floor": (lambda: pair().union(outline(
        "XZ", [(10, 3), (12, 3), (16, 13), (14, 13)], 9, (0, 0.5, 0))), (3, 0, 1)),
    "flanged web on the floor": (lambda: _web(3, 8).union(box(6, 9, 2, 8, -9, 11)), (3, 0, 1)),
    "T": (lambda: plate().union(box(50, 2, 14, 0, -10, 3)).union(box(2, 15, 14, 20, -9, 3)), (2, 0, 0)),
    "cross": (lambda: plate(60, 60).union(box(50, 2, 14, 0, 0, 3)).union(box(2, 50, 14, 20, -9, 3)), (2, 0, 0)),
    "ribs from both sides": (lambda: three().union(box(2, 21, 10, 10, -9.5, 3)), (5, 0, 2)),
    "bar through a wall": (lambda: three().union(box(3, 21, 3, 10, -9.5, 9)), (3, 2, 2)),
    "wall with a window": (lambda: pair().cut(box(5, 10, 4, 10, -12, 8)), (2, 0, 1)),
    "walls flush with the plate ends": (lambda: box(50, 30, 4, 0, -15, 0).union(box(50, 2, 14, 0, -10, 3)).union(
        box(50, 2, 14, 0, 0, 3)), (2, 0, 1)),
    "walls flush with the plate sides": (lambda: box(50, 30, 4, 0, -15, 0).union(box(50, 2, 14, 0, -15, 3)).union(
        box(50, 2, 14, 0, 13, 3)), (2, 0, 1)),
    "tray": (lambda: box(50, 30, 20, 0, 0, 0).cut(box(46, 26, 20, 2, 2, 4)), (1, 0, 1)),
    "tray with a rib": (lambda: box(50, 30, 20, 0, 0, 0).cut(box(22, 26, 20, 2, 2, 4)).cut(
        box(22, 26, 20, 26, 2, 4)), (2, 0, 2)),
    "ring with a strut": (lambda: ring().union(box(38, 3, 3, -19, -1.5, 9)), (1, 1, 1)),
    "ring with a round strut": (lambda: ring().union(rod((-19, 0, 11), (19, 0, 11), 1.5)), (1, 1, 1)),
    "fillets at the foot": (lambda: rounded(pair().edges("|X"), (-1, -16, 3.5), (51, 20, 4.5), 1.0), (2, 0, 1)),
    "fillets at a bar": (lambda: rounded(_bar(), (9, -8.5, 8), (14, 0.5, 13), 0.6), (2, 1, 1)),
    "fillets at a round bar": (lambda: rounded(_round_bar(), (8, -8.5, 9), (12, 0.5, 13), 0.6), (2, 1, 1)),
    "rounded tops": (lambda: pair().edges("|X").edges(">Z").fillet(0.7), (2, 0, 1)),
    "round tops": (lambda: pair().edges("|X").edges(">Z").fillet(0.999), (2, 0, 1)),
    "wavy walls": (lambda: plate().union(wavy_wall(-10)).union(wavy_wall(0)).union(box(3, 12, 3, 10, -7.5, 9)),
                   (2, 1, 1)),
    "wavy walls in strips": (lambda: plate().union(wavy_wall(-10, strips=8), clean=False).union(
        wavy_wall(0, strips=8), clean=False).union(box(3, 12, 3, 10, -7.5, 9), clean=False), (2, 1, 1)),
    "blades": (lambda: wheel(splitters=False), (5, 0, 5)),
    "blades and splitters": (wheel, (10, 0, 15)),
    "blades round a bored hub": (lambda: wheel(bore=4.2, splitters=False), (5, 0, 5)),
    "blades flush with the rim": (lambda: wheel(splitters=False, rim=31), (5, 0, 5)),
    "blades joined by struts": (lambda: wheel(struts=True), (10, 5, 15)),
    "block": (lambda: box(30, 20, 10, 0, 0, 0), (0, 0, 0)),
    "post": (lambda: plate().union(box(4, 4, 20, 10, 0, 3)), (0, 0, 0)),
}
