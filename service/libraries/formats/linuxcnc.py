"""LinuxCNC: ``tool.tbl``, one tool a line, words of a letter and a number, and a remark behind a semicolon.

T is the tool, P its pocket, D the diameter in the unit of the machine; X to W are offsets that were measured on it.
The table states no kind. A remark may: in words, or as this module writes it, ``kind=ball flutes=2``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from geometry.errors import LibraryError
from service.libraries.containers import text_of
from service.libraries.entry import Entry, Source, check_count, shown
from service.libraries.formats.kind_words import kind_of_words

_WORD = re.compile(r"([A-Za-z])\s*([-+]?(?:\d+\.?\d*|\.\d+))(?=[\sA-Za-z]|$)")
_PAIR = re.compile(r"\b([a-z_]+)=(\S+)")
REMARKED = ("corner_radius_mm", "profile_radius_mm", "taper_angle_deg", "point_angle_deg", "tip_diameter_mm",
            "pitch_mm", "flutes",
            "flute_length_mm", "neck_diameter_mm", "neck_length_mm", "shank_diameter_mm", "stickout_mm")
"""Fields that the remark carries, since the table has no words for them; lengths in mm."""
_KINDS = ("flat", "ball", "bull", "tapered_flat", "tapered_ball", "tapered_bull", "lens", "barrel", "drill", "tap",
          "chamfer", "thread_mill")
LINE = re.compile(r"^\s*T\s*\d+\s+(?:P\s*\d+\s*)?(?:[A-Z]\s*[-+]?[\d.]+\s*)*(?:;.*)?$")
"""A line of a tool table, to tell one from other texts."""


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a tool table.

    Raises
    ------
    LibraryError
        unit_missing: the caller states no unit, and no line ``;unit=mm`` or ``;unit=in`` does; or as ``text_of``.
    """
    lines = text_of(data, source.encoding).splitlines()
    stated = next((m.group(1) for line in lines if (m := re.match(r"\s*;\s*unit=(\w+)", line))), None)
    out: list[Entry] = []
    for number, line in enumerate(lines, start=1):
        words, _, remark = line.partition(";")
        if words.strip():
            out.append(_entry(words, remark.strip(), number, stated, source))
            check_count(len(out))
    return out


def _entry(words: str, remark: str, line: int, stated: str | None, source: Source) -> Entry:
    entry = Entry(f"line {line}", description=remark, stated_kind=remark)
    rest = _WORD.sub(" ", words).strip()
    found = {m.group(1).upper(): m.group(2) for m in _WORD.finditer(words)}
    if rest or "T" not in found:
        entry.leave_out(f"the line has '{shown(rest)}', which is no word of a tool table" if rest else
                        "the line has no T word")
        return entry
    entry.t_number, entry.pocket = entry.whole("T", found["T"]), entry.whole("P", found.get("P"))
    entry.library_id = f"T{entry.t_number}"
    unit = source.unit_of(entry, stated)
    entry.length("diameter_mm", found.get("D"), unit)
    pairs = dict(_PAIR.findall(remark))
    if pairs.get("kind") in _KINDS:
        entry.kind = pairs["kind"]
        entry.library_id = pairs.get("id", entry.library_id)
        entry.description = _PAIR.sub("", remark).strip()
        for name in REMARKED:
            if name == "flutes":
                entry.count(name, pairs.get(name))
            else:
                entry.number(name, pairs.get(name), zero=name in ("corner_radius_mm", "tip_diameter_mm"))
        return entry
    entry.kind = kind_of_words(remark)
    if not entry.kind:
        entry.leave_out("the table states no kind, and its remark names none that is available: "
                        f"'{shown(remark)}'; write kind=flat, for example, into the remark")
    else:
        entry.note(f"kind {'flat' if entry.kind == 'mill' else entry.kind} is read from the remark '{shown(remark)}'")
    if entry.kind in ("bull", "chamfer", "tapered"):
        entry.leave_out(f"a tool of kind {entry.kind} needs its radius or angle, which the table does not state")
    if any(float(found.get(k, 0)) for k in "XYZUVW"):
        entry.note("the offsets of the table were measured on its machine, and are left out")
    return entry


def write(entries: Sequence[Entry]) -> bytes:
    """A tool table in mm; what the table has no word for stands in the remarks.

    Raises
    ------
    LibraryError
        no_number: a tool has no T number, which a tool table needs.
    """
    lines = [";unit=mm"]
    for entry in entries:
        if entry.t_number is None:
            raise LibraryError(f"tool {entry.library_id} has no number, and a tool table needs T numbers",
                               code="no_number", subjects=(entry.library_id,), remedy="give number to each tool")
        v = entry.values
        pairs = [f"kind={entry.kind}", f"id={entry.library_id.replace(' ', '_')}"]
        pairs += [f"{k}={v[k]!r}" for k in REMARKED if k in v]
        lines.append(f"T{entry.t_number} P{entry.pocket or entry.t_number} D{v['diameter_mm']!r} "
                     f";{shown(entry.description.replace(';', ','), 400)} {' '.join(pairs)}")
    return ("\n".join(lines) + "\n").encode()


__all__ = ["LINE", "REMARKED", "read", "write"]
