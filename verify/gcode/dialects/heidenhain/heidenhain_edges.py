"""How moves of a Heidenhain program join: roundings, chamfers, approaches and departures, and their blocks.

A move before a rounding (RND), a chamfer (CHF) or after an approach (APPR) is held back until the next move is known.
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import replace

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.corners import chamfer, rounding
from verify.gcode.dialects.heidenhain.heidenhain_q import VALUE
from verify.gcode.dialects.heidenhain.heidenhain_words import Blocks, HeidenhainWords, Move, Way, Words
from verify.gcode.dialects.stated_places import digits


class HeidenhainEdges(HeidenhainWords):
    """Moves that are held back, and blocks of moves."""

    def _arrival(self, word: str) -> complex:
        """Unit direction in the plane in which the latest move arrived."""
        if self.held is not None:
            return self.held.leg.tangent(True)
        way = complex(*self.direction(word)[1][:2])
        if abs(way) < 1e-9:
            raise BlockError(f"{word} continues a move that goes along Z only")
        return way / abs(way)

    def _put(self, move: Move) -> Blocks:
        """Blocks of a move, of a corner before it and of what it ends; none where a corner follows it."""
        out: Blocks = []
        if self.approach is not None:
            way, self.approach = self.approach, None
            out += self._approached(way, move)
            if move.side == "G40":
                raise BlockError("R0 in the first move after APPR")
        if self.held is not None:
            held, corner, self.held, self.corner = self.held, self.corner, None, None
            if corner is None:
                raise BlockError("a move that a corner follows, and the corner is missing")
            try:
                held, between, move = self._joined(held, corner, move)
            except BlockError as problem:
                raise BlockError(str(problem), problem.remedy, corner[3]) from None
            out += self._written(held)
            for piece in between:
                out += self._written(piece)
        ahead = self.flow.ahead.upper()
        if ("RND" in ahead or "CHF" in ahead) and re.match(r"\s*(?:[0-9]+\s+)?(?:RND|CHF)\b",
                                                           ahead.replace("RND", "RND ", 1)
                                                           .replace("CHF", "CHF ", 1)):
            self.held = move
            return out
        return [*out, *self._written(move)]

    def _written(self, move: Move) -> Blocks:
        """Blocks of one move, with its line."""
        blocks: list[str] = [*move.before]
        words = {k: digits(move.end["XYZ".index(k)] / self.factor_of_unit) for k in "XYZ" if k in move.named}
        if self.wanted is not None and words and not self.tcp:
            if move.turns or not self.arrived({}):
                raise BlockError("a move in a tilted plane (PLANE with STAY) before the rotary axes stand in it",
                                 "turn the rotary axes in a block before (A+Q120, B+Q121, C+Q122)")
            blocks.append("M428")
            self.wanted, self.swung = None, True
        self._keep_heading(move)
        self.end = list(move.end)
        turns = dict(move.turns)
        self._check_turn(bool(turns), move.rapid)
        if move.vector is not None or (self.circle and turns and self.tcp):
            return self._numbered_blocks(move, [*blocks, *self._oriented_move(move, words, turns), *move.after])
        settled = self.settle(words, move.rapid)
        head = [w for w in [move.side] if w]
        if move.centre is not None:
            start = complex(*move.start[:2])
            off = (move.centre - start) / self.factor_of_unit
            laps = [f"P{move.laps}"] if move.laps > 1 else []
            text = " ".join([*head, "G3" if move.left else "G2", *(f"{k}{v}" for k, v in (settled or words).items()),
                             f"I{digits(off.real)} J{digits(off.imag)}", *laps, *([move.feed] if move.feed else [])])
        elif settled is None and not turns:
            text = " ".join([*head, *([move.feed] if move.feed else [])])
        else:
            text = " ".join([*head, "G0" if move.rapid else "G1", *(f"{k}{v}" for k, v in (settled or {}).items()),
                             *(f"{k}{digits(v)}" for k, v in turns.items()), *([move.feed] if move.feed else [])])
        blocks += [text] if text else []
        if turns and self.wanted is not None and self.arrived(turns):
            blocks.append("M428")
            self.wanted, self.swung = None, True
        return self._numbered_blocks(move, [*blocks, *move.after])

    def _numbered_blocks(self, move: Move, blocks: list[str]) -> Blocks:
        return [b if move.number == self.number else (move.number, b) for b in blocks]

    def _oriented_move(self, move: Move, words: dict[str, str], turns: dict[str, float]) -> list[str]:
        if move.side or self.side:
            raise BlockError("a turning tool axis with radius compensation")
        settled = self.settle(words, move.rapid) or {}
        circle = self.circle
        if move.vector is not None and circle is None:
            self.circle = False  # M128 turns the axes evenly
        try:
            return self.oriented("G0" if move.rapid else "G1", settled, move.feed, move.vector, turns)
        finally:
            self.circle = circle

    def _keep_heading(self, move: Move) -> None:
        """Keep the direction at the end of an arc; that of a line follows from its places."""
        self.heading = None
        if move.centre is not None or (not any(math.isnan(v) for v in (*move.start, *move.end))
                                       and move.start != move.end):
            way = [b - a for a, b in zip(move.start, move.end, strict=True)]
            if move.centre is not None:
                t = move.leg.tangent(True)
                way = [t.real, t.imag, 0.0]
            self.heading = (list(move.end), way)

    def _cornered(self, key: str, rest: str) -> Blocks:
        """RND or CHF: the corner between the move held back and the next one."""
        m = re.fullmatch(rf"(?:R\s*)?({VALUE})(?:\s+F\s*(AUTO|{VALUE}))?", rest)
        if m is None:
            raise BlockError(f"cannot read '{key} {rest[:30]}'")
        if self.held is None or self.corner is not None:
            raise BlockError(f"{key} needs a move directly before it")
        size = self.q.value(m[1]) * self.factor_of_unit
        if not size > 0:
            raise BlockError(f"{key} with {size:g} mm")
        old = self.rate, self.per_turn
        feed = self._rate(m[2] or "")
        self.rate, self.per_turn = old
        self.corner = (key, size, feed, self.number)
        return []

    def _joined(self, first: Move, corner: tuple[str, float, str, int],
                second: Move) -> tuple[Move, list[Move], Move]:
        """Two moves shortened at their corner, and what comes between them."""
        key, size, feed, number = corner
        if any(math.isnan(v) for v in (*first.start, *first.end, *second.end)):
            raise BlockError(f"{key} at a place that the program has not stated")
        if max(abs(first.end[2] - first.start[2]), abs(second.end[2] - second.start[2])) > 1e-9:
            raise BlockError(f"{key} between moves that change Z")
        if second.side:
            raise BlockError(f"{key} where radius compensation begins or ends")
        z = first.end[2]
        between: list[Move] = []
        back = self.rate if feed and not second.feed else ""
        if key == "CHF":
            p, q = chamfer(first.leg, second.leg, size)
            piece = Move(number, (p.real, p.imag, z), (q.real, q.imag, z), "XY", feed=feed)
        else:
            arc = rounding(first.leg, second.leg, size)
            if arc is None:
                return first, [], second
            p, q, centre, left = arc
            piece = Move(number, (p.real, p.imag, z), (q.real, q.imag, z), "XY", centre=centre, left=left, feed=feed)
        between.append(piece)
        first = replace(first, end=(p.real, p.imag, z), named="XY" + first.named.strip("XY"))
        second = replace(second, start=(q.real, q.imag, z), feed=second.feed or back,
                         named="XY" + second.named.strip("XY"))
        return first, between, second

    def _edge(self, key: str, rest: str) -> Blocks:
        """APPR and DEP by a line along the contour (LT), across it (LN) or by an arc (CT)."""
        m = re.match(r"(LT|LN|CT)(?![A-Z])\s*", rest)
        if m is None:
            raise BlockError(f"{key} {rest.split(' ')[0][:10]} is not followed: LT, LN and CT are")
        w = self._read(rest[m.end():])
        size, angle = w.values.get("R" if m[1] == "CT" else "LEN", 0.0), w.values.get("CCA", 0.0)
        if not size or (m[1] == "CT" and not 0 < angle < 720):
            raise BlockError(f"{key} {m[1]} without its size ({'CCA and R' if m[1] == 'CT' else 'LEN'})")
        self._unheld(f"{key} {m[1]}")
        before, after = self._ms(w.ms)
        if key == "DEP":
            if w.places:
                raise BlockError(f"DEP {m[1]} with coordinates")
            return [*before, *self._departed(m[1], size, math.radians(angle), w), *after]
        end, _ = self._ends(w, "APPR")
        here = self.here()
        side = self._side(w.side)
        old, rapid = self.rate, self.last_rapid
        feed = self._rate(w.feed)
        self.last_rapid = False
        self.approach = Way(m[1], tuple(here), tuple(end), size, math.radians(angle), side, feed, rapid, self.number,
                             tuple(after), tuple([*before, *([old] if old and not rapid and feed else [])]))
        return []

    def _radius(self) -> float:
        """mm, radius of the compensation in force, 0 for none."""
        if not self.side:
            return 0.0
        if self.tool not in self.machine.radii:
            raise BlockError(f"APPR and DEP need the radius of T{self.tool}", "give the tool in the setup")
        return self.machine.radii[self.tool] + self.wider

    def _approached(self, way: Way, first: Move) -> Blocks:
        """Blocks of an approach, now that the first move of the contour is known."""
        if any(math.isnan(v) for v in way.end):
            raise BlockError("APPR to a place that the program has not stated")
        t, a = first.leg.tangent(False), complex(*way.end[:2])
        centre, left, comp = None, False, way.side
        if way.kind == "LT":
            help_ = a - way.size * t
        elif way.kind == "LN":
            if not self.side:
                raise BlockError("APPR LN without radius compensation")
            help_ = a + 1j * self.side * t * (abs(way.size) + self._radius())
            comp = ""
        else:
            left = (self.side or 1) > 0
            if way.size < 0:
                left = not left
            normal = 1j * t if left else -1j * t
            centre = a + abs(way.size) * normal
            help_ = centre + (a - centre) * cmath.rect(1.0, -way.angle if left else way.angle)
        z0, z1 = way.start[2], way.end[2]
        place = (help_.real, help_.imag)
        out = self._written(Move(way.number, way.start, (*place, z0), "XY", rapid=way.rapid, side=comp,
                                 before=way.before))
        if z0 != z1:
            out += self._written(Move(way.number, (*place, z0), (*place, z1), "Z", rapid=way.rapid))
        last = Move(way.number, (*place, z1), (a.real, a.imag, z1), "XY", centre=centre, left=left, feed=way.feed,
                     side=way.side if way.kind == "LN" else "", after=way.after)
        return [*out, *self._written(last)]

    def _departed(self, kind: str, size: float, angle: float, w: Words) -> Blocks:
        """Blocks of a departure, which ends radius compensation."""
        here = self.known(f"DEP {kind}")
        t, a, side = self._arrival(f"DEP {kind}"), complex(*here[:2]), self.side
        feed = self._rate(w.feed)
        move = Move(self.number, tuple(here), tuple(here), "XY", feed=feed, rapid=w.feed == "MAX")
        if kind == "LN":
            if not side:
                raise BlockError("DEP LN without radius compensation")
            there = a + 1j * side * t * (abs(size) + self._radius())
            return self._written(replace(move, end=(there.real, there.imag, here[2]), side=self._side("R0")))
        if kind == "LT":
            there = a + abs(size) * t
            out = self._written(replace(move, end=(there.real, there.imag, here[2])))
        else:
            left = (side or 1) > 0
            if size < 0:
                left = not left
            centre = a + abs(size) * (1j * t if left else -1j * t)
            there = centre + (a - centre) * cmath.rect(1.0, angle if left else -angle)
            out = self._written(replace(move, end=(there.real, there.imag, here[2]), centre=centre, left=left,
                                        rapid=False))
        off = self._side("R0")
        return [*out, *([off] if off else [])]

    def _ends(self, w: Words, key: str) -> tuple[list[float], str]:
        """End of a move in the coordinates of the control, and the letters of X, Y, Z that it names."""
        here = self.here()
        end = list(here)
        for letter, (value, adds) in w.places.items():
            if letter not in "XYZ":
                continue
            k = "XYZ".index(letter)
            if adds and math.isnan(here[k]):
                raise BlockError(f"I{letter} starts at a place that the program has not stated")
            end[k] = value + (here[k] if adds else 0.0)
        named = "".join(k for k in "XYZ" if k in w.places)
        if key in ("LP", "CTP"):
            end[:2] = self._polar(w, key)
            named = "XY" + named.strip("XY")
        return end, named

    def _polar(self, w: Words, key: str) -> list[float]:
        """X and Y, mm, of polar words round the pole of CC; an absent word keeps that of the place of the tool."""
        if any(math.isnan(v) for v in self.centre):
            raise BlockError(f"{key} needs a pole (CC)")
        v = w.values
        if not {"PA", "IPA", "PR", "IPR"} & v.keys():
            raise BlockError(f"{key} without PR and PA")
        radius, angle = v.get("PR"), v.get("PA")
        if radius is None or angle is None:
            here = self.here()
            if any(math.isnan(c) for c in here[:2]):
                raise BlockError(f"{key} continues from a place that the program has not stated")
            arm = complex(here[0] - self.centre[0], here[1] - self.centre[1])
            radius = abs(arm) + v.get("IPR", 0.0) if radius is None else radius
            angle = math.degrees(cmath.phase(arm)) + v.get("IPA", 0.0) if angle is None else angle
        there = cmath.rect(radius, math.radians(angle))
        return [self.centre[0] + there.real, self.centre[1] + there.imag]


__all__ = ["HeidenhainEdges"]
