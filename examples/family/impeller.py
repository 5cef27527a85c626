"""Radial recipe: a hub with blades and splitters on a disc, neighbours joined by struts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from examples.family.layout import HubDisc, PartLayout, connect
from examples.family.splines import F64
from examples.family.walls import WallSpec

CHORDS = 9


def _swept(radii: tuple[float, float], start: float, sweep: float) -> F64:
    """Plan points of a blade from one radius to another, turning by ``sweep`` rad on the way: (9, 2) float64, mm."""
    r = np.linspace(*radii, CHORDS)
    angle = start + sweep * ((r - radii[0]) / (radii[1] - radii[0])) ** 1.5
    return np.column_stack([r * np.cos(angle), r * np.sin(angle)])


def impeller(rng: Generator, blades: int = 4) -> PartLayout:
    """Hub with ``blades`` blades, a splitter between each two, and a strut from each blade to the splitter after it."""
    disc = HubDisc(radius=30.0, thickness=4.0, hub_radius=(8.0, 6.5), hub_height=13.0)
    height = 11.0
    sweep = float(rng.uniform(0.25, 0.35))
    pitch = 2 * np.pi / blades
    walls: list[WallSpec] = []
    for k in range(blades):
        blade = _swept((7.0, 28.0), k * pitch, sweep)
        walls.append(WallSpec("blade", blade, disc.thickness, height, (1.8, 1.4), (0.05, 0.02)))
        split = _swept((15.0, 28.0), (k + 0.5) * pitch + 0.35 * sweep, 0.65 * sweep)
        walls.append(WallSpec("splitter", split, disc.thickness, 0.9 * height, (1.5, 1.2)))
    layout = PartLayout("impeller", disc, walls)
    kinds = ("round_bar", "bar", "arch", "bow")
    struts = []
    for k in range(blades):
        kind = kinds[k % len(kinds)]
        z = float(rng.uniform(8.5, 10.0))
        bend = {"arch": 1.5, "bow": 1.5}.get(kind, 0.0)
        u = float(rng.uniform(0.55, 0.65))
        struts.append(connect(walls, (2 * k, 2 * k + 1), kind, u, (z, z), width=1.6, depth=1.6, bend=bend))
    return replace(layout, connections=struts)
