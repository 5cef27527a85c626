"""LinuxCNC's samples as they are delivered: nothing is found that brute force does not see, and all that it sees."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.foreign.foreign_cases import CASES, paths, samples_root
from benchmarks.foreign.foreign_programs import RAISED, run
from benchmarks.foreign.foreign_twin import SPACING, envelope
from verify.model import FindingKind

ROOT = samples_root()
BY_NAME = {c.name: c for c in CASES}
needs_samples = pytest.mark.skipif(ROOT is None, reason="LinuxCNC's samples are not installed")


@needs_samples
@pytest.mark.parametrize(("name", "step", "plunges"), [("hole-circle", 0.3, {10}),
                                                       pytest.param("spiral", 0.3, {6}, marks=pytest.mark.slow),
                                                       ("flowsnake", 0.02, {34})])
@pytest.mark.slow
def test_samples_are_found_as_brute_force_finds_them(name, step, plunges):
    case = replace(BY_NAME[name], step=step)
    r = run(case, ROOT, samples=20_000)
    assert r.twin.gap > 0.01 and r.proof.gouge_max == 0.0
    assert r.alone == [] and r.missed == {}
    assert r.twin.lines[FindingKind.PLUNGE] == plunges  # they do go straight down; nothing else is wrong with them
    assert set(r.proof.counts) <= {"plunge", "program"}
    assert r.volume == pytest.approx(r.twin.volume, rel=0.05)
    assert r.raised.gouge_max == pytest.approx(RAISED - r.twin.gap, abs=5e-4)


@needs_samples
def test_the_impeller_moves_as_its_text_says():
    """Read once more, word by word: every block ends where it says, and its tool leans as it says."""
    case = BY_NAME["impeller-7bl-xyzac"]
    text = case.text(ROOT)
    _, moves = paths(case, text)
    last = {line: m for m, line in enumerate(moves.line.tolist())}
    blocks = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = dict(re.findall(r"([XYZAC])\s*(-?[0-9.]+)", line))
        if line.startswith(("G0 ", "G1 ")) and len(words) == 5:
            m, blocks = last[number], blocks + 1
            assert np.abs(moves.end[m] - [float(words[k]) for k in "XYZ"]).max() < 1e-9
            assert np.abs(np.degrees(moves.turns[m, 1]) - [float(words[k]) for k in "AC"]).max() < 1e-9
            assert moves.feed[m] == line.startswith("G1")
    assert blocks > 4000


def stood(tool, turn, nodes=21, h=0.25):
    """Lowest height of one pose at the origin over a grid round it, and the grid."""
    out, first = np.full((nodes, nodes), np.inf), -0.5 * h * (nodes - 1)
    at = np.zeros((1, 3))
    envelope(out, np.array([first, first]), h, at, at, np.array([[turn, turn]], float), np.ones(1, bool),
             np.array(tool, float), 0.0, SPACING)
    g = first + h * np.arange(nodes)
    return out, g[:, None] + 0 * g, g + 0 * g[:, None]


def test_the_twin_is_right_where_the_answer_is_known():
    """A ball along Z; a flat and a ball that lean by A along -Y, on the line through the axis: x = 0."""
    low, x, y = stood((2.0, 1.0, 9.0), (0.0, 0.0))
    r = np.hypot(x, y)
    assert low[r <= 2] == pytest.approx(2 - np.sqrt(4 - r[r <= 2] ** 2)) and np.isinf(low[r > 2.001]).all()
    a = math.radians(30.0)
    low, x, y = stood((2.0, 0.0, 9.0), (-a, 0.0))  # its axis is (0, -sin a, cos a)
    middle, along = low[10], y[10]
    face = np.abs(along) <= 2 * math.cos(a) - 1e-9  # on the end face z = y tan a
    assert middle[face] == pytest.approx(along[face] * math.tan(a))
    side = along < -2 * math.cos(a) - 1e-9  # under the flank: 2 mm aside of the axis
    assert middle[side] == pytest.approx(-along[side] / math.tan(a) - 2 / math.sin(a))
    assert np.isinf(middle[along > 2 * math.cos(a) + 1e-9]).all()
    low, x, y = stood((2.0, 1.0, 9.0), (-a, 0.0))
    centre = 2.0 * np.array([0.0, -math.sin(a), math.cos(a)])
    under = np.hypot(x, y - centre[1]) <= 1.0  # the sphere is lowest near its centre
    assert low[under] == pytest.approx(centre[2] - np.sqrt(4 - x[under] ** 2 - (y[under] - centre[1]) ** 2))
