"""Recipes with walls side by side on a rectangular plate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from examples.family.gaps import channels
from examples.family.layout import LayoutError, PartLayout, Plate, check, connect, try_connections
from examples.family.splines import F64, interpolate
from examples.family.walls import WallSpec

ALL_KINDS = ("round_bar", "bar", "web", "arch", "bow")


def _plate_for(walls: list[WallSpec], thickness: float, margin: float = 3.5) -> Plate:
    boxes = np.array([w.section(z).bounds for w in walls for z in (w.z_floor, w.z_top)])
    lo, hi = boxes[:, :2].min(axis=0) - margin, boxes[:, 2:].max(axis=0) + margin
    x0, y0, x1, y1 = (float(round(c, 1)) for c in (*lo, *hi))
    return Plate((x0, y0, x1, y1), thickness)


def _shift_to_gap(walls: list[WallSpec], k: int, gap: float) -> list[WallSpec]:
    """Move wall k and all after it along y until its channel to wall k - 1 is ``gap`` at the narrowest."""
    for _ in range(6):
        found = [c for c in channels(walls[k - 1 : k + 1], n_u=61, n_v=3) if c.walls == (0, 1)]
        if not found:
            raise LayoutError("two neighbours do not face each other")
        d = gap - found[0].gap_min
        walls = walls[:k] + [replace(w, centre=w.centre + [0.0, d]) for w in walls[k:]]
        if abs(d) < 1e-4:
            break
    return walls


def _smooth(rng: Generator, x: F64, amplitude: float, knots: int = 5) -> F64:
    """Smooth random heights over x, (n,) float64 mm, from ``knots`` random values."""
    at = np.linspace(x[0], x[-1], knots)
    return np.asarray(interpolate(at, rng.uniform(-amplitude, amplitude, knots))(x))


def demo(rng: Generator) -> PartLayout:
    """Three wavy walls about 55 mm long, three connections, one narrow stretch of channel.

    Raises LayoutError where two neighbours do not face each other.
    """
    jitter = rng.uniform(-0.1, 0.1, 4) if rng is not None else np.zeros(4)
    x = np.linspace(-26.0, 26.0, 9)
    wave = (1.5 + jitter[0]) * np.sin(2 * np.pi * (x + 5) / 46.0)
    z, h = 4.0, 11.0
    w0 = WallSpec("curved", np.column_stack([x, wave - 8.5]), z, h, (2.2, 2.0))
    w1 = WallSpec("curved", np.column_stack([x, 0.7 * wave + 0.4 * np.cos(x / 9.0)]), z, h, (2.0, 1.8))
    pinch = 4.2 - 2.6 * np.exp(-(((x - 13.0 + 4 * jitter[1]) / 7.0) ** 2))
    w2 = WallSpec("curved", np.column_stack([x, w1.centre[:, 1] + 2.0 + pinch]), z, h, (2.0, 1.8))
    walls = _shift_to_gap([w0, w1, w2], 1, 5.0)
    walls = _shift_to_gap(walls, 2, 1.4)
    connections = [
        connect(walls, (0, 1), "round_bar", 0.30 + 0.1 * jitter[2], (9.5, 9.5), width=2.0, depth=2.0),
        connect(walls, (0, 1), "arch", 0.70 + 0.1 * jitter[3], (8.5, 8.5), width=2.4, depth=1.6, bend=1.4),
        connect(walls, (1, 2), "web", 0.28, (10.5, 10.5), width=5.0, depth=1.2),
    ]
    return PartLayout("demo", _plate_for(walls, z, 3.0), walls, connections)


def narrow(rng: Generator) -> PartLayout:
    """Two wavy walls that come within 0.8 mm of each other, joined by a bar and a web.

    Raises LayoutError where two neighbours do not face each other.
    """
    x = np.linspace(-24.0, 24.0, 9)
    wave = _smooth(rng, x, 1.6)
    z, h = 4.0, 10.0
    a = WallSpec("curved", np.column_stack([x, wave]), z, h, (1.8, 1.8))
    open_gap = 4.5 - 3.6 * np.exp(-(((x - float(rng.uniform(4, 10))) / 8.0) ** 2))
    b = WallSpec("curved", np.column_stack([x, wave + 1.8 + open_gap]), z, h, (1.8, 1.6))
    walls = _shift_to_gap([a, b], 1, 0.8)
    layout = PartLayout("narrow", _plate_for(walls, z), walls)
    first = connect(walls, (0, 1), "bar", 0.2, (9.0, 9.0), width=1.6, depth=1.6)
    second = connect(walls, (0, 1), "web", 0.4, (10.0, 10.0), width=4.0, depth=1.0)
    return replace(layout, connections=[first, second])


def leaning_pair(rng: Generator) -> PartLayout:
    """Two walls that lean the same way, so that one side of each is an undercut from above.

    Raises LayoutError where two neighbours do not face each other.
    """
    x = np.linspace(-22.0, 22.0, 8)
    wave = _smooth(rng, x, 1.5)
    lean = float(np.tan(np.radians(rng.uniform(8, 11))))
    z, h = 5.0, 12.0
    a = WallSpec("leaning", np.column_stack([x, wave]), z, h, (2.4, 1.8), (lean, lean))
    b = WallSpec("leaning", np.column_stack([x, 0.8 * wave + 8.0]), z, h, (2.4, 1.8), (lean, 0.85 * lean))
    walls = _shift_to_gap([a, b], 1, 5.0)
    layout = PartLayout("leaning_pair", _plate_for(walls, z), walls)
    return replace(layout, connections=try_connections(rng, layout, [(0, 1)], 2, ("round_bar", "bar", "bow")))


def three_walls(rng: Generator) -> PartLayout:
    """A straight, an arched and a wavy wall of different height; one strut rises from the floor.

    Raises LayoutError where two neighbours do not face each other.
    """
    x = np.linspace(-25.0, 25.0, 9)
    z = 4.0
    a = WallSpec("straight", np.array([[-24.0, 0.0], [25.0, 0.0]]), z, 10.0, (2.0, 2.0))
    radius = float(rng.uniform(60, 80))
    arc = radius - np.sqrt(radius**2 - x**2)
    b = WallSpec("curved", np.column_stack([x, 8.0 + arc]), z, 13.0, (2.6, 2.0))
    c = WallSpec("curved", np.column_stack([x, 18.0 + arc + _smooth(rng, x, 1.2)]), z, 12.0, (1.8, 1.6))
    walls = _shift_to_gap(_shift_to_gap([a, b, c], 1, 4.0), 2, 3.0)
    connections = [
        connect(walls, (0, 1), "bar", 0.25, (4.0, 10.0), width=1.8, depth=1.8),
        connect(walls, (0, 1), "round_bar", 0.72, (9.5, 9.5), width=1.9, depth=1.9),
        connect(walls, (1, 2), "bow", 0.35, (9.0, 9.0), width=1.6, depth=1.6, bend=1.4),
        connect(walls, (1, 2), "web", 0.75, (11.0, 11.0), width=5.0, depth=1.2),
    ]
    return PartLayout("three_walls", _plate_for(walls, z), walls, connections)


def wavy(rng: Generator) -> PartLayout:
    """Two long wavy walls with connections at several heights, suitable for fillets.

    Raises LayoutError where two neighbours do not face each other.
    """
    x = np.linspace(-30.0, 30.0, 11)
    wave = 2.2 * np.sin(2 * np.pi * x / float(rng.uniform(32, 40)))
    z = 5.0
    a = WallSpec("curved", np.column_stack([x, wave]), z, 14.0, (2.6, 1.8))
    b = WallSpec("curved", np.column_stack([x, 0.8 * wave + 9.0]), z, 14.0, (2.4, 2.0))
    walls = _shift_to_gap([a, b], 1, 4.5)
    layout = PartLayout("wavy", _plate_for(walls, z), walls)
    return replace(layout, connections=try_connections(rng, layout, [(0, 1)], 3, ALL_KINDS))


def random(
    rng: Generator,
    walls: int | None = None,
    connections: int | None = None,
    gap: tuple[float, float] = (0.8, 12.0),
) -> PartLayout:
    """A random part of the family.

    walls       : 2 to 6; drawn when None
    connections : 0 to 6; drawn when None (fewer where no room is left)
    gap         : mm, range of the least gap of each channel

    Raises LayoutError where two neighbours do not face each other.
    """
    count = walls if walls is not None else int(rng.integers(2, 7))
    wanted = connections if connections is not None else int(rng.integers(0, 7))
    z = float(np.round(rng.uniform(3.0, 6.0), 1))
    length = float(rng.uniform(28.0, 60.0))
    x = np.linspace(-0.5 * length, 0.5 * length, 9)
    shared = _smooth(rng, x, length / 26.0)
    lean = float(np.tan(np.radians(rng.uniform(3, 11)))) * (1 if rng.random() < 0.35 else 0)
    height = float(rng.uniform(8.0, 25.0))
    lanes = [_random_wall(rng, x, shared, 14.0 * k, z, height, lean) for k in range(count)]
    least = np.exp(rng.uniform(np.log(gap[0]), np.log(gap[1]), count - 1))
    for k in range(1, count):
        lanes = _shift_to_gap(lanes, k, float(least[k - 1]))
    layout = PartLayout("random", _plate_for(lanes, z), lanes)
    check(layout)
    facing = {c.walls for c in channels(lanes, n_u=61, n_v=3) if c.gap_min <= 12.5}
    pairs = [(k, k + 1) for k in range(count - 1) if (k, k + 1) in facing]
    drawn = try_connections(rng, layout, pairs, wanted, ALL_KINDS) if pairs and wanted else []
    return replace(layout, connections=drawn)


def _random_wall(rng: Generator, x: F64, shared: F64, y: float, z: float, height: float, lean: float) -> WallSpec:
    h = float(np.clip(height * rng.uniform(0.85, 1.15), 8.0, 25.0))
    foot = float(rng.uniform(1.0, min(4.0, 0.38 * h)))
    thickness = (foot, foot * float(rng.uniform(0.75, 1.0)))
    trim = rng.uniform(0.0, 2.0, 2)
    own = _smooth(rng, x, 0.8)
    straight = bool(rng.random() < 0.15)
    xs = np.linspace(x[0] + trim[0], x[-1] - trim[1], len(x))
    if straight:
        return WallSpec("straight", np.array([[xs[0], y], [xs[-1], y]]), z, h, thickness)
    line = interpolate(x, shared)(xs) + interpolate(x, own)(xs)
    kind = "leaning" if lean else "curved"
    return WallSpec(kind, np.column_stack([xs, y + line]), z, h, thickness, (lean, lean))
