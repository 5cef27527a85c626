"""Whether two releases plan and prove the same: jobs of both, compared byte for byte but for renamed words.

    python benchmarks/jobs/same_output.py make FOLDER             # run in each of the two checkouts, with its
    environment python benchmarks/jobs/same_output.py compare BEFORE AFTER

``make`` runs the demo on three axes, the demo on five axes, a small job for all controls, and one verification for each
control. ``compare`` maps the renamed strategy words, leaves the version out, and drops prose: messages, remedies and
notes. Any other difference is printed, and the exit status is 1.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

STRATEGIES = {"zlevel": "waterline", "floor": "planar_floor", "layers": "depth_layers", "matched": "curvature_matched",
              "led": "inclined_axis", "spot": "touch_points"}
FIVE_AXES = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}
CONTROLS = {"siemens": "mpf", "linuxcnc": "ngc", "fanuc": "nc", "haas": "nc", "heidenhain": "h"}
PROSE = {"message", "remedy", "note", "notes", "text", "description", "hint"}
DERIVED = {"version", "sha256"}  # of the files, which are compared themselves
TEXTS = {".ngc", ".nc", ".mpf", ".h", ".stpnc"}
MAPPED_AWAY = {".png", ".pdf", ".html", ".bin"}  # pictures, sheets and page data show prose and line numbers


def run(*arguments: str) -> str:
    """Run the command line in this checkout; its standard output. A job that is not proved ends with 3."""
    done = subprocess.run([sys.executable, "-m", "service.cli", *arguments], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        raise SystemExit(f"{' '.join(arguments)} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return done.stdout


def plan(folder: Path, part: Path, setup: dict[str, Any]) -> None:
    """Plan one job into ``folder``."""
    folder.mkdir(parents=True)
    (folder / "setup.json").write_text(json.dumps(setup))
    run("plan", str(part), "--setup", str(folder / "setup.json"), "--out", str(folder))


def make(folder: Path) -> None:
    """Run all jobs into ``folder``, which must not exist."""
    from examples.demo import write_demo, write_small

    part, setup_path = write_demo(folder / "parts")
    small, small_path = write_small(folder / "parts")
    setup, small_setup = json.loads(setup_path.read_text()), json.loads(small_path.read_text())
    plan(folder / "controls", small, {**small_setup, "machine": {"dialects": list(CONTROLS)}})
    for control, ending in CONTROLS.items():
        program = folder / "controls" / f"program.{control}.{ending}"
        setup_file = str(folder / "controls" / "setup.json")
        report = run("verify", str(small), "--setup", setup_file, "--program", str(program), "--dialect", control)
        (folder / f"verification.{control}.json").write_text(report)
    leaning = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-110, 110], [-360, 360]]}
    plan(folder / "small_on_five_axes", small,
         {**small_setup, "machine": leaning, "operations": {"lean": {"lead_deg": 10}}})
    plan(folder / "demo", part, setup)
    plan(folder / "demo_on_five_axes", part, {**setup, "machine": FIVE_AXES})


def renamed(text: str) -> str:
    """Old strategy words as the new ones, where a program or STEP-NC file names a strategy."""
    def new(match: re.Match[str]) -> str:
        word = STRATEGIES[match[1].lower()]
        return word.upper() if match[1].isupper() else word  # some controls show capitals only

    words = "|".join(STRATEGIES)
    return re.sub(rf"(?<=[ '(,])(?<!between )({words})(?=[ ',:;)])", new, text, flags=re.IGNORECASE)


def plain(value: Any, key: str = "") -> Any:
    """A report without prose and version, strategy words as they are now."""
    if isinstance(value, dict):
        prose = PROSE | {"reason"} if key == "rejected" else PROSE  # elsewhere a reason is a code
        return {k: plain(v, k) for k, v in value.items() if k not in prose | DERIVED}
    if isinstance(value, list):
        return [plain(v, key) for v in value]
    if isinstance(value, str) and key == "warnings":
        return ""  # prose; how many there are counts
    if isinstance(value, str) and key == "strategy":
        return STRATEGIES.get(value, value)
    return renamed(f" {value} ") if isinstance(value, str) and key == "name" else value


def lines_of(text: str, suffix: str) -> tuple[list[str], list[str]]:
    """The blocks of a program or STEP-NC file without comments and block numbers, and the words of its comments.

    A longer word wraps a comment elsewhere and counts blocks on, which moves nothing. The version is left out.
    """
    text = re.sub(r"zonemill [0-9][\w.+-]*", "zonemill", renamed(text), flags=re.IGNORECASE)
    if suffix == ".stpnc":
        return text.splitlines(), []
    blocks, words = [], []
    for line in text.splitlines():
        line = re.sub(r"^N?\d+ ", "", line)
        comment = re.search(r"\((.*)\)|;(.*)", line)
        if comment:
            words += (comment[1] or comment[2] or "").split()
            line = line.replace(comment[0], "")
        blocks += [line.rstrip()] if line.strip() else []
    return blocks, words


def differences(before: Path, after: Path) -> list[str]:
    """Every difference between two folders of ``make`` that is no renamed word, version or prose."""
    out = []
    names = {p.relative_to(before) for p in before.rglob("*") if p.is_file()}
    names ^= {p.relative_to(after) for p in after.rglob("*") if p.is_file()}
    out += [f"{name}: only in one of the two" for name in sorted(names)]
    for path in sorted(p for p in before.rglob("*") if p.is_file() and (after / p.relative_to(before)).is_file()):
        name, other = path.relative_to(before), after / path.relative_to(before)
        if path.suffix == ".json":
            a, b = plain(json.loads(path.read_text())), plain(json.loads(other.read_text()))
            if a != b:
                out += [f"{name}: {line}" for line in _where(a, b)]
        elif path.suffix in TEXTS:
            pairs = zip(*(lines_of(p.read_text(), path.suffix) for p in (path, other)), strict=True)
            for what, (a, b) in zip(("block", "word"), pairs, strict=True):
                out += [f"{name}: {len(a)} {what}s, {len(b)} after"] if len(a) != len(b) else []
                unlike = [(k, x, y) for k, (x, y) in enumerate(zip(a, b, strict=False), 1) if x != y]
                out += [f"{name}, {what} {k}: {x!r} -> {y!r}" for k, x, y in unlike[:10]]
        elif path.suffix not in MAPPED_AWAY and path.read_bytes() != other.read_bytes():
            out.append(f"{name}: other bytes")
    return out


def _where(a: Any, b: Any, at: str = "") -> list[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        out = [f"{at}/{k}: only in one of the two" for k in a.keys() ^ b.keys()]
        return out + [line for k in a.keys() & b.keys() for line in _where(a[k], b[k], f"{at}/{k}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [line for k, (x, y) in enumerate(zip(a, b, strict=True)) for line in _where(x, y, f"{at}/{k}")]
    return [] if a == b else [f"{at}: {a!r} -> {b!r}"]


def main() -> int:
    """Command line; 0 where nothing differs."""
    match sys.argv[1:]:
        case ["make", folder]:
            sys.path.insert(0, str(Path.cwd()))
            make(Path(folder))
            return 0
        case ["compare", before, after]:
            found = differences(Path(before), Path(after))
            print("\n".join(found) or "the same but for renamed words, version and prose")
            return 1 if found else 0
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main())
