"""Parameters that a control serves: those the reader knows, and those of which it knows only the name."""

from __future__ import annotations

import math

from verify.gcode.block_words import WORK_OFFSETS, BlockError
from verify.program.program import State

POSITION = {5420: 0, 5421: 1, 5422: 2, "_x": 0, "_y": 1, "_z": 2}
_UNKNOWN = ("_vmajor", "_vminor", "_task", "_a", "_b", "_c", "_u", "_v", "_w", "_abs_x", "_abs_y", "_abs_z", "_abs_a",
            "_abs_b", "_abs_c", "_mist", "_flood", "_speed_override", "_feed_override", "_adaptive_feed", "_feed_hold",
            "_current_pocket", "_selected_pocket", "_remap_level", "_line")
_KNOWN = ("_x", "_y", "_z", "_motion_mode", "_plane", "_ccomp", "_metric", "_imperial", "_absolute", "_incremental",
          "_inverse_time", "_units_per_minute", "_units_per_rev", "_coord_system", "_tool_offset", "_retract_r_plane",
          "_retract_old_z", "_spindle_rpm_mode", "_spindle_css_mode", "_ijk_absolute_mode", "_lathe_diameter_mode",
          "_lathe_radius_mode", "_spindle_on", "_feed", "_rpm", "_current_tool", "_selected_tool")
NAMES = frozenset(_UNKNOWN + _KNOWN + ("_value", "_value_returned", "_call_level"))


def is_served(name: str) -> bool:
    """Whether LinuxCNC serves a parameter of this name, known to the reader or not."""
    return name in NAMES or name.startswith(("_ini[", "_hal["))


def served(state: State, key: int | str) -> float:
    """A parameter of the control, in units of the program.

    state : of the reading
    key   : number above 5000, or name

    Raises
    ------
    BlockError
        It is unknown: the program has not stated it, or it belongs to the machine.
    """
    label = f"#{key}" if isinstance(key, int) else f"#<{key}>"
    if key in POSITION:
        k = POSITION[key]
        place = (state.position[k] - state.origin[k]) / state.scale
        if k == 2 and state.length_off:
            raise BlockError(f"{label} is not the place of the tip while the length offset is off; give G43 "
                             f"H{state.tool} first")
        if math.isnan(place):
            raise BlockError(f"{label} is unknown because the program has not stated {'XYZ'[k]}; state it first")
        return place
    found = _mode(state, {5220: "_coord_number", 5400: "_current_tool"}.get(key, "") if isinstance(key, int) else key)
    if found is None:
        raise BlockError(f"{label} is a parameter of the control that the proof cannot know; write the number instead")
    if math.isnan(found):
        raise BlockError(f"{label} is unknown because the program has not stated it; state it first")
    return found


def _mode(s: State, name: str) -> float | None:
    """Value of a named mode; None where the reader does not keep it."""
    offset = next(g for g, word in WORK_OFFSETS.items() if word == s.work_offset)
    motion = math.nan if s.motion is None else s.motion * 10
    modes: dict[str, float] = {
        "_motion_mode": motion, "_plane": s.plane * 10, "_ccomp": {0: 400, 1: 410}.get(s.side, 420),
        "_metric": s.scale == 1.0,
        "_imperial": s.scale != 1.0, "_absolute": not s.relative, "_incremental": s.relative,
        "_inverse_time": s.feed_mode == 93, "_units_per_minute": s.feed_mode == 94, "_units_per_rev": s.feed_mode == 95,
        "_coord_system": offset * 10, "_coord_number": list(WORK_OFFSETS).index(offset) + 1,
        "_tool_offset": s.offset is not None, "_retract_r_plane": s.retract_to_r,
        "_retract_old_z": not s.retract_to_r, "_spindle_rpm_mode": 1, "_spindle_css_mode": 0,
        "_ijk_absolute_mode": s.centre_absolute, "_lathe_diameter_mode": 0, "_lathe_radius_mode": 1,
        "_spindle_on": s.spindle, "_feed": s.feed / (1.0 if s.feed_mode == 93 else s.scale), "_rpm": s.speed,
        "_current_tool": s.tool, "_selected_tool": s.selected,
    }
    found = modes.get(name)
    return None if found is None else float(found)
