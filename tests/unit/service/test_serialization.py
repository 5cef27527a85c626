"""Plans and proofs as bytes: what comes back is what went in, and nothing else is taken."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from geometry.errors import CamError
from geometry.machine_rates import Rates
from service.serialization import Known, pack, unpack
from tests.synthetic_plan import BALL
from toolpath.counterexamples import Counterexamples, HighWall
from toolpath.planning.job_plan import Plan
from toolpath.workingsteps import ArcSpan, Trajectory, TrajectoryKind, Workingstep
from verify.assumptions import Assumed, AssumedKind
from verify.cutting_words import ProgramCaution
from verify.model import Finding, FindingKind
from zones.lattice import Lattice

FINDING = Finding(FindingKind.PLUNGE, "program.linuxcnc.ngc", 7, "Z1", None, (1.0, 2.0, 3.0), 0.1, 0.05, "too deep")


@pytest.mark.parametrize("value", [
    None, True, 3, 2.675, float("inf"), -0.0, "ä \n", (), (1, (2.5, None)), [1, (2,)], {1: "a", "b": (0.1,)},
    TrajectoryKind.CUT, FINDING, Rates(1e4, 1e3, 0.001), HighWall(3.0, 1.0, 0.4), Lattice(0.1, 0.2, 0.08, 5, 7),
    (ArcSpan(0, 3, (1.5, 2.5), True),)])
def test_plain_values_come_back_as_they_were(value):
    back = unpack(pack(value))
    assert back == value and type(back) is type(value) and repr(back) == repr(value)


def test_not_a_number_comes_back_too():
    assert np.isnan(unpack(pack(float("nan"))))


@pytest.mark.parametrize("value", [np.float64(2.675), np.int32(7), np.bool_(True), np.float32(0.1)])
def test_a_scalar_of_numpy_stays_one(value):
    """It rounds otherwise than a float: round(2.675, 2) is 2.67 of the one and 2.68 of the other."""
    back = unpack(pack(value))
    assert type(back) is type(value) and back == value


@pytest.mark.parametrize("array", [
    np.arange(12.0).reshape(4, 3), np.asfortranarray(np.arange(12.0).reshape(4, 3)), np.arange(24.0)[::2],
    np.zeros((0, 3)), np.array([True, False]), np.arange(5, dtype=np.int32), np.array([np.nan, np.inf, -0.0]),
    np.array(4.5)])
def test_an_array_keeps_type_shape_bits_and_order_and_can_be_written_to(array):
    back, after = unpack(pack((array, np.arange(3))))
    assert back.dtype == array.dtype and back.shape == array.shape and back.tobytes() == array.tobytes()
    assert back.flags.writeable and back.flags.aligned and after.tolist() == [0, 1, 2]
    if array.flags.c_contiguous or array.flags.f_contiguous:
        assert (back.flags.c_contiguous, back.flags.f_contiguous) == (array.flags.c_contiguous,
                                                                     array.flags.f_contiguous)


def test_a_plan_and_what_proofs_found_come_back(planned_step):
    plan = Plan((planned_step, replace(planned_step, id="S02", fresh=True)), ())
    known = Known({"ToolBody": {planned_step.tool.id: planned_step.tool}})
    back = unpack(pack(plan, known), known)
    assert back.steps[0].tool is planned_step.tool and len(back.steps) == 2
    for one, other in zip(back.steps, plan.steps, strict=True):
        for f in fields(Workingstep):
            if f.name not in ("trajectories", "outline"):
                assert getattr(one, f.name) == getattr(other, f.name), f.name
        assert one.outline.tobytes() == other.outline.tobytes()
        for a, b in zip(one.trajectories, other.trajectories, strict=True):
            assert (a.motion, a.feed, a.arcs) == (b.motion, b.feed, b.arcs) and a.points.tobytes() == b.points.tobytes()
            assert (a.axes is None) == (b.axes is None)
    assert pack(back, known) == pack(plan, known)
    found = Counterexamples({"T1": np.zeros((1, 3))}, left={"Z1": np.array([3, 4])}, unheld=(HighWall(2.0, 1.0, 0.1),))
    assert pack(unpack(pack(found))) == pack(found)


def test_assumptions_and_cautions_of_a_proof_come_back():
    said = (Assumed(AssumedKind.TABLE, 0.5, "a tool may run into the table", "machine.table_z_mm"),
            ProgramCaution("dwell", 1, "p", 9, "stands", 133.0, 10.0, "lift"))
    assert unpack(pack(said)) == said


def test_a_tool_other_than_the_one_that_is_known_is_not_named_by_its_id(planned_step):
    known = Known({"ToolBody": {planned_step.tool.id: replace(planned_step.tool, diameter=99.0)}})
    with pytest.raises(TypeError, match="differs from the known one"):
        pack(planned_step, known)


@pytest.mark.parametrize("value", [object(), CamError("x", code="y"), {1, 2}, np.array([object()]), b"raw", print])
def test_what_is_not_named_is_not_packed(value):
    with pytest.raises(TypeError):
        pack(value)


@pytest.mark.parametrize("tree", [
    {"c": ["Popen", "ls"]}, {"e": ["Popen", "ls"]}, {"k": ["ToolBody", "T1"]}, {"x": 1},
    {"a": ["<f8", [9, 3], 0, False]}, {"a": ["|O", [1], 0, False]}, {"c": ["Lattice", 1.0]},
    {"a": ["<f8", [1], 0, False], "n": 1}, {}])
def test_bytes_that_name_something_else_are_refused(tree):
    words = json.dumps(tree).encode()
    with pytest.raises((ValueError, KeyError, TypeError)):
        unpack(len(words).to_bytes(8, "little") + words + bytes(64))


@pytest.mark.parametrize("data", [b"", b"\x05", (10**9).to_bytes(8, "little"), bytes(8), b"\x02" + bytes(7) + b"{]"])
def test_bytes_that_are_not_ours_are_refused(data):
    with pytest.raises(ValueError):
        unpack(data)


@pytest.fixture
def planned_step():
    arcs = (ArcSpan(0, 2, (0.5, 0.5), True),)
    cut = Trajectory(TrajectoryKind.CUT, np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1.5]]), 300.0, arcs=arcs)
    leaning = Trajectory(TrajectoryKind.CONNECT, cut.points[1:], np.float64(20.5),
                         np.array([[0.0, 0, 1], [0, 0.6, 0.8]]))
    return Workingstep("S01", "S01 Z1", "Z1", (3, 4), "finishing", "waterline", BALL, 8000.0, 300.0, np.float64(0.3),
                       0.01, 0.002, (cut, leaning), np.zeros((5, 2)), 4.0, 1.0)
