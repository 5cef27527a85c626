"""Programs as shops write them: is each read as its judge has it, within 1 µm?

Run from the root of the checkout: ``python benchmarks/reading/read_corpus.py [--no-samples] [--table FILE]``. The
corpus (``tests/program_corpus.py``) has programs in five dialects, tasks of the kind that manuals work through, files
as posts leave them, words that are refused, and the samples that LinuxCNC installs. Samples are skipped where LinuxCNC
is not installed, and where its interpreter refuses them, turns rotary axes, or makes fewer than three moves.

With nc-gcode-interpreter (``make peers``), Siemens programs without the words that it does not follow are read by it as
well. The exit code is 1 where a program is read wrongly, or a refused word is not on the list of docs/verify.md.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from tests.program_corpus import WORDS, Program, Row, corpus, judged, not_followed, read_of  # noqa: E402

try:
    import nc_gcode_interpreter
except ModuleNotFoundError:
    nc_gcode_interpreter = None
NEAR = 1e-3  # mm
BEYOND = ("TRANS", "ROT", "MIRROR", "SCALE", "RND", "CHF", "CHR", "CYCLE", "MCALL", "PROC", "G41", "G42", "AP=",
          "HOLES", "SUPA", "TRAORI", "REPEAT", "GOTO")
"""Words of Siemens that nc-gcode-interpreter reads but does not follow."""


def second_opinion(program: Program) -> str:
    """What nc-gcode-interpreter says of the places of a Siemens program: 'equal', 'apart', or '' for nothing."""
    if program.dialect != "siemens" or program.refused or any(word in program.text for word in BEYOND):
        return ""
    try:
        out: Any = nc_gcode_interpreter.nc_to_dataframe(program.text)
    except Exception:  # what it raises is its own affair: it does not take the program
        return ""
    table = out[0] if isinstance(out, tuple) else out
    if not {"X", "Y", "Z"} <= set(table.columns):
        return ""
    places = table.select("X", "Y", "Z").to_numpy().astype(float)
    places = places[~np.isnan(places).any(axis=1)]
    p = read_of(program)
    ends = p.end[np.append(p.line[1:] != p.line[:-1], True)]
    at = 0
    for end in ends[~np.isnan(ends).any(axis=1)]:
        while at < len(places) and np.abs(places[at] - end).max() > NEAR:
            at += 1
        if at == len(places):
            return "apart"
    return "equal"


def table(rows: list[Row]) -> str:
    """One row for each word: programs that have it, read and equal, refused, wrong."""
    lines = ["| word | programs | equal | refused | wrong |", "|---|---|---|---|---|"]
    for word in WORDS:
        own = [r.outcome for r in rows if word in r.words]
        if own:
            lines.append(f"| {word} | {len(own)} | {own.count('equal')} | {own.count('refused')} | "
                         f"{own.count('wrong')} |")
    return "\n".join(lines)


def main() -> int:
    """Read the corpus and print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--no-samples", action="store_true", help="without the samples that LinuxCNC installs")
    options.add_argument("--table", default="", help="a file for the table")
    given = options.parse_args()
    rows: list[Row] = []
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for n, program in enumerate(corpus(samples=not given.no_samples)):
            place = Path(folder) / str(n)
            place.mkdir()
            rows.append(judged(program, place))
    by_origin = collections.Counter((r.program.origin, r.outcome) for r in rows)
    for (origin, outcome), count in sorted(by_origin.items()):
        print(f"{origin}: {count} {outcome}")
    told = [r for r in rows if r.outcome != "skipped"]
    equal = sum(r.outcome == "equal" for r in told)
    print(f"{len(told)} programs, {equal} read and equal ({100 * equal / max(len(told), 1):.1f} %), "
          f"{time.monotonic() - begin:.0f} s")
    for r in rows:
        if r.outcome in ("refused", "wrong"):
            print(f"  {r.outcome}: {r.program.name}: {r.why[:150]}")
    print("skipped:", dict(collections.Counter(r.why[:24] for r in rows if r.outcome == "skipped")))
    listed = not_followed()
    missing = [r.program.refused for r in rows if r.program.refused and r.program.refused not in listed]
    print("refused words that docs/verify.md does not list:", missing)
    second = collections.Counter()
    if nc_gcode_interpreter is None:
        print("nc-gcode-interpreter is not installed: make peers")
    else:
        second.update(found for r in rows if (found := second_opinion(r.program)))
        print("nc-gcode-interpreter:", dict(second))
    text = table(told)
    print(text)
    if given.table:
        Path(given.table).write_text(text + "\n")
    return int(bool(missing) or any(r.outcome == "wrong" for r in rows) or second["apart"] > 0)


if __name__ == "__main__":
    sys.exit(main())
