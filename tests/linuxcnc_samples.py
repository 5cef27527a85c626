"""The sample programs that LinuxCNC installs, each made a whole program."""

import os
import re
from pathlib import Path

from tests.rs274 import RS274

PREFIX = Path(RS274).resolve().parents[1] if RS274 else Path()
FOLDERS = [PREFIX / "share" / "doc" / "linuxcnc" / "examples" / "nc_files", PREFIX / "share" / "linuxcnc" / "ncfiles",
           PREFIX / "share" / "doc" / "linuxcnc" / "examples" / "sample-configs"]
_CALLED = re.compile(r"^\s*o<([\w-]+)>\s*call\b", re.IGNORECASE | re.MULTILINE)
_DEFAULT = re.compile(r"=\s*#([0-9]+)\s*\(=\s*([-+.0-9]+)")
_SUB = re.compile(r"^\s*o<([\w-]+)>\s*sub\b(.*?)^\s*o<\1>\s*endsub[^\n]*", re.IGNORECASE | re.MULTILINE | re.DOTALL)


def sample_files():
    """Every sample once, by name; the folders are links to one another in part."""
    found = {}
    for folder in FOLDERS:
        for root, _, names in os.walk(folder, followlinks=True):
            for name in sorted(names):
                if name.endswith((".ngc", ".nc", ".tap")):
                    text = (Path(root) / name).read_text(errors="replace")
                    found.setdefault(text, f"{Path(root).name}/{name}")
    return sorted(((name, text) for text, name in found.items()), key=lambda pair: pair[0])


def complete(name, text, subs):
    """A program of a sample: the subroutines it calls are put in front, and one that is a subroutine is called with the
    values its comments propose. It starts at the zero where the interpreter does."""
    stem = Path(name).stem.lower()
    own = _SUB.search(text)
    if own and own[1].lower() == stem:
        given = {int(n): value for n, value in _DEFAULT.findall(own[0])}
        values = " ".join(f"[{given.get(n, '1')}]" for n in range(1, max(given, default=0) + 1))
        text = f"G21 F100 S100 M3\no<{own[1]}> call {values}\nM2\n"
        needed = [stem]
    else:
        needed = []
    needed += [called.lower() for called in _CALLED.findall(text)]
    have = {found[1].lower() for found in _SUB.finditer(text)}
    front = []
    while needed:
        called = needed.pop()
        if called in have or called not in subs:
            continue
        have.add(called)
        front.append(subs[called] + "\n")
        needed += [more.lower() for more in _CALLED.findall(subs[called])]
    lines = text.split("\n")
    at = 1 if lines[0].strip() == "%" else 0
    return "\n".join([*lines[:at], *front, "G0 X0 Y0 Z0", *lines[at:]])


def programs():
    files = sample_files()
    subs = {found[1].lower(): found[0] for name, text in files for found in _SUB.finditer(text)
            if found[1].lower() == Path(name).stem.lower()}
    return [(name, complete(name, text, subs)) for name, text in files]


def has_gaps(text):
    """Whether a program goes to the machine's own places or changes a tool, after which the reader waits for axes."""
    return re.search(r"(?i)G\s*0*(28|30|53)(?![0-9])|M\s*0*6(?![0-9])", text) is not None


def without_own_words(text):
    """The text without M100 to M199 and their P and Q: they move no axis."""
    return re.sub(r"(?i)\bM1[0-9]{2}(?![0-9])(\s*[PQ]\s*[-+.0-9]+)*", "", text)
