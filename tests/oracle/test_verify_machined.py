"""The machined part as a field, against closed forms; and what it is bound to be off by."""

import math

import numpy as np
import pytest

from geometry.errors import InputError
from geometry.tool_body import ToolBody
from tests.pocket_case import SETUP, TOOL, block, program, text
from verify.material.machined_part import clipped, machined_stock, surface_error
from verify.model import ProofSetup

PART = block()
BALL = ToolBody("B1", 1, 6.0, 3.0, 10.0, 5.8, 20.0, 6.0, 30.0)
GROOVE = "\n".join(["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X-30 Y0", "Z-2",
                    "G1 X30 F600", "G0 Z20", "M30", "%", ""])


def groove(step, box):
    """Stock of 41 x 31 x 10.5 mm over the block with a groove of radius 3 mm along X, its lowest line at z = -2."""
    return machined_stock([("groove", GROOVE)], PART, [BALL], SETUP, step, box=np.array(box))


def test_volume_of_the_whole_pocket():
    field = machined_stock([("pocket", text(program()))], PART, [TOOL], SETUP, 0.25)
    corners = 4 * (4.0 - math.pi) * 5.5  # what a cutter of radius 2 leaves in the four corners, 5.5 mm deep
    blank = 41.0 * 31.0 * 10.5
    assert field.volume == pytest.approx(blank - (20 * 12 * 5.5 - corners), rel=2e-3)
    mesh = field.surface()
    assert mesh.volume == pytest.approx(field.volume, rel=2e-3)
    assert np.abs(mesh.bounds - [[-20.5, -15.5, -10], [20.5, 15.5, 0.5]]).max() < 0.25


def test_a_window_holds_what_stands_in_it_and_nothing_else():
    box = [[-1.0, -3.5, -3.0], [1.0, 3.5, 0.0]]
    field = groove(0.05, box)
    # of the circle of radius 3 round z = 1, what lies below z = 0
    segment = 9 * math.acos(1 / 3) - math.sqrt(8)
    assert field.volume == pytest.approx(2.0 * (7 * 3 - segment), rel=2e-3)
    low, high = field.surface().bounds
    assert np.abs([low - box[0], high - box[1]]).max() < 0.05


@pytest.mark.parametrize("step", [0.2, 0.05, 0.01])
def test_corners_on_a_smooth_surface_are_off_by_the_square_of_the_step(step):
    wide = min(3.0, 40 * step)
    field = groove(step, [[-0.5 * wide, -0.5 * wide, -2.6], [0.5 * wide, 0.5 * wide, -1.0]])
    v = field.surface().vertices
    inner = (np.abs(v[:, :2]) < 0.5 * wide - 2 * step).all(axis=1) & (np.abs(np.hypot(v[:, 1], v[:, 2] - 1) - 3) < step)
    off = np.abs(np.hypot(v[inner, 1], v[inner, 2] - 1.0) - 3.0)
    assert inner.sum() > 100 and off.max() < 0.5 * step**2 / 3.0 + 1e-6


def test_the_error_falls_with_the_square_of_the_step():
    off, steps = [], (0.1, 0.05, 0.025, 0.0125)
    for step in steps:
        v = groove(step, [[-0.5, -1.5, -2.6], [0.5, 1.5, -1.0]]).surface().vertices
        inner = (np.abs(v[:, 0]) < 0.3) & (np.abs(v[:, 1]) < 1.2) & (v[:, 2] > -2.4)
        off.append(np.abs(np.hypot(v[inner, 1], v[inner, 2] - 1.0) - 3.0).mean())
    slope = np.polyfit(np.log(steps), np.log(off), 1)[0]
    assert 1.8 < slope < 2.2


def test_corners_at_an_edge_are_within_a_step_of_it():
    step = 0.13
    v = groove(step, [[-0.5, 2.0, -0.8], [0.5, 4.0, 0.4]]).surface().vertices
    # stock: outside the cylinder, below the window's own top at 0.4, where the wall of the groove is upright at z = 1
    inner = (np.abs(v[:, 0]) < 0.3) & (v[:, 1] > 2.3) & (v[:, 1] < 3.7) & (v[:, 2] > -0.5)
    distance = np.minimum(np.abs(np.hypot(v[inner, 1], v[inner, 2] - 1.0) - 3.0), np.abs(v[inner, 2] - 0.4))
    assert distance.max() < step < surface_error(step)


def test_a_window_as_fine_as_two_thousandths():
    field = groove(0.002, [[-0.1, -0.1, -2.05], [0.1, 0.1, -1.95]])
    assert field.step == 0.002
    v = field.surface().vertices
    floor = (np.abs(v[:, :2]) < 0.09).all(axis=1) & (v[:, 2] > -2.04)
    assert np.abs(np.hypot(v[floor, 1], v[floor, 2] - 1.0) - 3.0).max() < 1e-5


def test_clipping_leaves_the_field_as_it_was():
    field = machined_stock([("groove", GROOVE)], PART, [BALL], SETUP, 0.8)
    before = field.values.copy()
    piece = clipped(field, np.array([[0.0, 0, -5], [10, 10, 0]]))
    np.testing.assert_array_equal(field.values, before)
    assert 0 < piece.volume < field.volume and piece.values.min() >= -np.float32(0.8)


@pytest.mark.parametrize("box", [[[0, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, math.inf, 1]], [[50, 0, 0], [60, 9, 9]]])
def test_a_window_that_is_none_is_refused(box):
    with pytest.raises(InputError) as refused:
        groove(0.1, box)
    assert refused.value.code == "bad_mesh_box" and refused.value.measured


@pytest.mark.parametrize("step", [0.0019, -1.0, math.nan, 5.1])
def test_a_step_out_of_bounds_is_refused(step):
    with pytest.raises(InputError) as refused:
        groove(step, [[0, 0, -1], [1, 1, 0]])
    assert refused.value.code == "bad_mesh_step"


def test_threads_do_not_change_a_byte_and_progress_rises():
    told = []
    one = machined_stock([("groove", GROOVE)], PART, [BALL], ProofSetup(uncertainty=0.0), 0.3, threads=1,
                         progress=told.append)
    two = machined_stock([("groove", GROOVE)], PART, [BALL], ProofSetup(uncertainty=0.0), 0.3, threads=2)
    np.testing.assert_array_equal(one.values, two.values)
    assert told == sorted(told) and told[-1] == 1.0 and len(told) > 10
