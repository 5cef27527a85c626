"""Moves of Heidenhain controls: L, LN, LP, C, CR, CT, CP and CTP."""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Mapping
from dataclasses import replace

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.heidenhain.heidenhain_edges import HeidenhainEdges
from verify.gcode.dialects.heidenhain.heidenhain_words import M_AFTER, M_BEFORE, M_WORDS, Blocks, Move, Words
from verify.gcode.dialects.stated_places import digits
from verify.gcode.dialects.tilted_planes import turn
from verify.gcode.machine_words import HEIDENHAIN_M

_KEY = re.compile(r"(LN|LP|L|CTP|CT|CP|CR|CC|C|RND|CHF|APPR|DEP)(?![A-Z])\s*")


class HeidenhainPaths(HeidenhainEdges):
    """Motion of the control.

    cycle_place : (3,) mm, place of CYCL CALL POS, None before the first
    """

    cycle_place: list[float] | None = None

    def plain_line(self, words: str, feed: str | None, ms: list[int]) -> list[str]:
        """Blocks of an L whose words the reader takes as they are."""
        self._check_m91(91 in ms)
        self.shortest |= 126 in ms
        self.note_place()
        self.heading = None
        self._note_turns({w[0]: float(w[1:]) for w in words.split() if w[0] in "ABC"})
        rapid = feed == "FMAX"
        rate = self.counted(float(feed[1:]), False) if feed and not rapid else ""
        self.rate, self.last_rapid = rate or self.rate, rapid
        ms = self._switch(ms)
        self._check_turn(any(w[0] in "ABC" for w in words.split()), rapid)
        machine = "G53 " if 91 in ms else ""
        if machine:
            self.forget()
        motion = "G0" if rapid or machine else "G1"
        block = f"{machine}{motion} {words} {'' if machine else rate}".strip() if words else rate
        before = [M_WORDS.get(m, f"M{m}") for m in ms if m in M_BEFORE]
        after = [M_WORDS.get(m, f"M{m}") for m in ms if m in M_AFTER]
        return [*before, *([block] if block else []), *after]

    def machine_words(self, text: str) -> list[str]:
        """Blocks of a line of M words, with or without STOP."""
        self._unheld(text[:12])
        stop = text.startswith("STOP")
        before, after = self.ordered_words(text.removeprefix("STOP"))
        return [*before, *after, *(["M0"] if stop else [])]

    def motion_blocks(self, text: str) -> Blocks | None:
        """Blocks of a move; None where the text is none.

        Raises
        ------
        BlockError
            It cannot be read or followed.
        """
        m = _KEY.match(text)
        if m is None:
            return None
        key, rest = m[1], text[m.end():]
        if key in ("RND", "CHF"):
            return self._cornered(key, rest)
        self.note_place()
        if key == "CC":
            return self._centre(rest)
        if key in ("APPR", "DEP"):
            return self._edge(key, rest)
        rest, retract = self._retracted(rest)
        w = self._read(rest)
        if retract:
            if w.places or w.values:
                return [*retract, *self._after_retract(key, w)]
            before, after = self._ms(w.ms)
            return [*before, *retract, *after]
        if key == "L" and not w.places and not w.values and not w.side:
            return self._moveless(w)
        return self._go(key, w)

    def _moveless(self, w: Words) -> Blocks:
        """L with a feed or M words only."""
        before, after = self._ms(w.ms)
        rate, self.end = self._rate(w.feed), self.here()
        return [*before, *([rate] if rate and w.feed != "MAX" else []), *after]

    def _after_retract(self, key: str, w: Words) -> Blocks:
        """The move of a block with M140, which acts at its start."""
        plain = key == "L" and not (set(w.places) - {"X", "Y"} or w.values or {89, 91, 99} & set(w.ms))
        if not plain or self.side or w.side in ("RL", "RR") or self.plane is not None or self.modal_call:
            raise BlockError("M140 with more than L and X, Y in one block", "give M140 its own block")
        self._unheld("M140")
        return self._go(key, w)

    def _centre(self, rest: str) -> Blocks:
        w = self._read(rest)
        if set(w.places) - {"X", "Y"} or w.values or w.ms or w.feed or w.side:
            raise BlockError(f"CC with '{rest[:30]}': a centre in X and Y is followed")
        here = self.here()
        if not w.places:
            self.centre = here[:2]
        for letter, (value, adds) in w.places.items():
            k = "XY".index(letter)
            self.centre[k] = value + (here[k] if adds else 0.0)
        return []

    def _go(self, key: str, w: Words) -> Blocks:
        machine = 91 in w.ms
        self._check_m91(machine)
        if w.side in ("RL", "RR") and (corners := {97, 98, 197} & set(w.ms)):
            raise BlockError(f"M{min(corners)} ({HEIDENHAIN_M[min(corners)]}) is not followed")
        before, after = self._ms(w.ms)
        self.calls |= self.modal_call and not machine
        if machine:
            self.end = [math.nan] * 3
            return [*before, self._machine_place(w), *after]
        end, named = self._ends(w, key)
        turns = self._angles(w)
        rapid = w.feed == "MAX"
        side = self._side(w.side)
        feed = self._rate(w.feed)
        move = Move(self.number, tuple(self.here()), tuple(end), named, rapid=rapid, feed=feed, side=side,
                     turns=tuple(turns.items()), before=tuple(before), after=tuple(after),
                    vector=self._vector(key, w, turns))
        if key in ("C", "CR", "CT", "CP", "CTP"):
            if turns or move.vector is not None:
                raise BlockError("rotary words in an arc are not followed")
            move = replace(self._arc(key, w, move), rapid=False)
        elif key == "L" and w.values.keys() - {"TX", "TY", "TZ"}:
            raise BlockError(f"L with {', '.join(sorted(w.values))}")
        self.last_rapid = rapid
        return self._put(move)

    def _machine_place(self, w: Words) -> str:
        """M91: a place of the machine."""
        self._unheld("M91")
        self._side(w.side)
        if self.side:
            raise BlockError("M91 with radius compensation on")
        if any(adds for _, adds in w.places.values()):
            raise BlockError("M91 with incremental words")
        self._rate(w.feed)
        self.forget()
        self._note_turns({k: v for k, (v, _) in w.places.items() if k in "ABC"})
        places = [f"{k}{digits(v / self.factor_of_unit if k in 'XYZ' else v)}" for k, (v, _) in w.places.items()]
        return " ".join(["G53", "G0", *places])

    def _angles(self, w: Words) -> dict[str, float]:
        """Angles of the rotary words, deg; spatial angles are left out."""
        out = {}
        for letter, (value, adds) in w.places.items():
            if letter in "XYZ" or self.spat:
                continue
            if letter in self.machine.rotary and adds:
                value += self.machine.s.turn[self.machine.rotary.index(letter)]
            elif not adds:
                value += self.wound.get(letter, 0.0)
            out[letter] = value
        self._note_turns(out)
        return out

    def _vector(self, key: str, w: Words, turns: Mapping[str, float]) -> tuple[float, ...] | None:
        """Tool axis of the move where vectors or spatial angles give it, in the coordinates of the control."""
        spatial = {k: v for k, (v, _) in w.places.items() if k in "ABC"} if self.spat else {}
        if spatial:
            if any(adds for k, (_, adds) in w.places.items() if k in "ABC"):
                raise BlockError("incremental spatial angles")
            self.spatial |= spatial
            if set(self.spatial) != {"A", "B", "C"}:
                raise BlockError("the first block with spatial angles after FUNCTION TCPM needs A, B and C")
            a, b, c = (math.radians(self.spatial[k]) for k in "ABC")
            axis = (turn(2, c) @ turn(1, b) @ turn(0, a))[:, 2]
            return (float(axis[0]), float(axis[1]), float(axis[2]))
        given = [w.values.get(k) for k in ("TX", "TY", "TZ")]
        normal = [w.values.get(k) for k in ("NX", "NY", "NZ")]
        if all(v is None for v in given):
            if key != "LN":
                return None
            self._check_deltas()
            if not self.tcp or all(v is None for v in normal):
                return None
            given = normal  # under M128 the control holds the tool along the normal
        if turns:
            raise BlockError("a tool vector (TX, TY, TZ) and rotary words in one block")
        if key == "LN":
            self._check_deltas()
        return tuple(v or 0.0 for v in given)

    def _check_deltas(self) -> None:
        """Refuse LN with deltas of the tool, by which the control shifts it along the normal."""
        if self.wider or self.longer or self.rounder:
            raise BlockError("LN after TOOL CALL with DL, DR or DR2 (compensation along the normal) is not followed")

    def _arc(self, key: str, w: Words, move: Move) -> Move:
        start, end = move.start, list(move.end)
        if key == "CR":
            if "R" not in w.values or not w.sense:
                raise BlockError("CR without a radius R" if "R" not in w.values else "CR without DR+ or DR-")
            return self._by_radius(replace(move, left=w.sense == "+", named="XY" + move.named.strip("XY")),
                                   w.values["R"])
        if key in ("CT", "CTP"):
            return self._tangent(move)
        if "R" in w.values:
            raise BlockError(f"{key} with a radius R")
        if not w.sense:
            raise BlockError(f"{key} without DR+ or DR-")
        if any(math.isnan(v) for v in (*start[:2], *self.centre)):
            raise BlockError(f"{key} needs a centre (CC) and a start that the program has stated")
        centre, laps = complex(*self.centre), 1
        if key == "CP":
            end[:2], laps = self._turned_by(w, complex(*start[:2]) - centre)
        return replace(move, end=tuple(end), centre=centre, left=w.sense == "+", laps=laps,
                       named="XY" + move.named.strip("XY"))

    def _turned_by(self, w: Words, arm: complex) -> tuple[list[float], int]:
        """X and Y of the end of CP, mm, and the turns it begins."""
        if "IPA" in w.values:
            angle = w.values["IPA"]
            if angle == 0.0 or (angle > 0.0) != (w.sense == "+"):
                raise BlockError(f"CP IPA{angle:+g} DR{w.sense}: the angle must have the sign of DR")
            if abs(angle) > 3.6e6:
                raise BlockError(f"CP IPA{angle:+g}: more than 10 000 turns")
        elif "PA" in w.values:
            angle = w.values["PA"] - math.degrees(cmath.phase(arm))
            angle = angle % 360.0 if w.sense == "+" else -((-angle) % 360.0)
        else:
            raise BlockError("CP without IPA or PA")
        end = complex(*self.centre) + arm * cmath.rect(1.0, math.radians(angle))
        return [end.real, end.imag], max(1, math.ceil(abs(angle) / 360.0 - 1e-9))

    def _by_radius(self, move: Move, radius: float) -> Move:
        """CR: the centre by the radius, whose sign chooses between the two arcs."""
        if any(math.isnan(v) for v in move.start[:2]):
            raise BlockError("CR needs a start that the program has stated")
        a, b = complex(*move.start[:2]), complex(*move.end[:2])
        far = abs(b - a)
        if far < 1e-9 or far > 2 * abs(radius) + 0.01:
            raise BlockError(f"CR: radius {abs(radius):g} mm cannot span {far:g} mm")
        height = math.sqrt(max(radius * radius - far * far / 4, 0.0))
        aside = 1 if move.left == (radius > 0) else -1
        return replace(move, centre=0.5 * (a + b) + aside * height * 1j * (b - a) / far)

    def _tangent(self, move: Move) -> Move:
        """CT: the arc that goes on in the direction of the move before it."""
        way = self._arrival("CT")
        a, b = complex(*move.start[:2]), complex(*move.end[:2])
        if abs(b - a) < 1e-9:
            raise BlockError("CT whose end is its start")
        normal = 1j * way
        aside = ((b - a) * normal.conjugate()).real
        if abs(aside) < 1e-9 * abs(b - a):
            return replace(move, named="XY" + move.named.strip("XY"))
        radius = abs(b - a) ** 2 / (2 * aside)
        return replace(move, centre=a + radius * normal, left=radius > 0, named="XY" + move.named.strip("XY"))

    def position(self, rest: str) -> tuple[list[str], float]:
        """Blocks of the move of CYCL CALL POS, and its Z, mm.

        Raises
        ------
        BlockError
            It cannot be read.
        """
        w = self._read(rest)
        if w.side or w.sense or w.values or set(w.places) - {"X", "Y", "Z"}:
            raise BlockError(f"cannot read 'CYCL CALL POS {rest[:40]}'")
        before, after = self._ms(w.ms)
        over = w.places.pop("Z", (0.0, False))
        end, named = self._ends(w, "L")
        move = Move(self.number, tuple(self.here()), tuple(end), named, rapid=w.feed == "MAX", feed=self._rate(w.feed),
                     before=tuple(before), after=tuple(after))
        blocks = self._written(move) if named else [*before, *after]
        self.cycle_place = list(end)
        return [b if isinstance(b, str) else b[1] for b in blocks], over[0]


__all__ = ["HeidenhainPaths"]
