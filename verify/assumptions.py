"""What a proof takes for granted because neither setup nor program states it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class AssumedKind(StrEnum):
    """What may be taken for granted, in the order of a report."""

    DIALECT = "dialect"
    TRAVEL = "travel"
    MAX_RPM = "max_rpm"
    ROTARY_SENSE = "rotary_sense"
    ROTARY_START = "rotary_start"
    ROTARY_WAY = "rotary_way"
    AXIS_WAY = "axis_way"
    MODES_LEFT = "modes_left"
    TIP_CONTROL = "tip_control"
    LENGTH_AXIS = "length_axis"
    LENGTH_REGISTER = "length_register"
    RADIUS_REGISTER = "radius_register"
    TAP_DIAMETER = "tap_diameter"
    GAUGE_LENGTH = "gauge_length"
    FLUTE_LENGTH = "flute_length"
    HOLDER = "holder"
    ABOVE_HOLDER = "above_holder"
    TABLE = "table"
    LOOSE_STOCK = "loose_stock"
    OTHER_SOLIDS = "other_solids"
    RAPID_PATH = "rapid_path"
    PATH_MODE = "path_mode"
    CHANGE_POSITION = "change_position"
    COOLANT = "coolant"
    CUTTING_FORCE = "cutting_force"
    BETWEEN_SAMPLES = "between_samples"


@dataclass(frozen=True)
class Assumed:
    """One assumption of a proof. It is no finding.

    what   : AssumedKind
    value  : what the proof takes it to be, a number, a word or a sentence
    effect : what may go wrong on a machine where it is otherwise
    remedy : the field of the setup, or the words of the program, that state it
    """

    what: AssumedKind
    value: str | float
    effect: str
    remedy: str

    def as_dict(self) -> dict[str, Any]:
        """Plain data for a report."""
        return {**asdict(self), "what": str(self.what)}


def in_order(assumed: Iterable[Assumed]) -> tuple[Assumed, ...]:
    """Assumptions in the order of ``AssumedKind``, each once; equal kinds keep their order.

    >>> a = Assumed(AssumedKind.TABLE, "0 mm", "a tool may mill into the table", "machine.table_z_mm")
    >>> b = Assumed(AssumedKind.DIALECT, "fanuc", "the program may mean another control", "machine.dialects")
    >>> [str(x.what) for x in in_order([a, b, a])]
    ['dialect', 'table']
    """
    kinds = list(AssumedKind)
    return tuple(sorted(dict.fromkeys(assumed), key=lambda a: kinds.index(a.what)))


__all__ = ["Assumed", "AssumedKind", "in_order"]
