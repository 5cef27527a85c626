"""Arcs and longer lines for planned and for foreign programs: share, blocks, bytes, and the largest deviation.

    .venv/bin/python benchmarks/writing/bench_arcs.py [--seeds 0 1] [--chordal 0.005] [--foreign-only]

Jobs: a step of 16 by 12 mm, the plates of ``stepnc_family.py`` by seed, and a plate with a cone and half a ball. Each
is planned and proved without arcs and with them. Blocks are lines of the LinuxCNC program with a move. The deviation
is that of the written program as the verifier's reader goes along it, its chords set to 0.000001 mm, against the cuts
of the plan, dense points of each against every piece of the other, pass by pass.

Foreign programs are those of LinuxCNC's samples, the five-axis impeller among them: their feed moves of one feed, one
tool and an upright tool are fitted with half of 0.005 mm; moves in which a rotary axis turns, or stands off 0, are
left alone and counted. Where that leaves nothing the way of the tip alone is fitted, for its shape: no program is made
of that. At last 10⁶ points of long passes, for the time. Figures: docs/theory/arcs.md.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402

from benchmarks.foreign.foreign_cases import CASES, samples_root  # noqa: E402
from benchmarks.writing.stepnc_family import small  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from output.arc_fitting import fitted, stretches  # noqa: E402
from output.program_grid import GridArc, pieces, to_grid  # noqa: E402
from output.workplan import Workplan  # noqa: E402
from service import pipeline  # noqa: E402
from service.from_wire import parse_setup  # noqa: E402
from service.stages import programs  # noqa: E402
from tests.arc_plans import off  # noqa: E402
from toolpath.lines import thinned  # noqa: E402
from toolpath.scallop_budget import ARC_SHARE  # noqa: E402
from toolpath.workingsteps import TrajectoryKind  # noqa: E402
from verify.gcode.reader import read_program  # noqa: E402
from verify.program.program import Program  # noqa: E402

_MOVE = re.compile(r"^(?:G[0123] )?[XYZ][-0-9.]", re.MULTILINE)


def between(way: F64) -> F64:
    """A polyline (n, 3) with the middles of its pieces."""
    return np.vstack([way, 0.5 * (way[1:] + way[:-1])])


def deviation(work: Workplan, made: Workplan, text: str) -> float:
    """mm, between the cuts of a plan and what is read from a program of it, the larger of both ways.

    made : the plan with arcs, which tells how many blocks each trajectory has
    """
    p = read_program(text, chord=1e-6)
    feeds = np.flatnonzero(~np.isnan(p.feed) & (p.start != p.end).any(axis=1))
    begins = np.append(np.flatnonzero(np.append(True, p.line[feeds][1:] != p.line[feeds][:-1])), len(feeds))
    at, worst = 0, 0.0
    for step, new in zip(work.steps, made.steps, strict=True):
        for t, way in zip(step.trajectories, new.trajectories, strict=True):
            if t.motion is TrajectoryKind.RAPID:
                continue
            count = sum(1 if isinstance(x, GridArc) else len(x) - 1 for x in pieces(to_grid(way.points), way.arcs))
            rows, at = feeds[begins[at]:begins[at + count]], at + count
            if t.motion is TrajectoryKind.CUT and count:
                gone = np.vstack([p.start[rows[:1]], p.end[rows]])
                worst = max(worst, off(gone[::max(1, len(gone) // 2000)], t.points), off(between(t.points), gone))
    assert at == len(begins) - 1
    return worst


def planned(folder: Path, part: Path, setup: dict[str, Any], arcs: bool) -> tuple[dict[str, Any], Workplan, Workplan]:
    """A job: its report, and the plan before and after arcs were put into it."""
    seen: list[Workplan] = []

    def spied(work: Workplan, tolerance: float) -> Workplan:
        seen.extend([work, fitted(work, tolerance)])
        return seen[-1]

    programs.fitted = spied
    try:
        setup = {**setup, "machine": {**setup.get("machine", {}), "arcs": arcs}}
        report = pipeline.plan(part, parse_setup(setup), folder, lambda _stage, _share: None)
    finally:
        programs.fitted = fitted
    return report, *(seen or [None, None])


def jobs(folder: Path, seeds: list[int], chordal: float) -> Iterator[tuple[str, Path, dict[str, Any]]]:
    """Names, STEP files and setups."""
    _, setup = small(0, folder)
    setup["quality"]["chordal_tolerance_mm"] = chordal
    block = cq.Workplane().box(16, 12, 4, centered=False)
    step = block.cut(cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    plate = cq.Workplane().box(26, 22, 3, centered=False)
    cone = cq.Workplane().circle(5.0).workplane(offset=5).circle(3.6).loft(combine=True).translate((9, 11, 3))
    ball = cq.Workplane().sphere(4.0).translate((19, 11, 3))
    for name, shape in (("step", step), ("cone and ball", plate.union(cone).union(ball))):
        path = folder / f"{name.split()[0]}.step"
        cq.exporters.export(shape, str(path))
        yield name, path, setup
    for seed in seeds:
        path, setup = small(seed, folder)
        setup["quality"]["chordal_tolerance_mm"] = chordal
        yield f"plate, seed {seed}", path, setup


def row(name: str, folder: Path, part: Path, setup: dict[str, Any]) -> str:
    """One job as a row of the table: without arcs, and with."""
    texts, kb, told = [], [], []
    work = made = None
    for arcs in (False, True):
        out = folder / f"{part.stem}-{arcs}"
        report, work, made = planned(out, part, setup, arcs)
        texts.append((out / "program.linuxcnc.ngc").read_text() if report["state"] == "proved" else "")
        kb.append(sum(p.stat().st_size for p in out.glob("*.stpnc")) / 1000.0)
        told.append((report["state"], report["machining_time_s"]))
    if not all(texts) or work is None or made is None:
        return f"| {name} | {' and '.join(t[0] for t in told)} |"
    blocks = [len(_MOVE.findall(t)) for t in texts]
    cuts = [t for s in made.steps for t in s.trajectories if t.motion is TrajectoryKind.CUT]
    length = sum(t.length for t in cuts)
    round_ = sum(float(np.linalg.norm(np.diff(t.points[a.first:a.last + 1], axis=0), axis=1).sum())
                 for t in cuts for a in t.arcs)
    count = sum(len(t.arcs) for t in cuts)
    return (f"| {name} | {blocks[0]} | {blocks[1]} | {100 * (1 - blocks[1] / blocks[0]):.0f} % | {count} | "
            f"{100 * round_ / length:.0f} % | {len(texts[0]) / 1000:.0f} to {len(texts[1]) / 1000:.0f} | "
            f"{kb[0]:.0f} to {kb[1]:.0f} | {told[0][1]:.0f} to {told[1][1]:.0f} | "
            f"{1000 * deviation(work, made, texts[1]):.2f} |")


def runs(p: Program, tips_alone: bool = False) -> tuple[list[F64], int]:
    """Ways of a program whose feed, tool and upright axis stay as they are, mm, and how many feed moves are others.

    tips_alone : whatever axis and feed do
    """
    feed = ~np.isnan(p.feed)
    upright = np.ones(len(p), np.bool_)
    if p.poses is not None and not tips_alone:
        upright = (np.abs(np.hstack([p.poses.start_turn, p.poses.end_turn])) < 1e-12).all(axis=1)
    upright[p.unknown[:, 0]] = False
    good = feed & upright & (p.start != p.end).any(axis=1)
    on = good[1:] & good[:-1] & (tips_alone | (p.feed[1:] == p.feed[:-1])) & (p.tool[1:] == p.tool[:-1]) & (
        np.abs(p.end[:-1] - p.start[1:]).max(axis=1) < 1e-9)
    begins = np.flatnonzero(good & ~np.append(False, on))
    ends = np.flatnonzero(good & ~np.append(on, False))
    ways = [np.vstack([p.start[a:a + 1], p.end[a:b + 1]]) for a, b in zip(begins, ends, strict=True)]
    return ways, int((feed & ~upright).sum())


def foreign(tolerance: float) -> None:
    """A table of the samples."""
    root = samples_root()
    if root is None:
        print("LinuxCNC's samples are not installed")
        return
    print("| program | feed moves as read | turning, left alone | others | after | reduction | arcs | of the way | "
          "largest deviation, um |\n|---|---|---|---|---|---|---|---|---|")
    for case in CASES:
        p = read_program(case.text(root), name=case.name, kinematics=case.setup.kinematics, spindle_tool=1)
        ways, left = runs(p)
        if ways:
            print(foreign_row(case.name, ways, left, tolerance), flush=True)
            continue
        print(f"| {case.name} | {left} | {left} | 0 | | | | | |")
        print(foreign_row(f"{case.name}, tips alone", runs(p, tips_alone=True)[0], 0, tolerance), flush=True)


def foreign_row(name: str, ways: list[F64], left: int, tolerance: float) -> str:
    """One program as a row of the table; ways (n, 3), mm, and how many moves are not among them."""
    count, points = np.array([len(w) for w in ways]), np.concatenate(ways)
    before = int((count - 1).sum())
    fit = stretches(points, count, np.ones(len(ways), np.bool_), tolerance)
    sums = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    size = sums[fit.last] - sums[fit.first]
    worst = max((_apart(points[a:b + 1], fit.centre[k] if fit.is_arc[k] else None)
                 for k, (a, b) in enumerate(zip(fit.first, fit.last, strict=True)) if b - a > 1), default=0.0)
    return (f"| {name} | {before + left} | {left} | {before} | {len(fit.first)} | "
            f"{100 * (1 - len(fit.first) / before):.0f} % | {int(fit.is_arc.sum())} | "
            f"{100 * size[fit.is_arc].sum() / size.sum():.0f} % | {1000 * worst:.2f} |")


def _apart(planned: F64, centre: F64 | None) -> float:
    """mm, of what stands for some moves from them: a line, or an arc that is drawn with 400 chords."""
    a, b = planned[0], planned[-1]
    way = np.array([a, b])
    if centre is not None:
        u, v = a[:2] - centre, b[:2] - centre
        turn = np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)
        s = np.linspace(0.0, 1.0, 400)
        angle, r = np.arctan2(u[1], u[0]) + turn * s, np.linalg.norm(u) + s * (np.linalg.norm(v) - np.linalg.norm(u))
        way = np.column_stack([centre[0] + r * np.cos(angle), centre[1] + r * np.sin(angle), a[2] + s * (b[2] - a[2])])
    return max(off(between(planned), way), off(way[::4], planned))


def million(tolerance: float) -> None:
    """The time of 10⁶ points in passes of 500 to 600."""
    x = np.linspace(0.0, 60.0, 10_000)
    passes = [thinned(np.column_stack([x, 0.1 * k + 3 * np.sin(0.3 * x + 0.05 * k) + 0.3 * np.sin(2 * x),
                                       np.ones_like(x)]), tolerance) for k in range(100)]
    passes = passes * int(np.ceil(1e6 / sum(map(len, passes))))
    count = np.array([len(p) for p in passes])
    begun = time.perf_counter()
    fit = stretches(np.concatenate(passes), count, np.ones(len(count), np.bool_), tolerance)
    print(f"{count.sum()} points in {len(count)} passes: {len(fit.first)} stretches, {int(fit.is_arc.sum())} arcs, "
          f"{time.perf_counter() - begun:.1f} s")


def main() -> None:
    """Print the tables."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--seeds", type=int, nargs="*", default=[0])
    ask.add_argument("--chordal", type=float, default=0.005)
    ask.add_argument("--foreign-only", action="store_true")
    asked = ask.parse_args()
    if not asked.foreign_only:
        print("| job | blocks | with arcs | reduction | arcs | of the cuts | program, kB | both STEP-NC, kB | s | "
              "largest deviation, um |\n|---|---|---|---|---|---|---|---|---|---|")
        with tempfile.TemporaryDirectory() as folder:
            for job in jobs(Path(folder), asked.seeds, asked.chordal):
                print(row(job[0], Path(folder), *job[1:]), flush=True)
    foreign(ARC_SHARE * asked.chordal)
    million(ARC_SHARE * asked.chordal)


if __name__ == "__main__":
    main()
