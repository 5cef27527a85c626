"""The controls for which programs are written, one file of data and rules each.

>>> sorted(DIALECTS)
['fanuc', 'haas', 'heidenhain', 'linuxcnc', 'siemens']
"""

from __future__ import annotations

from output.gcode.dialects.base import Dialect, Switches
from output.gcode.dialects.fanuc import Fanuc
from output.gcode.dialects.haas import Haas
from output.gcode.dialects.heidenhain import Heidenhain
from output.gcode.dialects.linuxcnc import LinuxCnc
from output.gcode.dialects.siemens import Siemens

DIALECTS: dict[str, type[Dialect]] = {d.name: d for d in (LinuxCnc, Fanuc, Haas, Siemens, Heidenhain)}
"""The dialect classes by their names in ``machine.dialects``."""

__all__ = ["DIALECTS", "Dialect", "Switches"]
