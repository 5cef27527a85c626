"""What a program takes out of a part by brute force: poses along its moves, points of the cutter, a climb from the
deepest. It reads the plain LinuxCNC text of the adversary itself and runs no code of the proof.

This holds the closed forms of the mechanisms against the exact distance to the part. It measures from the removed
places to the surface only, so where a rib or an edge is gone it gives less than the whole.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from benchmarks.adversary.adversary_case import Case
from benchmarks.adversary.adversary_parts import F64, PARTS, setup_of

WORD = re.compile(r"([A-Z])(-?[\d.]+)")
STEP = 0.1  # mm between poses


@dataclass(frozen=True)
class Stretch:
    """A straight feed move, or a chord of an arc: line, T number, both ends of the tip, how far the arc bows, mm."""

    line: int
    tool: int
    a: tuple[float, float, float]
    b: tuple[float, float, float]
    bow: float = 0.0


def stretches(text: str) -> list[Stretch]:
    """The feed moves of a program in absolute mm; arcs in the plane XY become chords of 2 degrees."""
    out: list[Stretch] = []
    at, tool = np.array([np.nan] * 3), 0
    for row, line in enumerate(text.splitlines(), 1):
        words = {key: float(value) for key, value in WORD.findall(line)}
        if "M" in words and words["M"] == 6.0:
            tool = int(words["T"])
        if "G53" in line:
            at[2] = np.nan
            continue
        if not line.startswith(("G0 ", "G1 ", "G2 ", "G3 ")):
            continue
        to = np.array([words.get(key, v) for key, v in zip("XYZ", at, strict=True)])
        if line.startswith("G1"):
            out.append(Stretch(row, tool, tuple(at.tolist()), tuple(to.tolist())))
        elif line.startswith(("G2", "G3")):
            way, bow = _arc(at, to, at[:2] + [words["I"], words["J"]], line.startswith("G2"))
            out += [Stretch(row, tool, tuple(a.tolist()), tuple(b.tolist()), bow)
                    for a, b in zip(way[:-1], way[1:], strict=True)]
        at = to
    return out


def _arc(a: F64, b: F64, middle: F64, clockwise: bool) -> tuple[F64, float]:
    first, last = (math.atan2(p[1] - middle[1], p[0] - middle[0]) for p in (a, b))
    sign = -1.0 if clockwise else 1.0
    turn = (sign * (last - first)) % (2.0 * math.pi) or 2.0 * math.pi
    share = np.linspace(0.0, 1.0, max(2, math.ceil(turn / math.radians(2.0))))
    angle, radius = first + sign * turn * share, float(np.hypot(*(a[:2] - middle)))
    return np.column_stack([middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle),
                            a[2] + share * (b[2] - a[2])]), radius * (1.0 - math.cos(0.5 * turn * share[1]))


def removed_depth(case: Case, lines: Collection[int] | None = None, seed: int = 0) -> float:
    """How far the deepest place is from the surface, mm, that feed moves on some lines take out of the part.

    lines : None looks at all
    """
    part, rng, most = PARTS[case.part], np.random.default_rng(seed), 0.0
    tools = {t["number"]: t for t in setup_of(case.part, case.setup)["tools"]}
    for s in stretches(case.text):
        if lines is not None and s.line not in lines or math.isnan(sum(s.a)):
            continue
        radius, flutes = 0.5 * tools[s.tool]["diameter_mm"], tools[s.tool]["flute_length_mm"]
        ball = radius if tools[s.tool]["kind"] == "ball" else 0.0
        a, b = np.array(s.a), np.array(s.b)
        t = np.linspace(0.0, 1.0, math.ceil(float(np.linalg.norm(b - a)) / STEP) + 1)
        u, f = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 25), np.linspace(0, 2 * math.pi, 49)))
        x = np.column_stack([np.repeat(t, len(u)), np.tile(u, len(t)), np.tile(f, len(t))])

        def depth(x: F64, a: F64 = a, b: F64 = b, size: tuple[float, float, float] = (radius, ball, flutes)) -> F64:
            return part.depth(a + x[:, :1] * (b - a) + _outline(x[:, 1], x[:, 2], *size))

        value = depth(x)
        best = np.argsort(-value)[:60]
        x, value = x[best], value[best]
        for wide in (0.1, 0.03, 0.01, 0.003, 0.001):
            for _ in range(40):
                y = x + rng.normal(size=x.shape) * wide * [0.5, 0.5, 2.0]
                y[:, :2] = np.clip(y[:, :2], 0.0, 1.0)
                new = depth(y)
                x[new > value], value = y[new > value], np.maximum(value, new)
        most = max(most, float(value.max()))
    return most


def _outline(u: F64, f: F64, radius: float, ball: float, flutes: float) -> F64:
    """(n, 3) mm over the tip: places of a cutter along its outline, u 0 to 1, and round its axis, f rad."""
    if ball > 0.0:
        bend = np.minimum(u / 0.7, 1.0) * 0.5 * math.pi
        rho, z = ball * np.sin(bend), ball * (1.0 - np.cos(bend)) + np.maximum(u - 0.7, 0.0) / 0.3 * (flutes - ball)
    else:
        rho, z = radius * np.minimum(u / 0.5, 1.0), np.maximum(u - 0.5, 0.0) / 0.5 * flutes
    return np.column_stack([rho * np.cos(f), rho * np.sin(f), z])
