"""LinuxCNC's own interpreter as a judge: a program to its canonical moves, compared with those of the reader."""

import math
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from verify.gcode.reader import FEED, RAPID
from verify.program.arc_chords import swept_points

RS274 = shutil.which("rs274")
ABSENT = "LinuxCNC's interpreter rs274 is not installed"
INCH = 25.4
DIAMETER = 6.0
"""mm, of every tool of the judge; the interpreter takes its table in inches."""
_CALL = re.compile(r"\s*\d+\s+N\S*\s+([A-Z0-9_]+)\((.*)\)\s*")
_NUMBERS = re.compile(r"(?:-?[0-9]+(?:\.[0-9]+)?(?:, *| +)?)+")
_PLANES = {"XY": (0, 1, 2), "YZ": (1, 2, 0), "XZ": (2, 0, 1)}


@dataclass(frozen=True)
class Canonical:
    """One canonical move: kind, points (k, 3) in mm after the start (one for a line), mm/min or nan, and the mm it is
    printed to."""

    kind: int
    points: np.ndarray
    feed: float
    grain: float


@dataclass(frozen=True)
class Judged:
    """What the interpreter made of a program: its moves, and its message where it refused it."""

    moves: list
    refused: str


def judge(text, folder):
    """Run ``text`` in an empty ``folder``; the tool table has T1 to T99 of length 0 and ``DIAMETER``."""
    folder = Path(folder)
    (folder / "tool.tbl").write_text("".join(f"T{n} P{n} Z0 D{DIAMETER / INCH:.12f}\n" for n in range(1, 100)))
    (folder / "check.var").write_text("")
    (folder / "check.ini").write_text(
        "[EMC]\nVERSION=1.1\nMACHINE=judge\n[TRAJ]\nCOORDINATES=XYZABC\nLINEAR_UNITS=mm\nANGULAR_UNITS=degree\n"
        f"[RS274NGC]\nPARAMETER_FILE={folder / 'check.var'}\n")
    (folder / "in.ngc").write_text(text)
    done = _run(folder)
    if done.returncode < 0:  # killed by a signal: it shares memory with others of its kind that run beside it
        done = _run(folder)
    said = [x for x in done.stderr.splitlines() if x.strip() and x.strip() != "executing"]
    refused = "" if done.returncode == 0 else " | ".join(said[:2]) or f"code {done.returncode}"
    out = folder / "out.txt"  # not there where the first block already is refused
    return Judged(list(_moves(out.read_text(errors="replace"))) if out.exists() else [], refused)


def _run(folder):
    return subprocess.run([RS274, "-g", "-i", "check.ini", "-t", "tool.tbl", "in.ngc", "out.txt"], cwd=folder,
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, errors="replace")


def _moves(canon):
    at, unit, coarse, feed, plane, by_turn = np.zeros(3), 1.0, 1.0, math.nan, "XY", False
    offsets = {"SET_G5X_OFFSET": np.zeros(3), "SET_G92_OFFSET": np.zeros(3)}
    for name, words in (m.groups() for m in map(_CALL.fullmatch, canon.splitlines()) if m):
        numbers = [float(w) for w in words.replace(",", " ").split()] if _NUMBERS.fullmatch(words) else []
        zero = sum(offsets.values())
        if name in offsets:
            offsets[name] = np.array(numbers[-6:-3]) * unit
            at += zero - sum(offsets.values())
        elif name in ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE"):
            at = np.array(numbers[:3]) * unit
            yield Canonical(FEED if name == "STRAIGHT_FEED" else RAPID, (at + zero)[None], feed, 1e-4 * coarse)
        elif name == "ARC_FEED":
            at, points = _arc(at, numbers, unit, plane)
            yield Canonical(FEED, points + zero, feed, 1e-4 * coarse)
        elif name == "USE_LENGTH_UNITS":
            unit = {"CANON_UNITS_INCHES": INCH, "CANON_UNITS_MM": 1.0}[words]
            coarse = max(unit, coarse)  # what was printed in inches stays as coarse as that
        elif name == "SET_FEED_RATE":
            feed = math.nan if by_turn else numbers[0] * unit  # by the turn is not compared
        elif name == "SET_FEED_MODE":
            by_turn = numbers[-1] == 1
        elif name == "SELECT_PLANE":
            plane = words.rsplit("_", 1)[1]


def _arc(at, numbers, unit, plane):
    """Points of ARC_FEED, by the one arc function that has its own test against closed forms."""
    i, j, k = _PLANES[plane]
    end = np.empty(3)
    end[i], end[j], end[k] = numbers[0] * unit, numbers[1] * unit, numbers[5] * unit
    turns = int(numbers[4])
    centre = np.array(numbers[2:4]) * unit
    start = at.copy()
    if np.abs(end - start)[[i, j]].max() <= 2e-4 * unit:  # a full circle, but for the digits printed
        start[i], start[j] = end[i], end[j]
    u, v = start[[i, j]] - centre, end[[i, j]] - centre
    sweep = (math.atan2(v[1], v[0]) - math.atan2(u[1], u[0])) % math.tau
    sweep = sweep or math.tau
    sweep = sweep - math.tau if turns < 0 and sweep < math.tau else math.copysign(sweep, turns)
    sweep += (abs(turns) - 1) * math.copysign(math.tau, turns)
    return end, swept_points(start.tolist(), end.tolist(), centre.tolist(), sweep, (i, j, k), chord=1e-4)


def difference(program, judged, gaps=False, off=0.003):
    """What the reader's moves differ in from the judge's, '' where they agree within the digits printed.

    gaps : whether the judge may have moves the reader has not (ways from and to the machine's own places)
    off : mm, how far ours may lie off an arc, besides the digits printed
    """
    keep = (program.start != program.end).any(axis=1)
    keep[program.unknown[:, 0]] = True  # these start where they end, as nothing else is known
    ours, kinds, feeds, lines = (a[keep] for a in (program.end, program.kind, program.feed, program.line))
    n, at = 0, np.zeros(3)  # where the interpreter starts
    for move in judged.moves:
        near = np.abs(ours[n] - move.points[-1]).max() <= 2 * move.grain if n < len(ours) else False
        stands = np.abs(at - move.points[-1]).max() <= 2 * move.grain
        at = move.points[-1]
        if len(move.points) == 1 and stands and not near:
            continue
        if n >= len(ours):
            if gaps:
                continue
            return f"the judge goes on to {move.points[-1]}"
        if len(move.points) == 1:
            if not near or kinds[n] != move.kind:
                if gaps:
                    continue
                return f"line {lines[n]}: {ours[n]} kind {kinds[n]} instead of {move.points[-1]} kind {move.kind}"
            n += 1
        else:
            if n == 0:
                return "the judge begins with an arc"
            wrong, n = _arc_difference(ours, n, move, off)
            if wrong:
                return f"line {lines[min(n, len(lines) - 1)]}: {wrong}"
        if move.kind == FEED and abs(feeds[n - 1] - move.feed) > 2 * move.grain + 3e-4 * move.feed:
            return f"line {lines[n - 1]}: feed {feeds[n - 1]} instead of {move.feed}"
    return "" if n == len(ours) else f"line {lines[n]}: {ours[n]} has no counterpart"


def _arc_difference(ours, n, move, off):
    """Follow ours from ``n`` along the arc: every point near it, in order, as long as it is."""
    points = np.vstack([ours[n - 1], move.points])
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    gone, near = 0.0, off + 4 * move.grain
    while n < len(ours) and gone < 1.01 * length + near:
        gone += float(np.linalg.norm(ours[n] - ours[n - 1]))
        nearest = np.abs(points - ours[n]).sum(axis=1).argsort()[:4]  # turns lie on one another
        gap = min(_distance(ours[n], points[max(part - 1, 0):part + 2]) for part in nearest)
        if gap > near:
            return f"{ours[n]} lies {gap:.4f} mm off the arc to {move.points[-1]}", n
        n += 1
        if abs(gone - length) <= 2e-3 * length + near and np.abs(ours[n - 1] - move.points[-1]).max() <= 2 * move.grain:
            return "", n
    return f"an arc goes on to {ours[n - 1]} after {gone:.4f} mm, not {move.points[-1]} after {length:.4f}", n - 1


def _distance(p, line):
    a, b = line[:-1], line[1:]
    way = b - a
    t = np.clip(((p - a) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-30), 0, 1)
    return float(np.linalg.norm(a + t[:, None] * way - p, axis=1).min())
