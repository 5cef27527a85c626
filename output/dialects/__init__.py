"""The controls programs are written for, each one file of data and rules.

>>> sorted(DIALECTS)
['fanuc', 'haas', 'heidenhain', 'linuxcnc', 'siemens']
"""

from __future__ import annotations

from output.dialects.base import Dialect, Switches
from output.dialects.fanuc import Fanuc
from output.dialects.haas import Haas
from output.dialects.heidenhain import Heidenhain
from output.dialects.linuxcnc import LinuxCnc
from output.dialects.siemens import Siemens

DIALECTS: dict[str, type[Dialect]] = {d.name: d for d in (LinuxCnc, Fanuc, Haas, Siemens, Heidenhain)}
"""By the name that ``machine.dialects`` has for it."""

__all__ = ["DIALECTS", "Dialect", "Switches"]
