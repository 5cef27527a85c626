"""Random LinuxCNC programs by seed: arcs, cycles, polar words, shifts, expressions and flow."""

import math
import random


class RandomProgram:
    """A program of blocks that are right in themselves, whatever the ones before them did."""

    def __init__(self, seed):
        self.r = random.Random(seed)
        self.lines = []
        self.plane, self.relative, self.absolute_centre, self.label, self.series = 17, False, False, 0, False
        self.depth = 0

    def text(self, blocks=14):
        unit = self.r.choice(["G21", "G21", "G20"])
        self.add(f"{unit} G90 G17 G94 G91.1 G98", f"F{self.number(50, 900)}", "T1 M6 G43 S900 M3", "G0 X1 Y2 Z5",
                 "#30=1")
        for name in ("one", "two"):
            self.subroutine(name)
        while len(self.lines) < blocks + 20:
            self.block()
        self.add("G92.1", "M2")
        return "\n".join(self.lines) + "\n"

    def add(self, *lines):
        self.lines.extend(lines)

    def number(self, low, high):
        return f"{self.r.uniform(low, high):.{self.r.randint(0, 4)}f}"

    def value(self, number):
        """The number as a word may have it: plain, or as an expression of the same value."""
        n = f"{number:.5f}"
        return self.r.choice([n, n, f"[{n}]", f"[{n}*#30]", f"-[-1*{n}]", f"[[{n}+1]-1]", f"[{n}/2+{n}/2]",
                              f"[ABS[{n}]*[1-2*[{n} LT 0]]]", f"[{n}*COS[0]]", f"[{n}+0**2]", f"[{n}-1 MOD 1]"])

    def block(self):
        chosen = self.r.choice([self.line, self.line, self.arc, self.circle, self.radius_arc, self.modes, self.cycle,
                                self.cycle_again, self.polar, self.shift, self.condition, self.loop, self.call,
                                self.assignment])
        if self.depth < 2 or chosen not in (self.condition, self.loop, self.call):
            chosen()

    def axes(self, size=20.0):
        letters = self.r.sample("XYZ", self.r.randint(1, 3))
        return " ".join(a + self.value(self.r.uniform(-size, size)) for a in letters)

    def line(self):
        self.add(f"G{self.r.choice([0, 1, 1])} {self.axes()}")
        self.series = False

    def from_here(self, k, offset):
        if self.relative:
            return self.value(offset)
        return f"[#{5420 + k}+{offset:.7f}]"

    def plane_axes(self):
        return {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[self.plane]

    def arc(self):
        i, j, k = self.plane_axes()
        radius, a, sweep = self.r.uniform(1, 30), self.r.uniform(0, math.tau), self.r.uniform(0.2, 6.0)
        word = self.r.choice([2, 3])
        to = a + (sweep if word == 3 else -sweep)
        ends = {i: radius * (math.cos(to) - math.cos(a)), j: radius * (math.sin(to) - math.sin(a))}
        if self.r.random() < 0.4:
            ends[k] = self.r.uniform(-5, 5)
        centre = {i: -radius * math.cos(a), j: -radius * math.sin(a)}
        words = [f"{'XYZ'[n]}{self.from_here(n, d)}" for n, d in ends.items()] + self.centre(centre)
        if self.r.random() < 0.2:
            words.append(f"P{self.r.randint(1, 3)}")
        self.add(f"G{word} {' '.join(words)}")
        self.series = False

    def centre(self, offsets):
        return [f"{'IJK'[n]}" + (f"[#{5420 + n}+{d:.7f}]" if self.absolute_centre else self.value(d))
                for n, d in offsets.items()]

    def circle(self):
        i, j, k = self.plane_axes()
        words = self.centre({i: self.r.uniform(1, 9), j: self.r.uniform(-9, 9)})
        if self.r.random() < 0.4:
            words.append(f"{'XYZ'[k]}{self.from_here(k, self.r.uniform(-4, 4))}")
        self.add(f"G{self.r.choice([2, 3])} {' '.join(words)}")
        self.series = False

    def radius_arc(self):
        i, j, _ = self.plane_axes()
        dx, dy = self.r.uniform(1, 8), self.r.uniform(-8, 8)
        radius = math.hypot(dx, dy) * self.r.uniform(0.55, 3) * self.r.choice([1, -1])
        self.add(f"G{self.r.choice([2, 3])} {'XYZ'[i]}{self.from_here(i, dx)} {'XYZ'[j]}{self.from_here(j, dy)} "
                 f"R{self.value(radius)}")
        self.series = False

    def modes(self):
        kind = self.r.randint(0, 5)
        if kind == 0:
            self.relative = not self.relative
            self.add("G91" if self.relative else "G90")
        elif kind == 1:
            self.absolute_centre = not self.absolute_centre
            self.add("G90.1" if self.absolute_centre else "G91.1")
        elif kind == 2:
            self.add(self.r.choice(["G20", "G21"]), "G1 F" + self.number(10, 400))
            self.series = False
        elif kind == 3:
            self.add("G80", f"G{self.r.choice([17, 18, 19])}")
            self.plane, self.series = int(self.lines[-1][1:]), False
        else:
            self.add(self.r.choice(["G98", "G99"]))

    def cycle(self):
        code = self.r.choice([81, 82, 83, 73, 85, 86, 89])
        k = self.plane_axes()[2]
        low, high = sorted(self.r.uniform(-9, 9) for _ in range(2))
        depth, clear = (-abs(low) - 1, high) if self.relative else (low - 1, high)
        across = [f"{'XYZ'[n]}{self.value(self.r.uniform(-9, 9))}" for n in range(3)
                  if n != k and self.r.random() < 0.7]
        words = [*across, f"{'XYZ'[k]}{self.value(depth)}", f"R{self.value(clear)}"]
        words += [f"Q{self.number(2, 5)}"] if code in (83, 73) else []
        words += [f"P{self.number(0, 1)}"] if code in (82, 86, 89) else []
        words += [f"L{self.r.randint(1, 3)}"] if self.r.random() < 0.3 else []
        self.add(f"G{code} {' '.join(words)}")
        self.series = True

    def cycle_again(self):
        if self.series:
            k = self.plane_axes()[2]
            n = self.r.choice([n for n in range(3) if n != k])
            mode = self.r.choice(["", "", "G98 ", "G99 "])
            self.add(f"{mode}{'XYZ'[n]}{self.value(self.r.uniform(-9, 9))}")

    def polar(self):
        if self.plane == 17:
            words = self.r.choice([[f"@{self.number(1, 20)}", f"^{self.value(self.r.uniform(-400, 400))}"],
                                   [f"@{self.number(1, 9)}"], [f"^{self.number(-90, 90)}"]])
            self.add(f"G{self.r.choice([0, 1])} " + " ".join(words))
            self.series = False

    def shift(self):
        self.add(self.r.choice([f"G92 {self.axes()}", f"G52 {self.axes()}", "G92.1", "G92.2",
                                f"G10 L20 P1 {self.axes()}"]))

    def inside(self, most):
        """A few blocks that leave the generator's idea of the modes right whether they are run or not."""
        self.depth += 1
        for _ in range(self.r.randint(1, most)):
            self.r.choice([self.line, self.arc, self.circle, self.radius_arc, self.assignment, self.polar, self.block
                           if self.depth < 2 and not self.relative else self.line])()
        self.depth -= 1

    def label_of(self):
        self.label += 1
        return self.r.choice([f"o{100 + self.label}", f"O<l{self.label}>"])

    def test(self):
        a, b = self.r.randint(0, 3), self.r.randint(0, 3)
        return f"[{a} {self.r.choice(['EQ', 'ne', 'GT', 'ge', 'LT', 'LE', 'and', 'OR', 'XOR'])} {b}]"

    def frozen(self, write):
        """Blocks that may not be run keep the modes as they were."""
        before = self.plane, self.relative, self.absolute_centre
        self.series = False
        write()
        self.add("G80", f"G{before[0]} {'G91' if before[1] else 'G90'} {'G90.1' if before[2] else 'G91.1'}")
        self.plane, self.relative, self.absolute_centre = before
        self.series = False

    def condition(self):
        label = self.label_of()
        def write():
            self.add(f"{label} if {self.test()}")
            self.inside(2)
            if self.r.random() < 0.5:
                self.add(f"{label} elseif {self.test()}")
                self.inside(2)
            if self.r.random() < 0.5:
                self.add(f"{label} else")
                self.inside(2)
            self.add(f"{label} endif")
        self.frozen(write)

    def loop(self):
        label, kind = self.label_of(), self.r.choice(["repeat", "while", "do"])
        counter = f"#{200 + self.label}"
        def write():
            self.add(f"{counter}=0")
            self.add({"repeat": f"{label} repeat [{self.r.randint(0, 3)}]", "do": f"{label} do",
                      "while": f"{label} while [{counter} LT {self.r.randint(0, 3)}]"}[kind])
            self.add(f"{counter}=[{counter}+1]")
            self.inside(2)
            if self.r.random() < 0.4 and kind != "repeat":
                out = self.label_of()
                leave = "break" if kind == "do" else self.r.choice(["break", "continue"])
                self.add(f"{out} if [{counter} EQ 2]", f"{label} {leave}", f"{out} endif")
                self.inside(1)
            self.add({"repeat": f"{label} endrepeat", "while": f"{label} endwhile",
                      "do": f"{label} while [{counter} LT {self.r.randint(0, 3)}]"}[kind])
        self.frozen(write)

    def subroutine(self, name):
        def write():
            self.add(f"o<{name}> sub", "#<deep>=[#1+#2]", "#30=1")
            self.add(self.r.choice(["M73", "(none)"]))
            self.inside(3)
            self.add("G1 X#<deep> Y#3", "#3=7", f"o<{name}> endsub [#1*2]")
        self.depth = 2
        self.frozen(write)
        self.depth = 0

    def call(self):
        name = self.r.choice(["one", "two"])
        values = " ".join(f"[{self.number(-5, 5)}]" for _ in range(self.r.randint(0, 4)))
        self.frozen(lambda: self.add(f"o<{name}> call {values}", "#31=#<_value>", "G1 Z#31 X[#<_value_returned>+1]"))

    def assignment(self):
        n = self.r.randint(60, 62)
        self.add(f"#{n}={self.value(self.r.uniform(-9, 9))} #<name>=[FIX[{self.number(-9, 9)}] MOD 4]",
                 f"G1 X#{n} Y#<name> #{n}=3")
        self.series = False


def expression(r, depth=0):
    """The text of a random expression, in brackets; some have no value."""
    def value():
        kind = r.randint(0, 9 if depth < 2 else 3)
        if kind < 3:
            return f"{r.choice(['', '', '-', '+'])}{r.choice([0, 1, 2, 3, 0.5, 1.25, 7, 45, 90, 0.0001])}"
        if kind < 4:
            return r.choice(["#1", "#<a>", "-#1", "##2", "#[1+1]", "#<_b>"])
        if kind < 8:
            return r.choice(["", "-"]) + expression(r, depth + 1)
        if kind < 9:
            return f"ATAN{expression(r, depth + 1)}/{expression(r, depth + 1)}"
        names = ["ABS", "ACOS", "asin", "COS", "EXP", "FIX", "fup", "LN", "ROUND", "SIN", "SQRT", "TAN"]
        return f"{r.choice(names)}{expression(r, depth + 1)}"
    operators = ["+", "-", "*", "+", "-", "*", "/", "**", " MOD ", " EQ ", " ne ", " GT ", " GE ", " lt ", " LE ",
                 " AND ", " OR ", " XOR "]
    text = value()
    for _ in range(r.randint(0, 3)):
        text += r.choice(operators) + value()
    return f"[{text}]"


class RandomContour:
    """A contour under cutter radius compensation by seed: lines, arcs, moves along the third axis, modes between."""

    def __init__(self, seed):
        self.r = random.Random(seed)
        self.at, self.heading = complex(0, 0), self.r.uniform(0, math.tau)

    def text(self, elements=8, head="G21 G90 G17 G91.1\nF500\nT1 M6 G43 S900 M3\n", word=None):
        side = word or self.r.choice(["G41 D1", "G42 D1"])
        plane = self.r.choice([17, 17, 17, 18])
        self.axes = {17: "XYZIJ", 18: "ZXYKI"}[plane]
        lines = [head.rstrip("\n"), f"G{plane}", f"G0 {self.place()} {self.axes[2]}5"]
        if self.r.random() < 0.5:
            lines.append(side)
            lines.append(self.line(low=4))
        else:
            lines.append(f"{side} {self.line(low=4)}")
        for _ in range(elements):
            lines.append(self.r.choice([self.line, self.line, self.line, self.arc, self.arc, self.along, self.mode])())
        lines.append(self.r.choice(["G40", f"G40 {self.line()}"]))
        lines += [self.r.choice([f"G0 {self.axes[2]}9", ""]), self.line(), "M2"]
        return "\n".join(x for x in lines if x) + "\n"

    def place(self):
        return f"{self.axes[0]}{self.at.real:.6f} {self.axes[1]}{self.at.imag:.6f}"

    def turned(self):
        """The corner: mostly open, at times tangent or sharp."""
        self.heading += self.r.choice([0.0, self.r.uniform(-0.02, 0.02), self.r.uniform(-1, 1), self.r.uniform(-3, 3)])

    def line(self, low=1.0):
        self.turned()
        self.at += self.r.uniform(low, 25) * complex(math.cos(self.heading), math.sin(self.heading))
        rise = f" {self.axes[2]}{self.r.uniform(-5, 5):.3f}" if self.r.random() < 0.2 else ""
        return f"{self.r.choice(['G1', 'G1', 'G1', 'G0'])} {self.place()}{rise}"

    def arc(self):
        self.turned()
        turn, radius, sweep = self.r.choice([1, -1]), self.r.uniform(1, 20), self.r.uniform(0.1, 5)
        normal = 1j * turn * complex(math.cos(self.heading), math.sin(self.heading))
        arm = radius * normal
        centre = self.at + arm
        self.at = centre - arm * complex(math.cos(turn * sweep), math.sin(turn * sweep))
        self.heading += turn * sweep
        return (f"G{3 if turn > 0 else 2} {self.place()} {self.axes[3]}{arm.real:.6f} {self.axes[4]}{arm.imag:.6f}")

    def along(self):
        return f"{self.r.choice(['G1', 'G0'])} {self.axes[2]}{self.r.uniform(-5, 5):.3f}"

    def mode(self):
        return self.r.choice(["M8", "M9", "F300", "S700", "(comment)"])
