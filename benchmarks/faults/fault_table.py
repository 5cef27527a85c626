"""The table of planted faults: twenty kinds on six parts, each found, on the right line, as deep as it is.

Run from the root of the checkout: ``python benchmarks/faults/fault_table.py [--instances N] [--parts A,B] [--kinds K,L]
[--seed S] [--jobs J] [--clean N] [--uncovered N]``. Lines and depths that must be found come from a brute-force twin
(``fault_twin``); right means within 10 % or 5 µm. A draw that plants nothing anybody could find is drawn again.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from benchmarks.faults.fault_case import Case  # noqa: E402
from benchmarks.faults.fault_kinds import KINDS, REFUSED, Planted, Redraw, twin_of, without  # noqa: E402
from benchmarks.faults.fault_leaning import cone, dome, house  # noqa: E402
from benchmarks.faults.fault_parts import pocket, walls, wave  # noqa: E402
from geometry.errors import ProgramError  # noqa: E402
from verify.prove import Proof, prove  # noqa: E402

PARTS = {"pocket": pocket, "wave": wave, "walls": walls, "dome": dome, "cone": cone, "house": house}
DRAWS = 12
CLEAN = 0.005  # mm, the most the twin may find in a clean program


@dataclass(frozen=True)
class Outcome:
    """One planted fault: whether it was found, on its line (or zone), as deep; ``off`` mm, what was found in words."""

    kind: str
    part: str
    seed: int
    drawn: bool
    found: bool = False
    line: bool = False
    depth: bool = False
    off: float = 0.0
    told: str = ""
    seconds: float = 0.0


def proof_of(case: Case) -> Proof:
    """The proof of a case, on one thread."""
    return prove([("part.nc", case.text)], case.part, case.tools, case.setup, case.scored, case.zones, threads=1)


def run(kind: str, part: str, seed: int) -> Outcome:
    """Plant one fault and look what is found; ``drawn`` is false where no draw of this seed can be found."""
    begin = time.perf_counter()
    case, rng = PARTS[part](seed), np.random.default_rng([seed, list(KINDS).index(kind)])
    for _ in range(DRAWS):
        try:
            planted = KINDS[kind](case, rng)
            break
        except Redraw as why:
            reason = str(why)
    else:
        return Outcome(kind, part, seed, False, told=reason, seconds=time.perf_counter() - begin)
    found, line, depth, off, told = judged(planted)
    return Outcome(kind, part, seed, True, found, line, depth, off, told, time.perf_counter() - begin)


def judged(planted: Planted) -> tuple[bool, bool, bool, float, str]:
    """Found, on the right line or zone, of the right depth, off by mm, and what there was."""
    wanted = f"wanted {'/'.join(planted.kinds)} {planted.zone or sorted(planted.lines or ())[:4]} {planted.depth}"
    try:
        proof = proof_of(planted.case)
    except ProgramError as refusal:
        at = {int(name.split()[1]) for name in refusal.subjects if name.startswith("line ")}
        if REFUSED not in planted.kinds:
            return False, False, False, 0.0, f"{wanted}; refused {refusal}"
        right = bool(at & (planted.lines or frozenset()))
        return True, right, right, 0.0, f"{wanted}; refused {refusal}"
    own = [f for f in proof.findings if str(f.kind) in planted.kinds and planted.word in f.message]
    there = [f for f in own if (planted.zone is None or f.zone == planted.zone)
             and (planted.lines is None or f.line in planted.lines)]
    told = f"{wanted}; got " + ", ".join(f"{f.kind} {f.zone or f.line} {f.depth:.4f}" for f in
                                        (own or proof.findings)[:4])
    if planted.depth is None or not there:
        return bool(own), bool(there), bool(there), 0.0, told
    off = min(abs(f.depth - planted.depth) for f in there)
    return True, True, off <= max(0.1 * planted.depth, 0.005), off, told


def clean(part: str, seed: int) -> list[str]:
    """What proof and twin find in a clean case: nothing, if both are right. What the twin finds too, it says; of
    plunges it knows nothing."""
    case = PARTS[part](seed)
    proof, twin, s = proof_of(case), twin_of(case), case.scored.samples
    out, depth = [], twin.gouge().depth
    for f in proof.findings:
        left = 0.0
        if str(f.kind) == "residual" and f.point is not None:
            row = np.linalg.norm(s.points - f.point, axis=1).argmin()[None]
            left = float(twin.left(s.points[row], s.normals[row])[0])
        real = left > case.setup.scallop_height
        word = "true" if real else "unjudged" if str(f.kind) == "plunge" else "FALSE"
        out.append(f"{word}: {part} {seed}: {f.kind} line {f.line}: {f.message}"
                   + (f"; the twin says {left:.4f}" if real else ""))
    return out + ([f"the twin finds a gouge of {depth:.4f} mm: {part} {seed}"] if depth > CLEAN else [])


def uncovered(part: str, seed: int) -> tuple[bool, str]:
    """A third of the passes of a zone left out: its coverage must fall by the right area and a finding must name it."""
    case, rng = PARTS[part](seed), np.random.default_rng([seed, 99])
    for _ in range(DRAWS):
        zone = case.runs[int(rng.integers(len(case.runs)))]
        own = [k for k, name in enumerate(case.runs) if name == zone]
        gone = set(rng.permutation(own)[:max(1, len(own) // 3)].tolist())
        try:
            bad = without(case, [s for s in case.steps if s.run in gone and not s.rapid])
        except Redraw:
            continue
        s, mine = bad.scored.samples, np.flatnonzero(bad.scored.zone == bad.zones.index(zone) + 1)
        thin = max(1, len(mine) // 20_000)
        mine = mine[::thin]
        fell = float((twin_of(bad).left(s.points[mine], s.normals[mine]) > bad.setup.scallop_height).mean())
        if fell < 0.02:
            continue
        proof = proof_of(bad)
        told = 1.0 - proof.zones[zone].coverage
        named = any(str(f.kind) == "residual" and f.zone == zone for f in proof.findings)
        noise = 2.0 * np.sqrt((1.0 - fell) / (fell * len(mine))) if thin > 1 else 0.0  # of the twin's own few
        right = named and abs(told - fell) <= (0.05 + noise) * fell
        return right, f"{part} {seed} {zone}: {told:.4f} uncovered, the twin says {fell:.4f}, named {named}"
    return True, f"{part} {seed}: no third of a zone's passes can be left out and be missed"


def _task(job: tuple[str, str, int]) -> Outcome:
    return run(*job)


def table(outcomes: list[Outcome], parts: list[str], kinds: list[str]) -> Iterator[str]:
    """Lines of the table: found / line right / depth right of as many as were planted, worst depth error in µm."""
    yield f"{'kind':16}" + "".join(f"{p:>24}" for p in parts)
    for kind in kinds:
        cells = []
        for part in parts:
            own = [o for o in outcomes if o.kind == kind and o.part == part and o.drawn]
            if not own:
                cells.append(f"{'n/a':>24}")
                continue
            n = f"{sum(o.found for o in own)}/{sum(o.line for o in own)}/{sum(o.depth for o in own)}"
            cells.append(f"{n + f' of {len(own)} {1e3 * max(o.off for o in own):.1f}':>24}")
        yield f"{kind:16}" + "".join(cells)


def never(outcomes: list[Outcome]) -> Iterator[str]:
    """What could not be planted on which part, how often, and why not at the last draw."""
    asked = [o for o in outcomes if not o.drawn]
    for kind, part, why in sorted({(o.kind, o.part, o.told) for o in asked}):
        count = sum((o.kind, o.part, o.told) == (kind, part, why) for o in asked)
        yield f"not in {DRAWS} draws: {kind} on {part}, {count} times: {why}"


def main() -> None:
    """Print the table, the misses, and what clean programs were accused of."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--instances", type=int, default=50)
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--clean", type=int, default=0, help="so many clean programs, over all parts")
    parser.add_argument("--uncovered", type=int, default=0, help="so many programs with passes left out on each part")
    asked = parser.parse_args()
    parts, kinds = asked.parts.split(","), [k for k in asked.kinds.split(",") if k]
    begin = time.perf_counter()
    seeds = range(asked.seed, asked.seed + asked.instances)
    jobs = [(k, p, s) for p in parts for k in kinds for s in seeds]
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("forkserver")) as pool:
        outcomes = list(pool.map(_task, jobs, chunksize=2))
        print("\n".join(table(outcomes, parts, kinds)), flush=True)
        for o in outcomes:
            if o.drawn and not (o.found and o.line and o.depth):
                print(f"miss: {o.kind} on {o.part}, seed {o.seed}: {o.told}")
        print("\n".join(never(outcomes)))
        total = sum(o.drawn for o in outcomes)
        right = sum(o.drawn and o.found and o.line and o.depth for o in outcomes)
        print(f"{right} right of {total} planted, {len(outcomes)} asked, {time.perf_counter() - begin:.0f} s")
        for told in pool.map(clean, *zip(*((parts[k % len(parts)], asked.seed + k) for k in range(asked.clean)),
                                         strict=True)) if asked.clean else ():
            for line in told:
                print(f"not clean: {line}")
        cases = [(p, s) for p in parts for s in range(asked.seed, asked.seed + asked.uncovered)]
        for right, line in pool.map(uncovered, *zip(*cases, strict=True)) if cases else ():
            print(f"{'right' if right else 'WRONG'}: {line}")
    print(f"{time.perf_counter() - begin:.0f} s in all")


if __name__ == "__main__":
    main()
