"""Plain lines are read past the parser of blocks: what comes of them is what the parser makes of the same words."""

import numpy as np
import pytest

from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

HEAD = "%\nG21 G90 G17 G94 G54\nT1 M6\nS1000 M3\n{control}\nG0 {a}0 C0\nX0 Y0\nZ60\nF500\n"
ZERO = (0.0, 0.0, 0.0)


def words(rng, letters, count):
    """Lines as lists of words: moves of some axes, small steps and large ones, rapids and feeds, some with F."""
    place = dict.fromkeys(letters, 0.0)
    for k in range(count):
        line = [["G1"], ["G0"], [], []][int(rng.integers(4))] if k else ["G1"]
        for letter in letters:
            if rng.random() < 0.6:
                wide = 40.0 if rng.random() < 0.1 else 0.4
                place[letter] += float(rng.normal() * wide)
                line = [*line, f"{letter}{place[letter]:.4f}"]
        if rng.random() < 0.2:
            line = [*line, f"F{rng.integers(100, 900)}"]
        if line:
            yield line


@pytest.mark.parametrize("kind, control", [("table-table-AC", "G43.4 H1"), ("table-table-BC", "G43 H1\nM428"),
                                           ("head-head-AC", "G43.4 H1"), ("table-table-AC", "G43 H1")])
def test_plain_lines_are_read_as_the_parser_reads_them(kind, control):
    """The same words in an order no plain line has go through the parser."""
    a = kind[-2]
    pivots = ((0.0, 0.0, 30.0),) if kind.startswith("head") else ((0.0, 3.0, -20.0), (1.0, 0.0, -5.0))
    machine = Kinematics(kind, pivots)
    for seed in range(6):
        lines = list(words(np.random.default_rng(seed), f"XYZ{a}C", 300))
        plain = "\n".join(" ".join(line) for line in lines)
        turned = "\n".join(" ".join(reversed(line)) for line in lines)
        head = HEAD.format(control=control, a=a)
        one, other = (read_program(f"{head}{body}\nG0 Z80\nM30\n%\n", kinematics=machine, gauge_length={1: 90.0})
                      for body in (plain, turned))
        for name in ("start", "end", "kind", "feed", "tool", "line", "minutes"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
        for name in ("start_turn", "end_turn"):
            np.testing.assert_array_equal(getattr(one.poses, name), getattr(other.poses, name), err_msg=name)
        assert one.remarks == other.remarks and len(one) > 150
