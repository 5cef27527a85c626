"""Ribs, floors and edges that a program takes away, however thin: found, as deep as the closed form, not covered."""

import math

import numpy as np
import pytest

from tests.hand_parts import as_part, prism, samples_of, terraces, tool
from tests.pocket_case import text
from verify.model import NcProgram, ProofSetup, ScoredSamples
from verify.prove import prove

FLAT = tool(8.0, 0.0, neck=30.0, stickout=40.0)
THICK = [0.02, 0.1, 0.3, 1.0]
TOLERANCE = [0.002, 0.02, 0.1, 0.5]
GRID = [pytest.param(t, tol, marks=() if (t, tol) in ((0.02, 0.1), (0.3, 0.1)) else pytest.mark.slow)
        for t in THICK for tol in TOLERANCE]


def deepest(part, tolerance, *lines):
    """Depth of the deepest gouge, the proof, and which samples it proves."""
    samples = samples_of(part.mesh, 25.0)
    setup = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, gouge_tolerance=tolerance,
                       clearance_rapid=0.2)
    head = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
    body = [*head, *lines, "G0 Z20", "M5", "M30", "%"]
    proof = prove([NcProgram("p", text(body), None)], part, (FLAT,), setup,
                  ScoredSamples(samples, np.zeros(len(samples), np.int32)), ())
    found = [f.depth for f in proof.findings if f.kind == "gouge"]
    return max(found, default=0.0), proof, samples


def near(found, true):
    return abs(found - true) <= max(0.1 * true, 0.005)


@pytest.mark.parametrize("thick, tolerance", GRID)
def test_a_rib(thick, tolerance):
    part = as_part(terraces([0, 10, 10 + thick, 20 + thick], [0, 8], [[0.0, 3.0, 0.0]], -4.0))
    depth, proof, samples = deepest(part, tolerance, f"G0 X{10 + thick / 2:.4f} Y-6", "G1 Z0 F300", "Y14", "G0 Z20")
    assert near(depth, 3.0)
    top = samples.points[:, 2] > 2.9
    assert top.any() and not proof.proved[top].any()


@pytest.mark.parametrize("left, right, height", [
    (0.26, 0.26, 3.0), (0.29, 0.22, 3.0), (0.25, 0.2501, 3.0),  # neither is deeper than the tolerance
    (0.36, 0.2, 3.0), (0.45, 0.06, 3.0),  # one is
    (0.2, 0.2, 0.0), (0.29, 0.15, 0.0)])  # a rib of 0.1 and 0.06 mm stays
def test_a_rib_cut_from_both_sides(left, right, height):
    part = as_part(terraces([0, 10, 10.5, 20.5], [0, 8], [[0.0, 3.0, 0.0]], -4.0))
    sides = [line for x in (6.0 + left, 14.5 - right) for line in (f"G0 X{x:.4f} Y-6", "G1 Z0 F300", "Y14", "G0 Z20")]
    depth, proof, samples = deepest(part, 0.3, *sides)
    assert near(depth, height)
    top = samples.points[:, 2] > 2.9
    assert top.any() and (not proof.proved[top].any() or not height)


@pytest.mark.parametrize("thick, tolerance", [(0.05, 0.03), (0.15, 0.1), (0.004, 0.005)])
def test_a_thin_rib_cut_from_both_sides_by_half(thick, tolerance):
    part = as_part(terraces([0, 10, 10 + thick, 20 + thick], [0, 8], [[0.0, 3.0, 0.0]], -4.0))
    cut = 0.5 * thick + 0.001
    sides = [line for x in (6.0 + cut, 14.0 + thick - cut)
             for line in (f"G0 X{x:.4f} Y-6", "G1 Z0 F300", "Y14", "G0 Z20")]
    assert near(deepest(part, tolerance, *sides)[0], 3.0)


@pytest.mark.parametrize("thick, tolerance", GRID)
def test_a_floor(thick, tolerance):
    part = as_part(terraces([0, 20], [0, 20], [[thick]], 0.0))
    depth, proof, samples = deepest(part, tolerance, "G0 X10 Y10", "G1 Z-1 F300", "G0 Z20")
    assert near(depth, 4.0)
    middle = np.linalg.norm(samples.points[:, :2] - 10.0, axis=1) < 1.0
    assert middle.any() and not proof.proved[middle].any()


@pytest.mark.parametrize("short, tolerance", GRID)
def test_an_edge_of_four_degrees(short, tolerance):
    y = 12.0 * math.tan(math.radians(2.0))
    part = prism([(0.0, 0.0), (12.0, -y), (12.0, y)], [(0, 1, 2)], 5.0)
    depth, *_ = deepest(part, tolerance, f"G0 X{short - 4.0:.4f} Y-12", "G1 Z-3 F300", "Y12", "G0 Z20")
    if short > 1.1 * tolerance:
        assert near(depth, short)
    if short < 0.9 * tolerance:
        assert depth == 0.0


def test_a_chamfer_nobody_asked_for_is_as_deep_as_the_edge_was_from_it():
    part = as_part(terraces([0, 20], [0, 20], [[0.0]], -6.0))
    # steps of 0.02 mm along a slope of 45 degrees off the edge at X20, 0.4 mm wide
    steps = [(20.0 - 0.4 + t, -t) for t in np.arange(0.0, 0.4001, 0.02)]
    lines = [f"G1 X{x + 4.0:.4f} Y{-6 if k % 2 else 26} F300\nZ{z:.4f}\nY{26 if k % 2 else -6}"
             for k, (x, z) in enumerate(steps)]
    depth, *_ = deepest(part, 0.05, "G0 X24 Y-6", *"\n".join(lines).split("\n"))
    assert near(depth, 0.4 / math.sqrt(2.0))
