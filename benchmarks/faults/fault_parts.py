"""Three parts of the fault table for tools along Z: a pocket, a wave under a wall, two thin walls. Sizes by seed.

Every program is right: two tools, roughing in layers, finishing passes that each answer for a zone, clamps out of
the way.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.faults.fault_case import Case, Mode, Script, as_part, samples_on
from benchmarks.faults.fault_solids import Piece, Pocket, Profile, Pulled, Solid, chain
from geometry.mesh import F64
from geometry.tool_body import HolderFrustum, ToolBody
from verify.model import ProofSetup, ScoredSamples, StockKind

HOLDER = (HolderFrustum(16.0, 24.0, 12.0), HolderFrustum(24.0, 24.0, 15.0))
RAMP = math.tan(math.radians(2.8))
UP = np.array([0.0, 0.0, 1.0])


def made(name: str, script: Script, solid: Solid, tools: tuple[ToolBody, ...], setup: ProofSetup, faces: list[int],
         zone_of: dict[str, tuple[int, tuple[float, float]]], room: tuple[float, float, float, float], across: F64,
         top: float, seed: int) -> Case:
    """The case of a finished script.

    zone_of : by zone name the face and the least and greatest value it claims there of the place measured as
              ``claimed`` says; room, across : as in ``Case``, (4,) and (2, 2) mm; top : mm, of the blank
    """
    mesh = solid.mesh()  # type: ignore[attr-defined]
    samples = samples_on(solid, mesh, faces, seed)
    zone = np.zeros(len(samples), np.int32)
    for k, (face, (low, high)) in enumerate(zone_of.values(), 1):
        value = claimed(name, face, samples.points, solid)
        zone[(samples.face == face) & (value >= low) & (value <= high)] = k
    script.end()
    return Case(name, script.mode, tuple(script.lines), tuple(script.steps), tuple(script.runs), tools, setup, solid,
                as_part(mesh), ScoredSamples(samples, zone), tuple(zone_of), room, across, top, script.safe)


def claimed(name: str, face: int, points: F64, solid: Solid) -> F64:
    """(n,) mm by which a zone of a part bounds its samples (n, 3) mm: x of a wave, rho of a plate, way
    from the walls of a floor, else height."""
    if name == "wave" and face == 5:
        return points[:, 0]
    if isinstance(solid, Pocket) and face == 8:
        return solid.inset(points[:, :2])
    if name in ("dome", "cone", "house") and face == 3:
        return np.hypot(points[:, 0], points[:, 1])
    return points[:, 2]


def setup_of(box: F64, fixtures: list[list[list[float]]], **more: object) -> ProofSetup:
    """What all cases ask: a blank as a box (2, 3) mm, tight tolerances, a small machine; fixtures as boxes."""
    common: dict[str, object] = {"stock_kind": StockKind.BOX, "stock_box": np.asarray(box, float), "margin": 0.5,
                                 "uncertainty": 0.0, "scallop_height": 0.008, "gouge_tolerance": 0.004,
                                 "travel": np.array([200.0, 200.0, 200.0]), "max_feed": 5000.0,
                                 "fixtures": tuple(np.array(f, float) for f in fixtures)}
    return ProofSetup(**{**common, **more})  # type: ignore[arg-type]


def _ring(s: Script, a: float, b: float, r: float, z: float, wall: bool, floor: bool = False) -> None:
    """Once round a rectangle -a..a, -b..b with corners of radius r, from the middle of its lower side, mm."""
    def normal(x: float, y: float) -> F64 | None:
        return UP if floor else np.array([x, y, 0.0]) if wall else None

    s.go((0.0, -b, z), normal=normal(0, 1))
    s.go((a - r, -b, z), normal=normal(0, 1))
    s.arc((a, -b + r, z), (a - r, -b + r), False)
    s.go((a, 0.0, z), normal=normal(-1, 0))
    s.go((a, b - r, z), normal=normal(-1, 0))
    s.arc((a - r, b, z), (a - r, b - r), False)
    s.go((0.0, b, z), normal=normal(0, -1))
    s.go((-a + r, b, z), normal=normal(0, -1))
    s.arc((-a, b - r, z), (-a + r, b - r), False)
    s.go((-a, 0.0, z), normal=normal(1, 0))
    s.go((-a, -b + r, z), normal=normal(1, 0))
    s.arc((-a + r, -b, z), (-a + r, -b + r), False)
    s.go((0.0, -b, z), normal=normal(0, 1))


def pocket(seed: int) -> Case:
    """A pocket of rounded corners: layers entered by ramps, rings with arcs, walls from inside with arcs in and out."""
    rng = np.random.default_rng(seed)
    hw, hl, r, floor = (round(float(rng.uniform(*u)), 3) for u in ((9, 11), (6.5, 8), (3.6, 4.6), (-6, -4)))
    top, bx, by = 0.6, hw + 5.0, hl + 5.0
    tools = (ToolBody("T1", 1, 6.0, 0.0, 9.0, 5.6, 16.0, 6.0, 30.0, HOLDER),
             ToolBody("T2", 2, 4.0, 0.0, 3.5, 3.7, 12.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.UPRIGHT, 25.0)
    s.begin()
    s.change(1, 0.0, 0.0, 900)
    s.go((-(hw - 3.5), 0.0, 25.0), rapid=True)
    s.go((-(hw - 3.5), 0.0, top + 1.2), rapid=True)
    s.go((-(hw - 3.5), 0.0, top))
    _rough_pocket(s, (hw - 3.3, hl - 3.3), r - 3.3, (top, floor + 0.2))
    s.lift()
    s.change(2, 0.0, 0.0, 700)
    s.go((0.0, 0.0, floor + 0.8), rapid=True)
    s.go((0.0, 0.0, floor))
    for o in np.linspace(hl - 2.8, 0.0, math.ceil((hl - 2.8) / 2.4) + 1)[:-1].tolist():
        s.zone("Z1")
        _ring(s, hw - 2.0 - o, hl - 2.0 - o, max(r - 2.0 - o, 0.2), floor, False, floor=True)
        s.zone(None)
        s.go((0.0, 0.0, floor))
    deep = top - floor
    levels = [top - deep * k / math.ceil(deep / 3.2) for k in range(1, math.ceil(deep / 3.2) + 1)]
    for z in levels:
        b = hl - 2.0
        s.go((0.0, 0.0, z))
        s.zone("Z2")
        s.go((-1.5, -b + 1.5, z))
        s.arc((0.0, -b, z), (0.0, -b + 1.5), False)
        _ring(s, hw - 2.0, b, r - 2.0, z, True)
        s.arc((1.5, -b + 1.5, z), (0.0, -b + 1.5), False)
        s.zone(None)
        s.go((0.0, 0.0, z))
    s.lift()
    clamps = [[[-bx - 6, -3, floor - 4], [-bx + 2, 3, 4]], [[bx - 2, -3, floor - 4], [bx + 6, 3, 4]]]
    setup = setup_of(np.array([[-bx, -by, floor - 4], [bx, by, top]]), clamps)
    solid = Pocket((bx, by), floor - 4.0, (hw, hl), r, floor)
    across = np.array([[-bx + 3.0, -by - 8.0], [bx - 3.0, by + 8.0]]) * [0.3, 1.0]
    every = (-np.inf, np.inf)
    return made("pocket", s, solid, tools, setup, [7, 8], {"Z1": (8, (0.01, np.inf)), "Z2": (7, every)},
                (0.5, -0.5, top, 3.0), across, top, seed)


def _rough_pocket(s: Script, half: tuple[float, float], r: float, span: tuple[float, float]) -> None:
    """Layers of at most 0.9 mm, each down a ramp to and fro and then in rings from inside."""
    (a, b), (top, bottom), reach = half, span, half[0] - 0.3
    count = math.ceil((top - bottom) / 0.9)
    legs = math.ceil((top - bottom) / count / (2 * reach * RAMP))
    legs += legs % 2
    z = top
    for _ in range(count):
        drop = (top - bottom) / count / legs
        for leg in range(legs):
            z -= drop
            s.go((reach if leg % 2 == 0 else -reach, 0.0, z))
        s.go((reach, 0.0, z))
        for o in np.arange(0.0, b - 0.4, 4.0)[::-1].tolist():
            _ring(s, a - o, b - o, max(r - o, 0.3), z, False)
        s.go((-reach, 0.0, z))


def wave(seed: int) -> Case:
    """A wave of two arcs under a wall: rows along Y in layers, then a ball to and fro along the wave."""
    rng = np.random.default_rng(seed)
    r1, r2, h, ht, hy = (round(float(rng.uniform(*u)), 3) for u in ((11, 14), (9, 12), (0.9, 1.3), (5, 6.5), (4, 5)))
    xa, r = 4.0, 2.5
    both, zc = r1 + r2, r2 - h
    bend = math.acos((both - h) / both)
    xb = xa + both * math.sin(bend)
    xw = round(xb + 4.0, 3)
    foot = zc - math.sqrt(r2**2 - (xw - xb) ** 2)
    joint = (xa + r1 * math.sin(bend), -r1 + r1 * math.cos(bend))
    left = -r1 + math.sqrt(r1**2 - xa**2)
    low, end, top = -h - 5.0, xw + 4.0, ht + 0.5
    pieces = chain((0.0, low, 1), (end, low, 2), (end, ht, 3), (xw, ht, 4), (xw, foot, 0)) + (
        Piece((xw, foot), joint, 5, (xb, zc), -r2), Piece(joint, (0.0, left), 5, (xa, -r1), r1),
        Piece((0.0, left), (0.0, low), 6))
    solid = Pulled(Profile(pieces), hy)
    tools = (ToolBody("T1", 1, 4.0, 0.0, 9.0, 3.7, 16.0, 6.0, 30.0, HOLDER),
             ToolBody("T2", 2, 2 * r, r, 4.0, 4.6, 12.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.UPRIGHT, 25.0)
    s.begin()
    s.change(1, 1.0, -hy - 6.0, 900)
    _rough_wave(s, solid, (end, ht, xw, hy), -h)
    s.lift()
    over = np.linspace(-math.asin((xa + 0.3) / r1), bend, math.ceil((bend + 0.5) * (r1 + r) / 0.35))
    last = math.asin((xw - r - 0.05 - xb) / (r2 - r))
    under = np.linspace(-bend, last, math.ceil((last + bend) * (r2 - r) / 0.3))[1:]
    x = np.concatenate([xa + (r1 + r) * np.sin(over), xb + (r2 - r) * np.sin(under)])
    z = np.concatenate([-r1 + (r1 + r) * np.cos(over), zc - (r2 - r) * np.cos(under)]) - r
    normals = np.column_stack([np.concatenate([np.sin(over), -np.sin(under)]), np.zeros(len(x)),
                               np.concatenate([np.cos(over), np.cos(under)])])
    rows = np.linspace(-hy, hy, 2 * math.ceil(hy / 0.29))
    s.change(2, float(x[0]), float(rows[0]), 1500)
    s.go((x[0], rows[0], z[0] + 6.0), rapid=True)
    s.go((x[0], rows[0], z[0]))
    _to_and_fro(s, np.column_stack([x, z]), normals, rows)
    s.lift()
    clamps = [[[-14, -3, low], [-8, 3, 3]], [[end + 4, -3, low], [end + 10, 3, 3]]]
    setup = setup_of(np.array([[0, -hy, low], [end, hy, top]]), clamps)
    across = np.array([[5.0, -hy - 8.0], [9.0, hy + 8.0]])
    zone_of = {"Z1": (5, (-1.0, xb + r2 * math.sin(last) - 0.05)), "Z2": (4, (foot + 2.0, np.inf)),
               "Z3": (3, (-np.inf, np.inf))}
    return made("wave", s, solid, tools, setup, [3, 4, 5], zone_of, (6.0, 0.5, top, 3.0), across, top, seed)


def _to_and_fro(s: Script, path: F64, normals: F64, rows: F64) -> None:
    """Rows at y along ``path`` (n, 2) x and z mm, two to a pass; a half turn to the inner side between the two."""
    for a, b in zip(rows[::2].tolist(), rows[1::2].tolist(), strict=True):
        s.zone("Z1")
        for (x, z), n in zip(path.tolist(), normals, strict=True):
            s.go((x, a, z), normal=n)
        s.arc((path[-1, 0], b, path[-1, 1]), (path[-1, 0], 0.5 * (a + b)), True)
        for (x, z), n in zip(path[-2::-1].tolist(), normals[-2::-1], strict=True):
            s.go((x, b, z), normal=n)
        s.zone(None)


def _rough_wave(s: Script, solid: Pulled, size: tuple[float, float, float, float], bottom: float) -> None:
    """Rows along Y, layer by layer, wherever the end of the tool stays 0.15 mm over the wave; faces ridge and wall."""
    end, ht, xw, hy = size
    out = hy + 5.0
    x = np.arange(-1.9, xw - 2.0, 0.05)
    line, _ = solid.profile.line()
    order = np.argsort(line[:, 0], kind="stable")
    wave_line = line[order][(line[order, 1] > bottom - 0.01) & (line[order, 0] < xw)]
    tops = np.interp(np.arange(-3.9, xw, 0.05), wave_line[:, 0], wave_line[:, 1])
    need = np.array([tops[k:k + 81].max() for k in range(len(x))]) + 0.15
    side = -1.0
    s.go((1.0, -out, ht), rapid=True)
    for row in np.linspace(1.0, end - 1.0, math.ceil((end - 2.0) / 3.2) + 1).tolist():
        s.zone("Z3")
        s.go((row, side * out, ht))
        side = -side
        s.go((row, 0.0, ht), normal=UP)
        s.go((row, side * out, ht))
    s.zone(None)
    steps = np.concatenate([np.linspace(ht, 0.6, math.ceil((ht - 0.6) / 1.1) + 1)[1:], np.arange(0.35, bottom, -0.14)])
    for z in steps.tolist():
        free = np.append(need <= z, False)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], free]).astype(int)))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            low, high = float(x[a]), xw - 2.0 if b == len(x) else float(x[b - 1])
            for row in np.linspace(low, high, max(2, math.ceil((high - low) / 3.2) + 1)).tolist():
                s.zone("Z2" if row == xw - 2.0 else None)
                s.go((row, side * out, z))
                side = -side
                s.go((row, 0.0, z), normal=np.array([-1.0, 0, 0]) if row == xw - 2.0 else None)
                s.go((row, side * out, z))
    s.zone(None)


def walls(seed: int) -> Case:
    """Two thin walls on a plate: rows beside them in layers, then round each wall at every level, arcs at its ends."""
    rng = np.random.default_rng(seed)
    t1, t2, gap, ht, hy = (round(float(rng.uniform(*u)), 3) for u in ((1, 1.6), (1, 1.6), (6, 8), (5.5, 7.5), (6, 8)))
    x1 = 7.0
    x2, x3 = x1 + t1, x1 + t1 + gap
    x4 = x3 + t2
    end, low, top = x4 + 7.0, -4.0, ht + 0.5
    pieces = chain((0.0, low, 1), (end, low, 2), (end, 0.0, 3), (x4, 0.0, 4), (x4, ht, 5), (x3, ht, 4), (x3, 0.0, 3),
                   (x2, 0.0, 6), (x2, ht, 5), (x1, ht, 6), (x1, 0.0, 3), (0.0, 0.0, 7), (0.0, low, 0))
    solid = Pulled(Profile(pieces), hy)
    tools = (ToolBody("T1", 1, 4.0, 0.0, 9.0, 3.7, 14.0, 6.0, 30.0, HOLDER),
             ToolBody("T2", 2, 3.0, 0.0, 3.0, 2.6, 9.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.UPRIGHT, 28.0)
    s.begin()
    s.change(1, 1.0, -hy - 6.0, 900)
    out = hy + 4.0
    s.go((1.0, -out, top + 2.0), rapid=True)
    _pairs(s, [(1.0, end - 1.0)], 3.6, out, ht, "Z1")
    between = [(1.5, x1 - 2.25), (x2 + 2.25, x3 - 2.25), (x4 + 2.25, end - 1.5)]
    for z in np.linspace(ht, 0.2, math.ceil(ht / 1.3) + 1)[1:].tolist():
        _pairs(s, between, 3.6, out, z, None)
    s.lift()
    s.change(2, 1.0, -hy - 6.0, 700)
    s.go((1.0, -out, top + 2.0), rapid=True)
    _pairs(s, [(1.2, x1 - 1.6), (x2 + 1.6, x3 - 1.6), (x4 + 1.6, end - 1.2)], 2.6, out, 0.0, "Z2")
    for z in np.linspace(ht, 0.0, math.ceil(ht / 2.7) + 1)[1:].tolist():
        for name, a, b in (("Z3", x1, x2), ("Z4", x3, x4)):
            s.go((a - 1.5, -out, s.steps[-1].tip[2]))
            s.go((a - 1.5, -out, z))
            s.zone(name)
            _round_wall(s, a, b, hy, out, z)
            s.zone(None)
    s.lift()
    clamps = [[[-11, -3, low], [-5, 3, 3]], [[end + 5, -3, low], [end + 11, 3, 3]]]
    setup = setup_of(np.array([[0, -hy, low], [end, hy, top]]), clamps)
    across = np.array([[4.0, -hy - 8.0], [end - 5.0, hy + 8.0]])
    every = (-np.inf, np.inf)
    zone_of = {"Z1": (5, every), "Z2": (3, every), "Z3": (6, every), "Z4": (4, every)}
    return made("walls", s, solid, tools, setup, [3, 4, 5, 6], zone_of, (0.5 * (x2 + x3), 0.5, top, 3.0), across, top,
                seed)


def _pairs(s: Script, spans: list[tuple[float, float]], wide: float, out: float, z: float, zone: str | None) -> None:
    """Rows along Y over spans of x, mm, at most ``wide`` apart, two to a pass: there on the one, back on the other."""
    for a, b in spans:
        rows = np.linspace(a, b, 2 * max(1, math.ceil((math.ceil((b - a) / wide) + 1) / 2))).tolist()
        for there, back in zip(rows[::2], rows[1::2], strict=True):
            s.go((there, -out, z))
            s.zone(zone)
            s.go((there, 0.0, z), normal=UP)
            s.go((there, out, z))
            s.go((back, out, z))
            s.go((back, 0.0, z), normal=UP)
            s.go((back, -out, z))
            s.zone(None)


def _round_wall(s: Script, a: float, b: float, hy: float, out: float, z: float) -> None:
    """Along one side of a wall a..b, round its end, back along the other, and out; a tool of 3 mm."""
    r, left, right = 1.5, np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    s.go((a - r, 0.1 * hy, z), normal=left)
    s.go((a - r, hy, z))
    s.arc((a, hy + r, z), (a, hy), True)
    s.go((b, hy + r, z))
    s.arc((b + r, hy, z), (b, hy), True)
    s.go((b + r, -0.1 * hy, z), normal=right)
    s.go((b + r, -out, z))
