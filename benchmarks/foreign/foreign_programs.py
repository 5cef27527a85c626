"""LinuxCNC's own sample programs through the proof, each beside a brute-force twin.

Run from the root of the checkout: ``python benchmarks/foreign/foreign_programs.py [NAME ...]``. Every sample is
proved with a part it is right for (``foreign_cases``). The twin stands the tool at poses 5 µm apart: no pose may
reach the part, and lines on which a rapid, a neck, a shank or a holder meets stock, or a descent is too steep, are
noted in a stock of its own. A line of the table: moves, seconds of the proof, geometric findings by kind, how they
lie to the lines of the twin (``alone`` is a finding no line of the twin bears out, nor of a finer one, ``missed`` a
line no finding names), volume by both, and remarks on the text, which are no geometry. The part is then raised: cuts
of known depth must be found.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from benchmarks.foreign.foreign_cases import (  # noqa: E402
    CASES,
    SHORT,
    Foreign,
    Paths,
    covered,
    heights_of_part,
    part_of,
    paths,
    samples_root,
)
from benchmarks.foreign.foreign_leaning import leaning  # noqa: E402
from benchmarks.foreign.foreign_twin import SPACING, Marks, upright  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.part import Part  # noqa: E402
from geometry.sampling import sample_surface  # noqa: E402
from verify.material.machined_part import machined_stock  # noqa: E402
from verify.model import Finding, FindingKind, Proof, ScoredSamples  # noqa: E402
from verify.prove import prove  # noqa: E402

SAMPLES = 400_000
RAISED = 0.04  # mm
FINER, NEAR = 0.4, 0.3  # of a step; mm
BODY = (FindingKind.COLLISION, FindingKind.RUBBING)
GEOMETRIC = (*BODY, FindingKind.GOUGE, FindingKind.RAPID, FindingKind.PLUNGE, FindingKind.LIMIT)
_SPAN = re.compile(r", lines (\d+) to (\d+)$")


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the twin saw: lines by kind, the least way between cutter and part at nodes and at the middles of cells, mm,
    and mm³ taken off."""

    lines: dict[FindingKind, set[int]]
    gap: float
    volume: float
    seconds: float


@dataclass(frozen=True, eq=False)
class Result:
    """One sample: moves, the proof, seconds of it, the twin, and findings and lines that do not go together."""

    moves: int
    proof: Proof
    seconds: float
    twin: Verdict
    alone: list[Finding]
    missed: dict[FindingKind, list[int]]
    raised: Proof
    volume: float
    remarks: list[str] = field(default_factory=list)


def run_twin(case: Foreign, moves: Paths, heights: F64, grid: tuple[F64, float]) -> Verdict:
    """Pose by pose: cutter against part, everything against stock.

    heights : (nx, ny) float64, mm, of the part; grid : origin (2,) mm and mm between nodes
    """
    began, (origin, step) = time.perf_counter(), grid
    middle = 0.5 * (heights[:-1, :-1] + heights[1:, 1:])  # on the diagonal both triangles share
    gaps = [covered(case, moves, 0.0, shift)[0] for shift in (0.0, 0.5)]
    gap = min(float((gaps[0] - heights).min()), float((gaps[1][:-1, :-1] - middle).min()))
    n = len(moves.start)
    rapid, body, dug, cut = np.zeros(n, np.int8), np.zeros(n, np.int8), np.zeros(n), np.zeros(n)
    box = case.box
    after = (case.bodies, case.setup.clearance_rapid)
    if case.leaning:
        h, first = case.points, box[0] + 0.5 * case.points
        nx, ny, nz = np.round((box[1] - box[0]) / h).astype(int).tolist()
        stock = case.filled(first, h, (nx, ny, nz))
        leaning(stock, first, h, moves.start, moves.end, moves.turns, moves.feed, case.cutter, *after, case.spacing,
                Marks(rapid, body, dug, cut))
    else:
        stock = np.full(heights.shape, box[1, 2])
        upright(stock, origin, step, moves.start, moves.end, moves.feed, case.cutter, case.end, *after, SPACING,
                Marks(rapid, body, dug, cut))
    skin = case.setup.plunge_skin * case.diameter
    lines = {FindingKind.RAPID: rapid > 0, FindingKind.COLLISION: body == 2, FindingKind.RUBBING: body > 0}
    if not case.leaning:
        lines[FindingKind.PLUNGE] = dug > skin
    return Verdict({k: set(moves.line[v].tolist()) for k, v in lines.items()}, gap, float(cut.sum()),
                   time.perf_counter() - began)


def lines_of(found: Finding) -> tuple[int, int]:
    """First and last line a finding names."""
    span = _SPAN.search(found.message)
    return (int(span[1]), int(span[2])) if span else (found.line, found.line)


def compare(proof: Proof, twin: Verdict) -> tuple[list[Finding], dict[FindingKind, list[int]]]:
    """Findings the twin does not bear out, and lines of the twin that no finding names (not asked for where there are
    more findings than the proof lists)."""
    alone, missed = [], {}
    whole = sum(proof.counts.values()) == len(proof.findings)
    for kind in twin.lines:
        found = [f for f in proof.findings if f.kind == kind]
        alone += [f for f in found if not any(a <= n <= b for a, b in [lines_of(f)] for n in twin.lines[kind])]
        spans = [lines_of(f) for f in proof.findings if f.kind in (BODY if kind in BODY else (kind,))]
        lost = [n for n in sorted(twin.lines[kind]) if not any(a <= n <= b for a, b in spans)]
        if lost and whole:
            missed[kind] = lost
    alone += [f for f in proof.findings if f.kind == FindingKind.GOUGE and twin.gap >= 0.0]
    return alone, missed


def finer(case: Foreign, moves: Paths, alone: Sequence[Finding]) -> list[Finding]:
    """Those of the findings alone that a finer twin does not bear out either: of plunges one of all the stock, whose
    nodes lie FINER of a step apart, and of what tools that lean meet one of the NEAR mm round the finding's place."""
    out = []
    for f in alone:
        until = int(np.flatnonzero(moves.line <= lines_of(f)[1])[-1]) + 1
        if case.leaning and f.kind in (FindingKind.RAPID, *BODY):
            hit = _leaning_at(case, moves, until, np.asarray(f.point), f.kind)
        elif not case.leaning and f.kind == FindingKind.PLUNGE:
            hit = _dug(case, moves, until)
        else:
            hit = np.zeros(until, np.bool_)
        if not (hit & (moves.line[:until] >= lines_of(f)[0])).any():
            out.append(f)
    return out


def _dug(case: Foreign, moves: Paths, until: int) -> NDArray[np.bool_]:
    """(until,) bool, the moves that plunge by the finer twin."""
    step, box = FINER * case.step, case.box
    nx, ny = (np.floor((box[1, :2] - box[0, :2]) / step).astype(int) + 1).tolist()
    mark, dug, cut = np.zeros(until, np.int8), np.zeros(until), np.zeros(until)
    upright(np.full((nx, ny), box[1, 2]), box[0, :2], step, moves.start[:until], moves.end[:until], moves.feed[:until],
            case.cutter, case.end, np.zeros((0, 5)), case.setup.clearance_rapid, SPACING, Marks(mark, mark, dug, cut))
    return dug > case.setup.plunge_skin * case.diameter


def _leaning_at(case: Foreign, moves: Paths, until: int, place: F64, kind: FindingKind) -> NDArray[np.bool_]:
    """(until,) bool, the moves by which points round (3,) mm are met."""
    h, n = 0.1 * NEAR, 21
    rapid, body, cut = np.zeros(until, np.int8), np.zeros(until, np.int8), np.zeros(until)
    stock, first = case.filled(place - NEAR, h, (n, n, n)), place - NEAR
    leaning(stock, first, h, moves.start[:until], moves.end[:until], moves.turns[:until], moves.feed[:until],
            case.cutter, case.bodies, case.setup.clearance_rapid, SPACING, Marks(rapid, body, cut, cut))
    return np.asarray(rapid > 0 if kind == FindingKind.RAPID else body > 0)


def prove_case(case: Foreign, text: str, part: Part, samples: int = SAMPLES) -> Proof:
    """The proof of one sample, at so many scored points that no zone answers for."""
    spread = sample_surface(part.mesh, samples / float(part.mesh.areas.sum()), seed=7)
    scored = ScoredSamples(spread, np.zeros(len(spread), np.int32))
    return prove([(case.name, text)], part, [case.tool], case.setup, scored, [], spindle_tool=1)


def run(case: Foreign, root: Path, samples: int = SAMPLES) -> Result:
    """Prove one sample at so many points and let the twin judge; then lift the part by RAISED mm and prove again."""
    text = case.text(root)
    program, moves = paths(case, text)
    heights, origin, step = heights_of_part(case, moves)
    part = part_of(heights, origin, step, case.box[0, 2])
    began = time.perf_counter()
    proof = prove_case(case, text, part, samples)
    seconds = time.perf_counter() - began
    twin = run_twin(case, moves, heights, (origin, step))
    alone, missed = compare(proof, twin)
    alone = finer(case, moves, alone)
    again = prove_case(case, text, part_of(heights + RAISED, origin, step, case.box[0, 2]), samples)
    size = case.box[1] - case.box[0]
    left = machined_stock([(case.name, text)], part, [case.tool], case.setup, max(float(size.max()) / 250, 0.01),
                          spindle_tool=1).volume
    whole = float(size.prod()) if len(case.blank) == 6 else np.pi * case.blank[3] ** 2 * case.blank[4]
    remarks = [f"line {f.line}: {f.message}" for f in proof.findings if f.kind == FindingKind.PROGRAM]
    return Result(len(program), proof, seconds, twin, alone, missed, again, whole - left, [*remarks, *proof.notes])


def report(case: Foreign, r: Result) -> str:
    """The rows of one sample."""
    kinds = {str(k): r.proof.counts[k] for k in GEOMETRIC if r.proof.counts.get(k)}
    lines = {str(k): len(v) for k, v in r.twin.lines.items() if v}
    missed = {str(k): len(v) for k, v in r.missed.items()}
    out = [f"{case.name:24s} {r.moves:6d} moves {r.seconds:6.1f} s  findings {kinds or 'none'}; twin "
           f"{r.twin.seconds:.1f} s, gap {1e3 * r.twin.gap:.1f} µm, lines {lines or 'none'}; alone {len(r.alone)}, "
           f"missed {missed or 0}; off {r.volume:.6g} mm³ (twin {r.twin.volume:.6g}); raised {1e3 * RAISED:g} µm: "
           f"gouge {1e3 * r.raised.gouge_max:.1f} µm of {1e3 * (RAISED - r.twin.gap):.1f}"]
    out += [f"    alone: line {f.line} {f.kind} {f.message}" for f in r.alone[:4]]
    out += [f"    missed: {k} on lines {v[:8]}" for k, v in r.missed.items()]
    out += [f"    {n} x {text}" for text, n in Counter(r.remarks).items()]
    return "\n".join(out)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    chosen = parser.parse_args(arguments)
    root = samples_root()
    if root is None:
        parser.error("LinuxCNC's samples are not installed: install linuxcnc-uspace, or its documentation")
    cases = [c for c in (*CASES, SHORT) if not chosen.names or c.name in chosen.names]
    for case in cases:
        print(report(case, run(case, root)), flush=True)


if __name__ == "__main__":
    main()
