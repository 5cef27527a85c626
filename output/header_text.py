"""Text for the headers of NC and STEP-NC files: tools, faces and plain ASCII."""

from __future__ import annotations

import unicodedata

from geometry.tool_body import ToolBody
from toolpath.workingsteps import Workingstep

_PLAIN = str.maketrans({
    "ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe", "Ø": "Oe", "æ": "ae",
    "Æ": "Ae", "å": "aa", "Å": "Aa", "ł": "l", "Ł": "L", "–": "-", "—": "-", "µ": "u", "μ": "u", "°": " deg",
    "²": "2", "³": "3", "×": "x", "Ø".lower(): "oe", "’": "'", "‘": "'", "“": '"', "”": '"', "„": '"', "…": "...",
})


def ascii_text(text: str) -> str:
    """``text`` as one line of printable ASCII: umlauts spelt out, accents dropped, any other character as '?'."""
    spelt = unicodedata.normalize("NFKD", text.translate(_PLAIN))
    kept = (c for c in spelt if not unicodedata.combining(c))
    line = "".join(" " if c.isspace() else c if " " <= c <= "~" else "?" for c in kept)
    return " ".join(line.split())


def decimal(value: float, digits: int = 4) -> str:
    """``value`` for people: at most ``digits`` decimals, no exponent, no trailing zeros, no minus zero."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"
    return "0" if text in ("-0", "") else text


def short_words(tool: ToolBody) -> str:
    """'ball D3', 'tapered ball D1 3 deg' or 'lens D10 profile R40': kind, sizes, and angle between side and axis."""
    angle = f" {decimal(tool.taper_deg)} deg" if tool.taper > 0.0 or tool.profile_taper > 0.0 else ""
    profile = f" profile R{decimal(tool.profile_radius)}" if tool.form else ""
    return f"{tool.kind.replace('_', ' ')} D{decimal(tool.diameter)}{profile}{angle}"


def tool_words(tool: ToolBody) -> str:
    """Every dimension of a tool that a presetter can check, mm."""
    d = decimal
    cone = f" to D{d(2.0 * tool.widest_radius)}" if tool.taper > 0.0 else ""
    flat = [f"tip flat D{d(tool.tip_diameter)}"] if tool.form and tool.tip_diameter > 0.0 else []
    words = [short_words(tool), *flat, f"corner R{d(tool.corner_radius)}", f"flute length {d(tool.flute_length)}{cone}"]
    if tool.neck_length > tool.flute_length:
        words.append(f"neck D{d(tool.neck_diameter)} to {d(tool.neck_length)}")
    words += [f"shank D{d(tool.shank_diameter)}", f"stickout {d(tool.stickout)}"]
    return ", ".join(words)


def tool_name(tool: ToolBody) -> str:
    """'T1: ball D3, ...': number, id where it differs from the number, and every dimension."""
    own = "" if tool.id == f"T{tool.number}" else f" {tool.id}"
    return f"T{tool.number}{own}: {tool_words(tool)}"


def face_words(step: Workingstep) -> str:
    """'F12 F13', or '' for a step without faces."""
    return " ".join(f"F{n}" for n in step.faces)


def height_word(step: Workingstep) -> str:
    """'Z', or 'height along the axis of I1' for a step in the frame of an access."""
    return f"height along the axis of {step.access}" if step.access else "Z"


def step_title(step: Workingstep) -> str:
    """The name of a step; it begins with the id of the step."""
    return step.name if step.name.split(" ", 1)[0] == step.id else f"{step.id} {step.name}".strip()
