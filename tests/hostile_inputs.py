"""STEP texts and setups that somebody broke on purpose, by seed: the same seed breaks the same way."""

from __future__ import annotations

import copy
import gzip
import io
import json
import random
import re
import zipfile
from collections.abc import Callable
from typing import Any

Rng = random.Random


def mutated_step(seed: int, text: bytes) -> tuple[str, bytes]:
    """A broken STEP file and the name of what was done to it; one to three things, the last one named."""
    rng = Rng(seed)
    name = ""
    for _ in range(rng.randint(1, 3)):
        name, way = rng.choice(STEP_WAYS)
        text = way(rng, text)
    return name, text


def mutated_setup(seed: int, setup: dict[str, Any]) -> str:
    """The text of a broken setup; most are JSON still."""
    rng = Rng(seed)
    setup = copy.deepcopy(setup)
    for _ in range(rng.randint(1, 4)):
        _break_value(rng, setup)
    text = json.dumps(setup)
    if rng.random() < 0.25:
        at = rng.randrange(len(text))
        text = rng.choice([text[:at], text[:at] + rng.choice("{}[],:\"\\\x00é\ud83d") + text[at:], "[" * 50_000 + text,
                           text + text, text.replace(":", ":-", 1), text.replace('"', "'"), "\ufeff" + text])
    return text


def _flip_bytes(rng: Rng, text: bytes) -> bytes:
    data = bytearray(text)
    for _ in range(rng.randint(1, 40)):
        if data:
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _cut(rng: Rng, text: bytes) -> bytes:
    return text[:rng.randrange(len(text) + 1)]


def _cut_but_closed(rng: Rng, text: bytes) -> bytes:
    at = text.rfind(b"\n", 0, rng.randrange(len(text) // 2, len(text) + 1))
    return text[:at] + b"\nENDSEC;\nEND-ISO-10303-21;\n"


def _drop_lines(rng: Rng, text: bytes) -> bytes:
    lines = text.split(b"\n")
    return b"\n".join(line for line in lines if rng.random() > 0.02)


def _repeat_lines(rng: Rng, text: bytes) -> bytes:
    lines = text.split(b"\n")
    at = rng.randrange(len(lines))
    return b"\n".join(lines[:at] + lines[at:at + 5] * rng.randint(2, 50) + lines[at:])


def _numbers(rng: Rng, text: bytes) -> bytes:
    odd = [b"1.E400", b"-1.E400", b"1.E308", b"0.", b"-0.", b"1.E-320", b"NAN", b"INF", b"9" * 400 + b".", b"$", b"*",
           b"'x'", b".T.", b"()", b"1.0.0", b"1e", b"-"]
    return re.sub(rb"-?\d+\.\d*(E[+-]?\d+)?", lambda m: rng.choice(odd) if rng.random() < 0.01 else m[0], text)


def _counts(rng: Rng, text: bytes) -> bytes:
    huge = [b"2147483647", b"4294967296", b"-1", b"99999999999999999999", b"1000000000", b"0"]
    return re.sub(rb"(?<=[(,])\d+(?=[,)])", lambda m: rng.choice(huge) if rng.random() < 0.2 else m[0], text)


def _references(rng: Rng, text: bytes) -> bytes:
    ids = re.findall(rb"^#\d+(?==)", text, flags=re.MULTILINE) or [b"#1"]
    return re.sub(rb"(?<=[(,])#\d+", lambda m: rng.choice(ids) if rng.random() < 0.01 else m[0], text)


def _cycles(rng: Rng, text: bytes) -> bytes:
    """Instances that refer to themselves, and in rings."""
    def ring(match: re.Match[bytes]) -> bytes:
        if rng.random() > 0.02:
            return match[0]
        return re.sub(rb"#\d+", match[1], match[0])

    return re.sub(rb"^(#\d+)=[^\n]*", ring, text, flags=re.MULTILINE)


def _nesting(rng: Rng, text: bytes) -> bytes:
    depth = rng.choice([100, 5_000, 200_000])
    line = b"#900001=LIST_OF(" + b"(" * depth + b"1." + b")" * (depth if rng.random() < 0.7 else depth // 2) + b");\n"
    return text.replace(b"ENDSEC;\nEND-", line + b"ENDSEC;\nEND-", 1)


def _long_words(rng: Rng, text: bytes) -> bytes:
    size = rng.choice([10_000, 1_000_000])
    word = rng.choice([b"'" + b"a" * size + b"'", b"A" * size, b"'" + b"''" * (size // 2), b"/*" + b"*" * size,
                       b"#" * size])
    at = text.find(b"DATA;") + 5
    return text[:at] + b"\n#900002=PRODUCT(" + word + b",'','',());\n" + text[at:]


def _many(rng: Rng, text: bytes) -> bytes:
    """A million references in one list, or a hundred thousand instances."""
    if rng.random() < 0.5:
        body = b"#900003=LIST_OF((" + b",".join([b"#1"] * 1_000_000) + b"));\n"
    else:
        body = b"".join(b"#%d=CARTESIAN_POINT('',(0.,0.,%d.));\n" % (900004 + k, k) for k in range(100_000))
    return text.replace(b"ENDSEC;\nEND-", body + b"ENDSEC;\nEND-", 1)


def _types(rng: Rng, text: bytes) -> bytes:
    kinds = [b"CARTESIAN_POINT", b"DIRECTION", b"PLANE", b"ADVANCED_FACE", b"CLOSED_SHELL", b"EDGE_CURVE", b"LINE",
             b"CYLINDRICAL_SURFACE", b"NONSENSE", b"MANIFOLD_SOLID_BREP", b"B_SPLINE_SURFACE_WITH_KNOTS", b"VECTOR"]
    return re.sub(rb"(?<==)[A-Z_]+(?=\()", lambda m: rng.choice(kinds) if rng.random() < 0.01 else m[0], text)


def _header(rng: Rng, text: bytes) -> bytes:
    odd = [b"FILE_SCHEMA(());", b"", b"FILE_SCHEMA(('X'));", b"FILE_SCHEMA((('AP238')));", b"FILE_SCHEMA((''"]
    return re.sub(rb"FILE_SCHEMA\(.*?\);", rng.choice(odd), text, count=1)


def _strings(rng: Rng, text: bytes) -> bytes:
    odd = [b"'\\X2\\D800\\X0\\'", b"'\\X4\\FFFFFFFF\\X0\\'", b"'\x00'", b"'\xff\xfe'", b"'%s%n'", b"'\r\n'", b"'"]
    return re.sub(rb"'[^'\n]*'", lambda m: rng.choice(odd) if rng.random() < 0.05 else m[0], text)


def _packed(rng: Rng, text: bytes) -> bytes:
    """A bomb: what is small here and large once unpacked."""
    if rng.random() < 0.5:
        return gzip.compress(b"0" * 10_000_000)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("part.step", b"0" * 10_000_000)
    return out.getvalue()


def _other_bytes(rng: Rng, text: bytes) -> bytes:
    return rng.choice([text.decode("latin-1").encode("utf-16"), b"\xef\xbb\xbf" + text, text.replace(b"\n", b"\r"),
                       b"\x00" * 100 + text, text + b"\x00" * 100_000, rng.randbytes(5000), text + text])


STEP_WAYS: list[tuple[str, Callable[[Rng, bytes], bytes]]] = [(w.__name__.lstrip("_"), w) for w in (
    _flip_bytes, _cut, _cut_but_closed, _drop_lines, _repeat_lines, _numbers, _counts, _references, _cycles, _nesting,
    _long_words, _many, _types, _header, _strings, _packed, _other_bytes)]

ODD: list[Any] = [
    None, True, "", "x", "lib:x", "lib:", [], {}, [[]], {"a": 1}, 0, -1, 1, 1e-300, 1e300, -1e300, 10**400, 2**63, 0.1,
    float("nan"), float("inf"), "1", "\x00", "a" * 5000, "\u202e", "../../etc/passwd", "F1", [1] * 1000, "ball", 5,
    "3-axis", {"__proto__": 1}, "\ud800", "'; DROP TABLE jobs; --", "\r\nX: y", "{{7*7}}"]


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every container of a JSON value with a key in it."""
    found: list[tuple[Any, Any]] = []
    if isinstance(value, dict | list):
        for key in list(value) if isinstance(value, dict) else range(len(value)):
            found += [(value, key), *_places(value[key])]
    return found


def _break_value(rng: Rng, setup: dict[str, Any]) -> None:
    places = _places(setup)
    holder, key = rng.choice(places) if places else (setup, "tools")
    way = rng.randrange(5)
    if way == 0 and isinstance(holder, dict):
        holder[rng.choice(["", "x", "tools", "__class__", "kind", "a" * 300, "\x00"])] = rng.choice(ODD)
    elif way == 1:
        del holder[key]
    elif way == 2 and isinstance(holder, list):
        holder.extend([copy.deepcopy(holder[key])] * rng.choice([1, 300]))
    elif way == 3 and type(holder[key]) in (int, float) and abs(holder[key]) < 10**9:
        holder[key] = holder[key] * rng.choice([-1, 0, 1e-9, 1e9, 1.0000001, 1000, 0.001])
    else:
        holder[key] = rng.choice(ODD)


FULL_SETUP: dict[str, Any] = {
    "part": {"solid": 1}, "placement": {"origin_mm": [0, 0, 0], "z_axis": [0, 0, 1], "x_axis": [1, 0, 0]},
    "access": [{"id": "A1", "direction": [0, 0, 1], "work_offset": "G54"},
               {"id": "A2", "direction": [0, 1, 0], "work_offset": "G54"}],
    "tools": [{"id": "T1", "number": 1, "kind": "ball", "diameter_mm": 3, "flutes": 2, "flute_length_mm": 9,
               "neck_diameter_mm": 2.8, "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 45,
               "holder": [{"diameter_mm": 20, "diameter_top_mm": 22, "length_mm": 30}]},
              {"id": "T2", "kind": "bull", "diameter_mm": 6, "corner_radius_mm": 1, "life_min": 60}],
    "machine": {"kind": "5-axis", "kinematics": "table-table-AC", "dialects": ["linuxcnc", "siemens"], "tcp": True,
                "rotary_deg": [[-30, 110], [-360, 360]], "pivots_mm": [[0, 0, -50], [0, 0, 0]], "max_rpm": 18000,
                "travel_mm": [500, 400, 300], "iso_axes": ["A"]},
    "stock": {"kind": "box", "margin_mm": 1, "uncertainty_mm": 0.5, "box_mm": [[-10, -10, -1], [10, 10, 20]]},
    "fixtures": [{"box_mm": [[20, 20, -5], [30, 30, 5]]}], "clearance_mm": {"neck": 0.05, "holder": 1.0},
    "quality": {"scallop_height_mm": 0.01, "coverage_min": 0.5}, "material": {
        "name": "steel", "cutting_speed_m_min": 70, "feed_per_tooth": [{"diameter_mm": 4, "feed_per_tooth_mm": 0.01}]},
    "operations": {"roughing": True, "faces": ["F1", "F2"], "exclude_faces": ["F3"], "cut_direction": "climb"},
    "labels": {"order": "4711"}}
