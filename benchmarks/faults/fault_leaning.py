"""Three parts of the fault table for tools that lean: a dome, the frustum of a cone, a house of tilted planes.

The dome is finished by a ball whose axis leans along the normal and forward, tool centre point control on, A and C
always moving; the cone by the flank of a flat end in joints with pivots off its axis, C turning; the house plane by
plane, 3 + 2. The first tool stands along Z and leaves rings.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from benchmarks.faults.fault_case import PIVOTS, Case, Mode, Script, angles
from benchmarks.faults.fault_parts import HOLDER, UP, made, setup_of
from benchmarks.faults.fault_solids import House, Piece, Profile, Turned, chain
from geometry.tool_body import ToolBody
from verify.kinematics import Kinematics
from verify.model import ProofSetup, StockKind

ROUGH = ToolBody("T1", 1, 6.0, 0.0, 9.0, 5.6, 18.0, 6.0, 30.0, HOLDER)
MACHINE = Kinematics("table-table-AC", PIVOTS)
Turn = tuple[float, float]


def _setup(radius: float, low: float, top: float, clamps: list[list[list[float]]]) -> ProofSetup:
    """A cylinder blank between clamps."""
    return setup_of(np.array([[-radius, -radius, low], [radius, radius, top]]), clamps, kinematics=MACHINE,
                    stock_kind=StockKind.CYLINDER, stock_cylinder=(0.0, 0.0, low, radius, top - low))


def _beside(far: float, low: float) -> list[list[list[float]]]:
    """Two clamps beyond ``far`` mm either way along X."""
    return [[[-far - 6, -3, low], [-far, 3, 2]], [[far, -3, low], [far + 6, 3, 2]]]


def _rings(s: Script, outer: float, layers: list[float], inner: Callable[[float], float],
           zones: dict[float, str]) -> None:
    """Layers of circles from outside the blank (radius ``outer`` mm) in to ``inner`` of the height."""
    start = outer + 4.5
    s.go((start, 0.0, s.safe), rapid=True)
    for z in layers:
        s.go((start, 0.0, z), rapid=True)
        least = inner(z)
        for r in np.linspace(outer + 1.0, least, max(2, math.ceil((outer + 1.0 - least) / 4.4) + 1)).tolist():
            s.zone(zones.get(z))
            s.go((r, 0.0, z), normal=UP if z in zones and r < outer - 1.5 else None)
            s.arc((-r, 0.0, z), (0.0, 0.0), True)
            s.arc((r, 0.0, z), (0.0, 0.0), True)
        s.zone(None)
        s.lift()
        s.go((start, 0.0, s.safe), rapid=True)


def dome(seed: int) -> Case:
    """A spherical dome on a round plate."""
    rng = np.random.default_rng(seed)
    big, most, lead = (round(float(rng.uniform(*u)), 3) for u in ((7, 8.5), (40, 45), (14, 19)))
    low_angle, lean, r = math.radians(most), math.radians(lead), 3.0
    zc, base, apex = -big * math.cos(low_angle), big * math.sin(low_angle), big - big * math.cos(low_angle)
    plate, low, top = round(base + 3.5, 3), -4.0, round(apex + 0.5, 3)
    pieces = (*chain((0.0, low, 1), (plate, low, 2), (plate, 0.0, 3), (base, 0.0, 0)),
              Piece((base, 0.0), (0.0, apex), 5, (0.0, zc), big))
    solid = Turned(Profile(pieces))
    tools = (ROUGH, ToolBody("T2", 2, 2 * r, r, 4.0, 5.6, 14.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.CENTRE, 40.0)
    s.begin()
    s.change(1, plate + 4.8, 0.0, 900)
    count = math.ceil(top / 0.3)
    layers = [top - top * k / count for k in range(1, count + 1)]
    layers[-1] = 0.0

    def inner(z: float) -> float:
        return 1.5 if z >= apex + 0.1 else math.sqrt(max(big**2 - (z - zc) ** 2, 0.0)) + 3.2

    _rings(s, plate + 0.3, layers, inner, {0.0: "Z1"})
    end = math.acos((r + 0.05 - zc) / (big + r))
    s.change(2, 0.0, 0.0, 1200)
    count = math.ceil(end * big / math.sqrt(8 * 0.0045 / (1 / r + 1 / big)))
    _dome_rings(s, big, zc, r, lean, [end * (1 - k / count) for k in range(count + 1)])
    setup = _setup(plate + 0.3, low, top, _beside(24.0, low))
    x = plate - 3.0
    zone_of = {"Z1": (3, (base + 0.22, plate)), "Z2": (5, (zc + big * math.cos(end) + 0.02, np.inf))}
    return made("dome", s, solid, tools, setup, [3, 5], zone_of, (x, 0.0, top, 1.6),
                np.array([[x, -plate - 8.0], [x, plate + 8.0]]), top, seed)


def _dome_rings(s: Script, big: float, zc: float, r: float, lean: float, rows: list[float]) -> None:
    """Circles of a ball round a dome from below to the pole, two to a pass; the axis leans by ``lean`` rad forward."""
    turn: Turn = (0.0, 0.0)
    first = True
    for k, tilt in enumerate(rows):
        if k % 2 == 0:
            s.zone(None)
            s.zone("Z2")
        step = math.sqrt(8 * 0.0014 / max((big + r) * math.sin(tilt) ** 2, 0.08))
        for a in np.linspace(0.0, math.tau, math.ceil(math.tau / step) + 1).tolist():
            n = np.array([math.sin(tilt) * math.cos(a), math.sin(tilt) * math.sin(a), math.cos(tilt)])
            axis = math.cos(lean) * n + math.sin(lean) * np.array([-math.sin(a), math.cos(a), 0.0])
            wanted = angles(axis)
            turn = (wanted[0], wanted[1] + 360.0 * round((turn[1] - wanted[1]) / 360.0))
            tip = np.array([0.0, 0.0, zc]) + (big + r) * n - r * axis
            if first:
                s.go((0.0, 0.0, s.safe), turn, rapid=True)
                s.go(tip + 6.0 * axis, turn, rapid=True)
                first = False
            s.go(tip, turn, n)
    s.zone(None)
    s.go(s.steps[-1].tip + 15.0 * axis, turn, rapid=True)
    s.go((0.0, 0.0, s.safe), turn, rapid=True)
    s.go((0.0, 0.0, s.safe), (0.0, turn[1]), rapid=True)


def cone(seed: int) -> Case:
    """The frustum of a cone on a round plate, its flank at two heights."""
    rng = np.random.default_rng(seed)
    rho0, slope, high = (round(float(rng.uniform(*u)), 3) for u in ((6, 7.5), (11, 19), (6, 7.5)))
    alpha, r = math.radians(slope), 3.0
    rho1 = rho0 - high * math.tan(alpha)
    plate, low, top = round(rho0 + 3.5, 3), -4.0, high + 0.5
    solid = Turned(Profile(chain((0.0, low, 1), (plate, low, 2), (plate, 0.0, 3), (rho0, 0.0, 5), (rho1, high, 4),
                                 (0.0, high, 0))))
    flute = 0.5 * high / math.cos(alpha) + 0.6
    tools = (ROUGH, ToolBody("T2", 2, 2 * r, 0.0, flute, 5.6, 16.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.JOINTS, 40.0)
    s.begin()
    s.change(1, plate + 4.8, 0.0, 900)
    count = math.ceil(high / 0.9)
    layers = [high, *(high - high * k / count for k in range(1, count)), 0.0]

    def inner(z: float) -> float:
        return 1.5 if z >= high else rho0 - z * math.tan(alpha) + 3.3

    _rings(s, plate + 0.3, layers, inner, {high: "Z1", 0.0: "Z2"})
    s.change(2, 0.0, 0.0, 900)
    for k, z in enumerate((0.5 * high, 0.05)):
        _flank(s, rho0 - z * math.tan(alpha), z, alpha, r, k)
    setup = _setup(plate + 0.3, low, top, _beside(24.0, low))
    x = plate - 3.0
    zone_of = {"Z1": (4, (-np.inf, np.inf)), "Z2": (3, (rho0 + 0.32, plate)), "Z3": (5, (0.06, np.inf))}
    return made("cone", s, solid, tools, setup, [3, 4, 5], zone_of, (x, 0.0, top, 3.0),
                np.array([[x, -plate - 8.0], [x, plate + 8.0]]), top, seed)


def _flank(s: Script, rho: float, z: float, alpha: float, r: float, back: int) -> None:
    """Once round the cone with the flank on its rulings, the tip's near edge at (rho, z) mm; turning back where odd."""
    turns = np.linspace(0.0, math.tau, 97)
    for k, a in enumerate((turns[::-1] if back else turns).tolist()):
        out = np.array([math.cos(a), math.sin(a), 0.0])
        n = math.cos(alpha) * out + math.sin(alpha) * UP
        axis = -math.sin(alpha) * out + math.cos(alpha) * UP
        turn = (math.degrees(alpha), -90.0 - math.degrees(a))  # C = atan2(-cos a, -sin a), carried on
        tip = rho * out + z * UP + r * n
        if k == 0:
            s.go(tip + 4.0 * n + 25.0 * axis, turn, rapid=True)
            s.go(tip + 4.0 * n + 3.0 * axis, turn, rapid=True)
            s.go(tip + 4.0 * n, turn)
            s.zone("Z3")
        s.go(tip, turn, n)
    s.go(tip + 4.0 * n, turn)
    s.zone(None)
    s.go(tip + 4.0 * n + 25.0 * axis, turn, rapid=True)


def house(seed: int) -> Case:
    """Four to six tilted planes under a flat ridge on a round plate."""
    rng = np.random.default_rng(seed)
    k, high = int(rng.integers(4, 7)), round(float(rng.uniform(4, 5)), 3)
    around = math.tau * (np.arange(k) + rng.uniform(-0.08, 0.08, k)) / k
    tilt, apothem = np.radians(rng.uniform(48, 56, k)), rng.uniform(6.3, 7.2, k)
    planes = np.column_stack([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt),
                              apothem * np.sin(tilt)])
    widest = float(np.linalg.norm(House(planes, high, -4.0, 0.0).corners(0.0), axis=1).max())
    plate, low, top = round(widest + 3.2, 3), -4.0, high + 0.5
    solid = House(planes, high, low, plate)
    corner = 0.5 if rng.random() < 0.5 else 0.0
    tools = (ROUGH, ToolBody("T2", 2, 4.0, corner, 6.0, 3.7, 14.0, 6.0, 28.0, HOLDER))
    s = Script(Mode.CENTRE, 45.0)
    s.begin()
    s.change(1, plate + 4.8, 0.0, 900)
    count = math.ceil(high / 0.9)
    layers = [high, *(high - high * j / count for j in range(1, count)), 0.0]

    def inner(z: float) -> float:
        return 1.5 if z >= high else float(np.linalg.norm(solid.corners(z), axis=1).max()) + 3.2

    _rings(s, plate + 0.3, layers, inner, {high: "Z1", 0.0: "Z2"})
    s.change(2, 0.0, 0.0, 900)
    for i in range(k):
        _tilted_plane(s, solid, i, corner, f"Z{3 + i}")
    near = plate + 5.5  # the rings come in along X, so clamps may stand close along Y
    setup = _setup(plate + 0.3, low, top, [[[-8, -near - 6, low], [8, -near, 4]], [[-8, near, low], [8, near + 6, 4]]])
    x = plate - 2.5
    zone_of: dict[str, tuple[int, tuple[float, float]]] = {"Z1": (4, (-np.inf, np.inf)),
                                                           "Z2": (3, (widest + 0.25, plate))}
    for i in range(k):
        zone_of[f"Z{3 + i}"] = (10 + i, ((0.35 + corner) * float(np.sin(tilt[i])), np.inf))
    return made("house", s, solid, tools, setup, [3, 4, *range(10, 10 + k)], zone_of, (x, 0.0, top, 3.0),
                np.array([[x, -plate - 8.0], [x, plate + 8.0]]), top, seed)


def _tilted_plane(s: Script, solid: House, i: int, corner: float, zone: str) -> None:
    """Level rows of a mill of 4 mm that stands square on plane i, from below to above its upper edge."""
    n, r = solid.planes[i, :3], 2.0
    flat = math.hypot(n[0], n[1])
    along = np.array([-n[1], n[0], 0.0]) / flat
    up = np.cross(n, along)
    foot = np.array([n[0], n[1], 0.0]) * solid.planes[i, 3] / flat**2
    slant = solid.ridge / flat
    corners = solid.corners(0.0)[[i - 1, i]] @ along[:2]
    wide = float(np.abs(corners).max()) + r + 1.5
    rows = np.linspace(r + 0.3, slant - 0.6 * (r - corner), max(2, math.ceil((slant - 3.0) / (1.7 * (r - corner))) + 1))
    turn = angles(n)
    s.go((0.0, 0.0, s.safe), turn, rapid=True)
    side = -1.0
    for k, w in enumerate(rows.tolist()):
        start = foot + side * wide * along + w * up
        if k == 0:
            s.go(start + 20.0 * n, turn, rapid=True)
            s.go(start + 2.0 * n, turn, rapid=True)
        s.go(start, turn)
        s.zone(zone)
        for u in (0.35, 0.0, -0.35):
            s.go(foot + side * u * wide * along + w * up, turn, n)
        s.go(foot - side * wide * along + w * up, turn)
        s.zone(None)
        side = -side
    s.go(s.steps[-1].tip + 20.0 * n, turn, rapid=True)
    s.go((0.0, 0.0, s.safe), turn, rapid=True)
