"""Harmful and good programs by mechanism, and what the proof says of them.

Run from the root of the checkout: ``python benchmarks/adversary/run_adversary.py --seeds 0:200 [--mechanism M]
[--shard i/n] [--out rows.json]``. Three of four seeds are harmful programs, the fourth is a good one. Every mechanism
has its turn. Depth is right within 10 % or 5 µm of what the twin states. Without a finding of a kind that the twin
expects, a program that is not proved counts as harm found, and as of the wrong kind.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from benchmarks.adversary.adversary_case import REFUSED, Case  # noqa: E402
from benchmarks.adversary.adversary_parts import PARTS, setup_of  # noqa: E402
from benchmarks.adversary.mechanisms import GOOD, HARMFUL  # noqa: E402
from geometry.errors import CamError  # noqa: E402
from geometry.part import Part  # noqa: E402
from schemas.setup import Setup  # noqa: E402
from service.from_wire import mesh_chord, parse_setup  # noqa: E402
from service.part_reading import load  # noqa: E402
from service.stages.blank_model import blank_of  # noqa: E402
from service.stages.job_inputs import JobInputs  # noqa: E402
from service.stages.job_part import ReadPart  # noqa: E402
from service.verification.program_first import read_first  # noqa: E402
from service.verification.program_proof import proved_program  # noqa: E402
from tests.step_files import write_step  # noqa: E402


@dataclass(frozen=True)
class Row:
    """One case: what was expected, and what the proof says.

    state : 'proved', 'clean', 'unproved' or 'refused'
    kind, line, depth : whether they are those of the twin; None where it states none
    """

    seed: int
    mechanism: str
    part: str
    what: str
    good: bool
    state: str
    kind: bool | None
    line: bool | None
    depth: bool | None
    wanted: str
    got: str
    seconds: float

    @property
    def talked_round(self) -> bool:
        """Whether a harmful program is called proved."""
        return not self.good and self.state == "proved"

    @property
    def false_alarm(self) -> bool:
        """Whether a good program is not."""
        return self.good and self.state != "proved"

    @property
    def right(self) -> bool:
        """Whether all is as the twin says."""
        return self.state == "proved" if self.good else self.state != "proved" and False not in (
            self.kind, self.line, self.depth)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="adversary")


@cache
def _part(name: str, _chord: float, solid: int | None) -> Part:
    """A part as the service reads it, once for each chord of its mesh."""
    path = Path(_folder().name) / f"{name}.step"
    if not path.is_file():
        write_step(PARTS[name].build(), path)
    quality = _QUALITY[_chord]
    return load(path, parse_setup(json.dumps({**setup_of(name), "quality": quality, "part": {"solid": solid}})))


_QUALITY: dict[float, dict[str, Any]] = {}


def job_of(name: str, setup: Setup) -> ReadPart:
    """The job of a part and a setup."""
    chord = mesh_chord(setup.quality)
    _QUALITY.setdefault(chord, setup.quality.model_dump(mode="json"))
    part, inputs = _part(name, chord, None), JobInputs.of(setup)
    return ReadPart(inputs, part, blank_of(setup, part, None), inputs.accesses, part.warnings)


def case_of(seed: int, mechanism: str | None = None) -> Case:
    """The case of a seed; without a mechanism that whose turn it is. Other mechanisms do not change it."""
    if mechanism is None:
        turn, place = divmod(seed, 4)
        names = list(GOOD) if place == 3 else list(HARMFUL)
        mechanism = names[turn % len(names)] if place == 3 else names[(3 * turn + place) % len(names)]
    return {**HARMFUL, **GOOD}[mechanism](np.random.default_rng([seed, crc32(mechanism.encode())]))


def report_of(case: Case) -> dict[str, Any]:
    """The report of a case; state 'refused' where program or setup gives an error."""
    try:
        setup = parse_setup(json.dumps(setup_of(case.part, case.setup)))
        read = read_first(setup, case.text, ending=case.ending, dialect=case.dialect)
        return proved_program(job_of(case.part, setup), read, lambda _share: None).report
    except CamError as error:
        return {"state": REFUSED, "findings": [], "error": f"{error.code}: {error}"}


def judged(seed: int, case: Case) -> Row:
    """Prove a case and hold the report against what is expected."""
    begin, want = time.perf_counter(), case.expected
    report = report_of(case)
    found = report["findings"]
    own = [f for f in found if f["kind"] in want.kinds and want.word in f["message"]]
    there = [f for f in own if want.lines is None or f["line"] in want.lines]
    got = report.get("error") or ", ".join(f"{f['kind']} {f['line']} {f['depth']:.4f}" for f in (own or found)[:4])
    kind = line = depth = None
    if not want.good:
        refused = report["state"] == REFUSED
        kind = bool(own) or (refused and REFUSED in want.kinds)
        if not refused and want.lines is not None:
            line = bool(there)
        if not refused and want.depth is not None:
            off = min((abs(f["depth"] - want.depth) for f in there), default=np.inf)
            depth = bool(off <= max(0.1 * want.depth, 0.005))
    wanted = "proved" if want.good else f"{'/'.join(want.kinds)} {sorted(want.lines or ())[:4]} {want.depth}"
    return Row(seed, case.mechanism, case.part, case.what, want.good, report["state"], kind, line, depth, wanted, got,
               time.perf_counter() - begin)


def table(rows: Iterable[Row]) -> Iterator[str]:
    """Lines of the table by mechanism."""
    rows = list(rows)
    yield f"{'mechanism':26}{'cases':>6}{'proved':>8}{'kind':>8}{'line':>8}{'depth':>8}{'s':>7}"
    for name in dict.fromkeys(r.mechanism for r in rows):
        own = [r for r in rows if r.mechanism == name]
        mean = sum(r.seconds for r in own) / len(own)
        if own[0].good:
            refused = sum(r.false_alarm for r in own)
            yield f"{'good: ' + name:26}{len(own):6}{len(own) - refused:8}{'refused ' + str(refused):>24}{mean:7.2f}"
            continue
        cells = []
        for values in ([r.kind for r in own], [r.line for r in own], [r.depth for r in own]):
            known = [v for v in values if v is not None]
            cells.append(f"{sum(known)}/{len(known)}" if known else "-")
        yield (f"{name:26}{len(own):6}{sum(r.talked_round for r in own):8}" + "".join(f"{c:>8}" for c in cells)
               + f"{mean:7.2f}")
    harm, good = [r for r in rows if not r.good], [r for r in rows if r.good]
    yield (f"{len(harm)} harmful, {sum(r.talked_round for r in harm)} of them called proved; {len(good)} good, "
           f"{sum(r.false_alarm for r in good)} of them refused; {sum(r.seconds for r in rows):.0f} s")


def main() -> None:
    """Run seeds, print the table and every case that is not as the twin says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0:200", help="FROM:TO")
    parser.add_argument("--mechanism", action="append", help="this one only; may stand more than once")
    parser.add_argument("--shard", default="0/1", help="I/N: of the cases every Nth from I")
    parser.add_argument("--out", type=Path, help="JSON file of the rows")
    parser.add_argument("--show", action="store_true", help="print the program of each case and prove nothing")
    asked = parser.parse_args()
    low, high = map(int, asked.seeds.split(":"))
    shard, shards = map(int, asked.shard.split("/"))
    jobs = [(seed, m) for seed in range(low, high) for m in (asked.mechanism or [None])][shard::shards]
    rows = []
    for seed, mechanism in jobs:
        case = case_of(seed, mechanism)
        if asked.show:
            print(f"{case.mechanism}, {case.part}, {case.what}, {case.expected}\n{case.text}")
            continue
        row = judged(seed, case)
        rows.append(row)
        if not row.right:
            word = "TALKED ROUND" if row.talked_round else "FALSE ALARM" if row.false_alarm else "off"
            print(f"{word}: {row.mechanism} on {row.part}, seed {seed} ({row.what}): wanted {row.wanted}; "
                  f"{row.state}: {row.got}", flush=True)
        if asked.out:
            asked.out.write_text(json.dumps([asdict(r) for r in rows], indent=1))
    if rows:
        print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
