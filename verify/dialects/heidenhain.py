"""Heidenhain, conversational: a keyword opens each block, FMAX makes a rapid for one block, F stays.

Read are BEGIN and END PGM, BLK FORM, TOOL CALL and TOOL DEF, L, M words, LBL, STOP, and of the cycles 247 (preset) and
32 (tolerance). Radius compensation, incremental words (IX), arcs, Q parameters, calls, shifts and tilted planes are
refused by name.
"""

from __future__ import annotations

import re

from verify.dialects.base import NUMBER, BlockError, Control, zero_word

_NUM = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"
_LINE = re.compile(rf"L((?: +[XYZABC]{_NUM})*)(?: +R0)?(?: +(FMAX|F{_NUM}))?((?: +M[0-9]+)*)")
_TOOL = re.compile(rf'TOOL CALL(?: +"?([0-9]+)"?)?(?: +([XYZ]))?(?: +S({NUMBER}))?(?: +F({NUMBER}))?'
                   r"(?: +D[LR][+-]?0*\.?0*)*")
_BEGIN = re.compile(r"BEGIN PGM (?:\S.*)? ?(MM|INCH)")
_START, _END = (3, 4, 8, 13, 14, 128), (0, 1, 2, 5, 9, 30, 129)  # when in the block an M word takes effect
_WORDS = {13: "M3 M8", 14: "M4 M8", 128: "M428", 129: "M429"}
_IDLE = ("BLK FORM", "TOOL DEF", "CYCL DEF 32.0", "* -")


def is_conversational(text: str) -> bool:
    """Whether a text begins as a program in plain language does."""
    return re.match(r"\s*(?:[0-9]+\s+)?BEGIN PGM\b", text.upper()) is not None


class Heidenhain(Control):
    """TNC 320 to 640, iTNC 530, TNC7."""

    def __init__(self) -> None:
        super().__init__()
        self.preset = False

    def blocks(self, raw: str) -> list[str]:
        """By the keyword the block opens with."""
        text = re.sub(r"^\s*[0-9]+\s+(?=[A-Z*;])", "", raw.upper()).split(";", 1)[0].strip()
        if m := _LINE.fullmatch(text):
            return self._straight(m[1], m[2], [int(w[1:]) for w in m[3].split()])
        if self.preset:
            return self._preset(text)
        if not text or text.startswith(_IDLE) or re.fullmatch(r'LBL +(?:[0-9]+|"[^"]*")', text):
            return []
        if m := _BEGIN.fullmatch(text):
            return [f"G{21 if m[1] == 'MM' else 20} G17 G90 G94 G40"]
        if m := _TOOL.fullmatch(text):
            return self._tool(m)
        if re.fullmatch(r"(?:STOP)?(?: *M[0-9]+)*", text):
            return self._machine([int(w) for w in re.findall(r"M([0-9]+)", text)], "M0" if "STOP" in text else "")
        if m := re.fullmatch(rf"CYCL DEF 32\.1 T({NUMBER})", text):
            return [f"G64 P{float(m[1]):.6f}"]
        if re.fullmatch(rf"CYCL DEF 32\.2(?: HSC-MODE:[01])?(?: TA{NUMBER})?", text):
            return []
        if re.fullmatch(r"CYCL DEF 247( [A-Z -]*)? ?~", text):
            self.preset = True
            return []
        return ["M30"] if text.startswith("END PGM") else self._no(text)

    def _no(self, text: str) -> list[str]:
        raise BlockError(f"cannot read '{text[:60]}'")

    def _preset(self, text: str) -> list[str]:
        self.preset = False
        m = re.fullmatch(r"Q339= *\+?([0-9]+)", text)
        if m is None:
            raise BlockError(f"cycle 247 goes on with '{text[:40]}', not with Q339, the row of the preset table")
        return [zero_word(int(m[1]), f"preset {m[1]}")]

    def _tool(self, m: re.Match[str]) -> list[str]:
        if m[2] not in (None, "Z"):
            raise BlockError(f"TOOL CALL with the tool axis {m[2]}: only Z is read")
        out = [f"S{m[3]}"] if m[3] else []
        out += [f"F{m[4]}"] if m[4] else []
        if m[1]:
            out = [f"T{m[1]} M6", *out, *([f"G43 H{m[1]}"] if int(m[1]) else [])]
        return out

    def _straight(self, places: str, feed: str | None, ms: list[int]) -> list[str]:
        words = " ".join(places.split())
        if not ms:
            return [f"G0 {words}" if feed == "FMAX" else f"G1 {words} {feed}" if feed else f"G1 {words}"]
        if unknown := [m for m in ms if m not in (*_START, *_END, 91)]:
            raise BlockError(f"unknown word M{unknown[0]}")
        motion = "G0" if feed == "FMAX" else "G1"
        machine = "G53 " if 91 in ms else ""
        rate = feed if feed and feed != "FMAX" else ""
        block = f"{machine}{motion} {words} {rate}".strip() if words else rate
        before = [_WORDS.get(m, f"M{m}") for m in ms if m in _START]
        after = [_WORDS.get(m, f"M{m}") for m in ms if m in _END]
        return [*before, *([block] if block else []), *after]

    def _machine(self, ms: list[int], stop: str) -> list[str]:
        if unknown := [m for m in ms if m not in (*_START, *_END)]:
            raise BlockError(f"unknown word M{unknown[0]}")
        return [*(_WORDS.get(m, f"M{m}") for m in ms), *([stop] if stop else [])]
