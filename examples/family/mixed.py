"""The scored recipe: 2 to 12 free walls of all profile types, side by side or around a hub, with 0 to 16 connections.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from shapely.geometry import Polygon
from shapely.ops import unary_union

from examples.family.freewall import FreeWall
from examples.family.gaps import Gap
from examples.family.joins import draw_joins, takes_fillets
from examples.family.layout import HubDisc, LayoutError, PartLayout, Plate, WindowSpec, check
from examples.family.profiles import CLOSED_TYPES, OPEN_TYPES, DrawnProfile, clear, draw_closed, draw_hairpin, draw_open
from examples.family.walls import LEFT, RIGHT

KINDS = ("round_bar", "bar", "web", "arch", "bow", "fork")
CHORD: dict[str | None, tuple[float, float]] = {
    None: (24, 50), "C1": (24, 50), "C4": (24, 50), "C2": (32, 55), "C3": (45, 65), "C9": (44, 62), "C7": (50, 68),
    "C8": (50, 68), "C10": (60, 78),
}
"""Length of a profile, mm, so that its bends are much wider than the thickness of the wall."""


@dataclass(frozen=True, eq=False)
class Unit:
    """Walls that take one lane of a plate, or the share of one lane.

    walls : FreeWall, in plan around the origin
    meets : pairs of places in ``walls`` that meet on purpose
    """

    walls: tuple[FreeWall, ...]
    meets: tuple[tuple[int, int], ...] = ()
    features: tuple[str, ...] = ()


@dataclass(frozen=True)
class Style:
    """Properties that all walls of a part share: floor height and wall height, mm."""

    z: float
    height: float


def mixed(
    rng: Generator, walls: int | None = None, connections: int | None = None, gap: tuple[float, float] = (0.3, 12.0),
    arrangement: str | None = None,
) -> PartLayout:
    """A random part with all features of the family.

    walls       : 2 to 12; drawn when None
    connections : 0 to 16; drawn when None (fewer where there is no room)
    gap         : mm, range of the least distance between lanes
    arrangement : 'linear' or 'radial'; drawn when None

    Raises
    ------
    LayoutError
        The draw breaks a rule of the family.
    """
    count = walls if walls is not None else int(rng.integers(2, 13))
    wanted = connections if connections is not None else int(rng.integers(0, 17))
    if not 2 <= count <= 12 or not 0 <= wanted <= 16:
        raise LayoutError("the family has 2 to 12 walls and 0 to 16 connections")
    kind = arrangement if arrangement is not None else ("linear" if rng.random() < 0.65 else "radial")
    style = Style(float(np.round(rng.uniform(3.0, 6.0), 1)), float(rng.uniform(8.0, 17.0)))
    layout = _linear(rng, count, gap, style) if kind == "linear" else _radial(rng, count, style)
    hub = layout.base if isinstance(layout.base, HubDisc) else None
    if hub is not None and not all(_shows(hub, w) for w in layout.walls if isinstance(w, FreeWall)):
        raise LayoutError("a profile came out near the border of its type")
    layout = _rounded_feet(rng, layout)
    check(layout)
    gaps = layout.gaps(n_u=121, n_v=3, exact=False)
    drawn = draw_joins(rng, layout.base, layout.walls, gaps, wanted, KINDS)
    layout = replace(layout, connections=drawn)
    layout = _windows(rng, layout, gaps) if rng.random() < 0.15 else layout
    rounded = round(float(rng.uniform(0.25, 0.4)), 2) if rng.random() < 0.4 else 0.0
    return replace(layout, rounded=rounded) if any(takes_fillets(c) for c in drawn) else layout


def mixed_linear(
    rng: Generator, walls: int | None = None, connections: int | None = None, gap: tuple[float, float] = (0.3, 12.0)
) -> PartLayout:
    """``mixed`` with its walls side by side on a plate."""
    return mixed(rng, walls, connections, gap, "linear")


def mixed_radial(rng: Generator, walls: int | None = None, connections: int | None = None) -> PartLayout:
    """``mixed`` with blades, and splitters between them, round a hub; at least three."""
    return mixed(rng, walls, connections, arrangement="radial")


def _shows(hub: HubDisc | None, wall: FreeWall) -> bool:
    """Whether both sides show their type at the heights of the sections, outside a hub."""
    for side, label in zip((LEFT, RIGHT), wall.profile.labels, strict=True):
        for v in (0.35, 0.5, 0.65):
            curve = wall.side_curve(side, v)
            if hub is not None:
                curve = curve[np.hypot(*curve.T) > max(hub.hub_radius)]
            if not clear(label, curve, wall.closed):
                return False
    return True


def _wall(rng: Generator, style: Style, profile: DrawnProfile, thickest: float, kind: str = "curved") -> FreeWall:
    """A wall of a profile with drawn height, thickness, taper, lean and twist, its faces whole, in strips or merged.

    Raises LayoutError where no draw kept both sides clear of the borders of their types.
    """
    for _ in range(8):
        wall = _draw_wall(rng, style, profile, thickest, kind)
        if all(wall.section(z).is_valid for z in (wall.z_floor, wall.z_top)) and _shows(None, wall):
            return wall
    raise LayoutError("a profile came out near the border of its type")


def _draw_wall(rng: Generator, style: Style, profile: DrawnProfile, thickest: float, kind: str) -> FreeWall:
    height = style.height * float(rng.uniform(0.85, 1.15))
    foot = float(rng.uniform(1.2, min(thickest, 0.3 * height)))
    top = foot * (float(rng.uniform(0.75, 0.95)) if rng.random() < 0.5 else 1.0)
    form, lean = rng.random(), rng.uniform(-0.14, 0.14, 2)
    if form < 0.4 or kind == "closed":
        lean = np.zeros(2) if form < 0.3 or kind != "closed" else np.full(2, 0.5 * lean[0])
    elif form < 0.7:
        lean[1] = lean[0]
    faces = rng.random()
    bent = profile.type is not None and not profile.closed
    strips = int(rng.integers(3, 9)) if bent and faces < 0.12 else 1
    if profile.closed:
        strips = 1 if faces < 0.15 else 2 if faces < 0.75 else 4
    return FreeWall(kind, profile.control, style.z, height, (foot, top), (float(lean[0]), float(lean[1])),
                    profile=profile, strips=strips, merged=bool(bent and faces > 0.95))


def _thickest(kind: str | None) -> float:
    return {"C10": 1.8, "C7": 1.9, "C8": 1.9, "C3": 2.0, "C9": 2.2}.get(str(kind), 3.0)


def _open_wall(rng: Generator, style: Style, kind: str | None, chord: float | None = None) -> FreeWall:
    length = chord if chord is not None else float(rng.uniform(*CHORD[kind]))
    profile = draw_open(rng, kind, length).at((0.0, 0.0), np.pi * float(rng.integers(2)))
    return _wall(rng, style, profile, _thickest(kind))


def _one(rng: Generator, style: Style) -> Unit:
    return Unit((_open_wall(rng, style, OPEN_TYPES[int(rng.integers(len(OPEN_TYPES)))]),))


def _end_to_end(rng: Generator, style: Style) -> Unit:
    first, second = (_open_wall(rng, style, (None, "C1", "C4")[int(rng.integers(3))], float(rng.uniform(18, 26)))
                     for _ in range(2))
    shift = first.bounds[2] - second.bounds[0] + float(rng.uniform(1.5, 4.0))
    return Unit((first, second.moved(shift, 0.0)), features=("end_to_end",))


def _closed_wall(rng: Generator, style: Style, kind: str, radius: float) -> FreeWall:
    return _wall(rng, style, draw_closed(rng, kind, radius), 2.2, "closed")


def _closed_type(rng: Generator) -> str:
    return CLOSED_TYPES[int(rng.integers(len(CLOSED_TYPES)))]


def _radius(rng: Generator, kind: str) -> float:
    return float(rng.uniform(*{"C5": (16.0, 22.0), "C6": (11.0, 15.0), "oval": (8.0, 16.0)}[kind]))


def _ring(rng: Generator, style: Style) -> Unit:
    kind = _closed_type(rng)
    return Unit((_closed_wall(rng, style, kind, _radius(rng, kind)),), features=("closed",))


def _nested(rng: Generator, style: Style) -> Unit:
    """A ring inside a ring, at a drawn least distance; the inner one is convex unless both are alike."""
    kind = _closed_type(rng)
    outer = _closed_wall(rng, style, kind, 1.25 * _radius(rng, kind))
    room = float(rng.uniform(1.5, 6.0))
    hollow = Polygon(outer.side_curve(LEFT, 1.0)).buffer(-room)
    if hollow.is_empty or hollow.geom_type != "Polygon":
        raise LayoutError("no room for a ring in the ring")
    centre = hollow.centroid if hollow.contains(hollow.centroid) else hollow.representative_point()
    draw = draw_closed(rng, "oval", 1.0)
    for radius in np.linspace(14.0, 4.0, 41):
        profile = DrawnProfile("oval", draw.control * radius, True).at((centre.x, centre.y))
        inner = _wall(np.random.default_rng(int(1e6 * room)), style, profile, 2.0, "closed")
        if hollow.contains(inner.section(style.z)) and hollow.contains(inner.section(inner.z_top)):
            return Unit((outer, inner), features=("closed", "nested"))
    raise LayoutError("no room for a ring in the ring")


def _beside(rng: Generator, style: Style) -> Unit:
    kinds = [_closed_type(rng), "oval"]
    first, second = (_closed_wall(rng, style, k, 0.8 * _radius(rng, k)) for k in kinds)
    shift = _slide([first], [second], float(rng.uniform(1.0, 6.0)), (1.0, 0.0))
    return Unit((first, second.moved(shift, 0.0)), features=("closed", "side_by_side"))


def _u_wall(rng: Generator, style: Style) -> Unit:
    profile = draw_hairpin(rng, float(rng.uniform(9.0, 15.0))).at((0.0, 0.0), np.pi * float(rng.integers(2)))
    wall = _wall(rng, style, profile, 2.0)
    return Unit((replace(wall, lean=(wall.lean[0],) * 2),), features=("u_wall",))


def _tee(rng: Generator, style: Style, arms: int) -> Unit:
    """Two straight walls square to each other: a T (arms 1) or a cross (arms 2), equally high."""
    long, leg = float(rng.uniform(28, 48)), float(rng.uniform(8, 14))
    main = _straight(rng, style, (-0.5 * long, 0.0), (0.5 * long, 0.0))
    at = float(rng.uniform(-0.25, 0.25)) * long
    other = _straight(rng, style, (at, 0.0 if arms == 1 else -leg), (at, leg))
    return Unit((main, other), ((0, 1),), ("T",) if arms == 1 else ("cross",))


def _straight(rng: Generator, style: Style, a: tuple[float, float], b: tuple[float, float]) -> FreeWall:
    share = np.linspace(0.0, 1.0, 10)[:, None]
    profile = DrawnProfile(None, np.array(a) + (np.array(b) - np.array(a)) * share)
    foot = float(rng.uniform(1.4, 2.2))
    return FreeWall("straight", profile.control, style.z, style.height, (foot, foot), profile=profile)


def _slide(placed: list[FreeWall], arriving: list[FreeWall], gap: float, way: tuple[float, float]) -> float:
    """How far, mm, walls must move along ``way`` (unit) to stand ``gap`` mm from placed ones, coming from beyond."""
    z = placed[0].z_floor
    levels = [z + f * max(w.height for w in placed + arriving) for f in (0.0, 0.5, 1.0)]
    there = [unary_union([w.section(min(h, w.z_top)) for w in placed]) for h in levels]
    here = [unary_union([w.section(min(h, w.z_top)) for w in arriving]) for h in levels]
    k = int(abs(way[1]) > abs(way[0]))
    shift = max(t.bounds[2 + k] for t in there) - min(h.bounds[k] for h in here) + gap
    from shapely.affinity import translate

    for _ in range(60):
        near = min(t.distance(translate(h, shift * way[0], shift * way[1])) for t, h in zip(there, here, strict=True))
        shift -= near - gap
        if near - gap < 1e-4:
            break
    return float(shift)


def _linear(rng: Generator, count: int, gap: tuple[float, float], style: Style) -> PartLayout:
    """Lanes along x, stacked along y at drawn least distances."""
    units = _draw_units(rng, style, count)
    walls: list[FreeWall] = []
    meets: list[tuple[int, int]] = []
    features: list[str] = []
    for unit in units:
        arriving = [w.moved(float(rng.uniform(-4, 4)) if len(unit.walls) == 1 else 0.0, 0.0) for w in unit.walls]
        if walls:
            least = float(np.exp(rng.uniform(np.log(gap[0]), np.log(gap[1]))))
            dy = _slide(walls, arriving, least, (0.0, 1.0))
            arriving = [w.moved(0.0, dy) for w in arriving]
        meets += [(a + len(walls), b + len(walls)) for a, b in unit.meets]
        features += unit.features
        walls += arriving
    boxes = np.array([w.bounds for w in walls])
    low, high = boxes[:, :2].min(axis=0) - 3.5, boxes[:, 2:].max(axis=0) + 3.5
    x0, y0, x1, y1 = (float(round(c, 1)) for c in (*low, *high))
    return PartLayout("mixed", Plate((x0, y0, x1, y1), style.z), walls, least=0.9 * min(gap[0], 0.5),
                      meets=tuple(meets), features=("linear", *features))


def _draw_units(rng: Generator, style: Style, count: int) -> list[Unit]:
    units: list[Unit] = []
    while (left := count - sum(len(u.walls) for u in units)) > 0:
        pick = rng.random()
        try:
            if left >= 2 and pick < 0.08:
                units.append(_end_to_end(rng, style))
            elif left >= 2 and pick < 0.16:
                units.append(_nested(rng, style))
            elif left >= 2 and pick < 0.21:
                units.append(_beside(rng, style))
            elif left == 2 and pick < 0.4 or left > 2 and pick < 0.23:
                units.append(_tee(rng, style, 1 if left == 2 else 2))
            elif pick < 0.31:
                units.append(_ring(rng, style))
            elif pick < 0.37:
                units.append(_u_wall(rng, style))
            else:
                units.append(_one(rng, style))
        except LayoutError:
            continue
    return units


def _radial(rng: Generator, count: int, style: Style) -> PartLayout:
    """Blades round a hub, where the number is even often every second one a splitter; at least three of them."""
    count = max(count, 3)
    split = count % 2 == 0 and count >= 6 and rng.random() < 0.6
    bore = float(rng.uniform(8.0, 9.0) + 0.45 * max(count - 6, 0))
    radius = bore + float(rng.uniform(20, 27))
    disc = HubDisc(round(radius + 4.0, 1), style.z, (bore, bore - 1.0), style.height + 2.0)
    kinds = [_blade_type(rng), _blade_type(rng)]
    seeds = rng.integers(2**31, size=2)
    walls = []
    for k in range(count):
        short = split and k % 2 == 1
        own = np.random.default_rng(seeds[int(short)])
        inner = bore + 0.35 * (radius - bore) if short else bore - 2.5
        chord = radius - float(own.uniform(0, 2)) - inner
        profile = draw_open(own, kinds[int(short)], chord).at((inner + 0.5 * chord, 0.0))
        wall = _wall(own, style, profile, min(2.2, _thickest(kinds[int(short)])), "splitter" if short else "blade")
        wall = replace(wall, height=min(wall.height, style.height * 1.1), strips=1)
        walls.append(replace(wall, profile=profile.at((0.0, 0.0), 2 * np.pi * k / count)))
    return PartLayout("mixed", disc, walls, least=0.3, features=("radial", *(("splitters",) if split else ())))


def _blade_type(rng: Generator) -> str | None:
    return (None, "C1", "C4", "C2")[int(rng.integers(4))]


def _rounded_feet(rng: Generator, layout: PartLayout) -> PartLayout:
    """Fillets at the feet of some layouts whose walls stand apart and meet nothing."""
    if rng.random() > 0.15 or layout.meets or isinstance(layout.base, HubDisc):
        return layout
    radius = float(rng.uniform(0.4, 0.8))
    feet = [w.section(w.z_floor) for w in layout.walls]
    nearest = min(a.distance(b) for i, a in enumerate(feet) for b in feet[:i])
    return replace(layout, fillet=round(radius, 2)) if nearest > 2.0 * radius + 0.4 else layout


def _windows(rng: Generator, layout: PartLayout, gaps: list[Gap]) -> PartLayout:
    """An opening through one wall, clear of everything else; the layout unchanged where 20 draws found no place."""
    for _ in range(20):
        k = int(rng.integers(len(layout.walls)))
        wall = layout.walls[k]
        u, width, tall = float(rng.uniform(0.2, 0.8)), float(rng.uniform(3.0, 6.0)), float(rng.uniform(2.0, 4.0))
        low = wall.z_floor + 2.0
        if wall.z_top - 2.0 - low < tall:
            continue
        z = float(rng.uniform(low, wall.z_top - 2.0 - tall))
        window = WindowSpec(k, wall, u, width, (z, z + tall))
        if window.fits(layout, gaps):
            return replace(layout, windows=[window])
    return layout
