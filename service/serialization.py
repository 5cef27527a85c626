"""Plans and proofs as bytes and back: plain values, arrays and the classes in this module; nothing executable.

    8 bytes      length of the words, little-endian
    words        JSON, UTF-8: the tree of values, in which an array is its type, shape and place
    arrays       one after the other, each at a multiple of ``ALIGNED`` from the end of the words

The result equals the input. A number keeps its type (a numpy scalar rounds otherwise than a float). An array keeps its
type, shape, memory order and bits. Objects that both sides have are packed by name (``Known``).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from geometry.machine_rates import Rates
from toolpath.counterexamples import Counterexamples, HighWall
from toolpath.plan_checkpoint import FinishSnapshot, LayersSnapshot, PackedLines, PlanSnapshot, ToolSnapshot
from toolpath.planning.job_plan import Plan
from toolpath.planning.zone_finishing import ZonePlan
from toolpath.stock.stock_map import StockSnapshot
from toolpath.tool_deflection import DeflectionEstimate
from toolpath.workingsteps import ArcSpan, CutDirection, Trajectory, TrajectoryKind, Workingstep
from verify.assumptions import Assumed, AssumedKind
from verify.cutting_words import ProgramCaution
from verify.model import Engagement, FaceProof, Finding, FindingKind, Proof, Spent, Support, ZoneProof
from zones.lattice import Lattice

ALIGNED = 64
CLASSES: dict[str, Any] = {c.__name__: c for c in (
    Plan, Workingstep, Trajectory, ArcSpan, Rates, DeflectionEstimate, ZonePlan, Counterexamples, HighWall, Lattice,
    Proof, Finding, Engagement, Spent, Support, ZoneProof, FaceProof, PlanSnapshot, StockSnapshot, ToolSnapshot,
    LayersSnapshot, FinishSnapshot, PackedLines, Assumed, ProgramCaution)}
ENUMS: dict[str, Any] = {e.__name__: e for e in (CutDirection, TrajectoryKind, FindingKind, AssumedKind)}
PLAIN = (type(None), bool, int, float, str)


@dataclass(frozen=True)
class Known:
    """Objects that are packed by name: the name of their class, then their ``id``."""

    objects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def pack(value: Any, known: Known = Known()) -> bytearray:
    """A value as bytes.

    Raises
    ------
    TypeError
        A part of the value has a class that is not listed here.
    """
    arrays: list[np.ndarray] = []
    words = json.dumps(_tree(value, known, arrays, [0]), separators=(",", ":")).encode()
    out = bytearray(len(words).to_bytes(8, "little") + words)
    begin = len(out)
    for a in arrays:
        out += bytes(-(len(out) - begin) % ALIGNED)
        out += a.tobytes(order="A")
    return out


def unpack(data: bytes | bytearray | memoryview, known: Known = Known()) -> Any:
    """The packed value.

    Raises
    ------
    ValueError, KeyError, TypeError
        The bytes are not from ``pack``, or name an unknown object.
    """
    begin = 8 + int.from_bytes(data[:8], "little")
    # a copy, so that the arrays are writable like those of a plan
    room = np.frombuffer(data, np.uint8, offset=begin).copy()
    return _value(json.loads(bytes(data[8:begin])), known, room)


def _tree(value: Any, known: Known, arrays: list[np.ndarray], used: list[int]) -> Any:
    kind = type(value)
    if kind in PLAIN:
        return value
    if kind is tuple:
        return [_tree(v, known, arrays, used) for v in value]
    if isinstance(value, np.ndarray):
        turned = value.flags.f_contiguous and not value.flags.c_contiguous
        if value.dtype.hasobject:
            raise TypeError("an array of objects cannot be packed")
        place = used[0] + -used[0] % ALIGNED
        used[0] = place + value.nbytes
        arrays.append(value if turned else np.ascontiguousarray(value))
        return {"a": [value.dtype.str, list(value.shape), place, turned]}
    if kind.__name__ in known.objects:
        if known.objects[kind.__name__].get(value.id) != value:
            raise TypeError(f"{kind.__name__} {value.id} differs from the known one")
        return {"k": [kind.__name__, value.id]}
    if isinstance(value, np.generic):
        return {"n": [value.dtype.str, value.item()]}
    if isinstance(value, Enum) and kind.__name__ in ENUMS:
        return {"e": [kind.__name__, value.value]}
    if is_dataclass(value) and kind.__name__ in CLASSES:
        return {"c": [kind.__name__, *(_tree(getattr(value, f.name), known, arrays, used) for f in fields(value))]}
    if kind is list:
        return {"l": [_tree(v, known, arrays, used) for v in value]}
    if isinstance(value, Mapping):
        return {"m": [[_tree(k, known, arrays, used), _tree(v, known, arrays, used)] for k, v in value.items()]}
    raise TypeError(f"a {kind.__name__} cannot be packed")


def _value(tree: Any, known: Known, room: np.ndarray) -> Any:
    if isinstance(tree, list):
        return tuple(_value(t, known, room) for t in tree)
    if not isinstance(tree, dict):
        return tree
    ((mark, packed),) = tree.items()
    if mark == "a":
        kind, shape, place, turned = packed
        dtype = np.dtype(kind)
        size = dtype.itemsize * int(np.prod(shape, dtype=np.int64))
        if place + size > len(room):
            raise ValueError("an array extends beyond the end")
        return room[place:place + size].view(dtype).reshape(shape, order="F" if turned else "C")
    if mark == "k":
        return known.objects[packed[0]][packed[1]]
    if mark == "n":
        return np.dtype(packed[0]).type(packed[1])
    if mark == "e":
        return ENUMS[packed[0]](packed[1])
    if mark == "c":
        made = CLASSES[packed[0]]
        return made(*(_value(t, known, room) for t in packed[1:]))
    if mark == "l":
        return [_value(t, known, room) for t in packed]
    if mark == "m":
        return {_value(k, known, room): _value(v, known, room) for k, v in packed}
    raise ValueError(f"a mark {mark!r} is unknown")


__all__ = ["Known", "pack", "unpack"]
