"""Clearance to the table: lowest places of whole assemblies along the moves of a program.

The lowest place of a disc of radius r at the height h of a tool with tip p and axis a is p_z + h a_z - r s, with
s = sqrt(1 - a_z²). Cutting parts are rounded: a corner of radius c has its centres on the circle of radius R - c at
the height c, so it reaches to p_z + c a_z - (R - c) s - c. All else is made of frusta, whose lowest place is on one of
their two rims. Along a move the tip goes straight and the axis swings by a tenth of a radian at most
(``turn_subdivision.MAX_TURN``). Between the ends of a move, a rim at the distance q from the tip therefore stays within
q / 800 of the straight line between its ends. That is added where an axis swings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.checks.dogleg_turns import drops
from verify.kernels.clash import ASIDE
from verify.model import Finding, FindingKind, ProofSetup
from verify.program.move_kinds import FEED
from verify.program.program import Program
from verify.tool_bodies import Bodies

BOW = 1.0 / 800.0  # of the distance from the tip
UPRIGHT = 1e-9  # of a unit axis: less is not a tilt
ROUNDING = 1e-3  # mm, coordinates of a program


def table_findings(read: Sequence[Program], tools: Sequence[ToolBody], setup: ProofSetup) -> list[Finding]:
    """One finding for each program whose tools come nearer to the table than the rapid clearance.

    An assumed table height (``setup.table_known`` false) is checked for tilted tools only: upright tools pass beside
    the part. On a machine of three axes a tool that cuts may come down to the table.
    """
    if setup.table is None or (setup.kinematics is None and not setup.table_known):
        return []
    return [f for p in read for f in _of(p, tools, setup, setup.table)]


def _of(p: Program, tools: Sequence[ToolBody], setup: ProofSetup, table: float) -> Iterator[Finding]:
    if p.poses is None and not setup.table_known:
        return
    low = lowest_places(p, tools, setup, leaning=not setup.table_known) - drops(p, tools, setup)
    way = p.end - p.start
    lifts = (way[:, 2] > 0.0) & (np.hypot(way[:, 0], way[:, 1]) <= ASIDE)  # it leaves where it stands
    room = np.where(((p.kind == FEED) | lifts) & (setup.kinematics is None), 0.0, setup.clearance_rapid)
    short = table + room - low
    bad = np.flatnonzero(short > ROUNDING)
    if not len(bad):
        return
    m = int(bad[np.argmax(short[bad])])
    floor = "the table" if setup.table_known else "the bottom of the blank (the height of the table is not given)"
    at = p.end[m]
    stay = f"must stay {room[m]:g} mm above" if room[m] else "must not come below"
    yield Finding(FindingKind.COLLISION, p.name, int(p.line[m]), None, None, (float(at[0]), float(at[1]), float(at[2])),
                  float(short[m]), float(table + room[m]),
                  f"T{p.tool[m]} comes down to Z{low[m]:.3f}; it {stay} {floor} at Z{table:.3f}", len(bad))


def lowest_places(p: Program, tools: Sequence[ToolBody], setup: ProofSetup, *, leaning: bool) -> F64:
    """Lowest Z of the assembly on every move.

    leaning : whether upright tools are left out

    Returns (m,) float64, mm, setup frame; inf for other tools and, with ``leaning``, for upright ones.
    """
    up = np.tile([0.0, 0.0, 1.0], (len(p), 1))
    start, end = (up, up) if p.poses is None else (p.poses.start_axis, p.poses.end_axis)
    swings = np.abs(start - end).max(axis=1) > UPRIGHT
    counted = np.ones(len(p), np.bool_) if not leaning else np.minimum(start[:, 2], end[:, 2]) < 1.0 - UPRIGHT
    out = np.full(len(p), np.inf)
    for tool in tools:
        mine = np.flatnonzero(counted & (p.tool == tool.number))
        out[mine] = np.minimum(_lowest(tool, setup, p.start[mine], start[mine], swings[mine]),
                               _lowest(tool, setup, p.end[mine], end[mine], swings[mine]))
    return out


def _lowest(tool: ToolBody, setup: ProofSetup, tip: F64, axis: F64, swings: F64) -> F64:
    """(n,) float64, mm: lowest Z of the assembly with tips and axes (n, 3); lower where an axis swings."""
    z = axis[:, 2]
    s = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    c, flat = tool.corner_radius, tool.radius - tool.corner_width
    rims = [(tool.flute_length, tool.widest_radius), (max(tool.cone_height, tool.end_height), tool.radius)]
    if tool.arcs is not None:
        rho, high = tool.arcs.at_sines(s)
        out = tip[:, 2] + high * z - rho * s
    else:
        out = tip[:, 2] + c * z - flat * s - c
    for z0, z1, r0, r1, clearance, _ in Bodies.of([tool], setup).rows.tolist():
        rims += [(z0, r0 - clearance), (z1, r1 - clearance)]
    for h, r in rims:
        out = np.minimum(out, tip[:, 2] + h * z - r * s - np.where(swings, BOW * np.hypot(h, r), 0.0))
    return np.asarray(out)


__all__ = ["lowest_places", "table_findings"]
