"""Descents straight down into solid stock: as deep as planted by both models of the stock, for every end and size."""

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from tests.pocket_case import SETUP, block, scored, text
from verify.model import NcProgram, ScoredSamples
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))


def proved(tool, *lines, turn=None):
    head = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
    body = [*head, *lines, "G0 Z20", "M5", "M30", "%"]
    return prove([NcProgram("p", text(body), turn)], PART, (tool,), SETUP, NOBODY, (), threads=2)


def end_mill(kind, d):
    corner = {"flat": 0.0, "ball": 0.5 * d, "bull": 0.2 * d}[kind]
    return ToolBody("T1", 1, d, corner, 6.0, 0.95 * d, 20.0, d, 30.0)


@pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
@pytest.mark.parametrize("kind, d", [("flat", 0.2), ("flat", 1.0), ("flat", 4.0), ("ball", 0.4), ("ball", 1.0),
                                     ("ball", 6.0), ("bull", 3.0)])
def test_a_plunge_is_as_deep_as_planted(kind, d, turn):
    """Anywhere between lines and nodes, at once and in three steps; the blank's top is at 0.5 mm, 0.1 D are allowed."""
    rng = np.random.default_rng(3)
    deep = max(0.45, 0.25 * d)
    for steps in (1, 3):
        x, y = rng.uniform(-8.0, -4.0, 2)
        downs = [f"G1 Z{0.5 - deep * (k + 1) / steps:.4f} F100" for k in range(steps)]
        found = proved(end_mill(kind, d), f"G0 X{x:.4f} Y{y:.4f}", "Z1.6", *downs, turn=turn)
        depth = max((f.depth for f in found.findings if f.kind == "plunge"), default=0.0)
        assert depth == pytest.approx(deep, rel=0.1), (steps, x, y)
        assert not [f for f in found.findings if f.kind == "program"]


@pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
def test_what_is_allowed_is_no_plunge(turn):
    for kind, d in (("ball", 6.0), ("flat", 4.0), ("ball", 1.0)):
        found = proved(end_mill(kind, d), "G0 X-5.02 Y-4.03", "Z1.6", f"G1 Z{0.5 - 0.085 * d:.4f} F100", turn=turn)
        assert not [f for f in found.findings if f.kind == "plunge"], kind


def test_an_engraver_between_the_lines_meets_stock():
    """A 0.1 mm flat mills a slot; lines 0.15 mm apart would show no trace of it."""
    found = proved(end_mill("flat", 0.1), "G0 X-5.425 Y-6.425", "Z1", "G1 X5 Z0.02 F100", "X-5 Y-6.425")
    assert not [f for f in found.findings if f.kind == "program"] and found.notes == ()
