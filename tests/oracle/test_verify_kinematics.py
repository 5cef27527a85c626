"""Kinematics of the witness against printed joints of LinuxCNC, a chain of matrices, and the controller itself."""

import fcntl
import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import VerificationError
from verify.gcode.reader import read_program
from verify.kinematics import KINDS, Kinematics

ZERO = (0.0, 0.0, 0.0)
PIVOTS = {"table-table-AC": ((3.0, -2.0, -40.0), (1.5, 4.0, -7.0)),
          "table-table-BC": ((-3.0, 8.0, -55.0), (2.0, 1.0, 9.0)),
          "head-table-BC": ((0.0, 0.0, 120.0), (12.0, -5.0, 3.0)), "head-head-BC": ((0.0, 0.0, 90.0),),
          "head-head-AC": ((0.0, 0.0, 75.0),)}
# Joints that LinuxCNC 2.9 (xyzac-trt, xyzbc-trt, identity first) stood at after M428, G0 to the place, M429.
PRINTED = [("table-table-AC", (10, 0, 5), (30, 90), (0, 6.16, 9.33)),
           ("table-table-AC", (-12.5, 7, 3), (-71.841, -35.93), (-6.014, 6.903, -11.421)),
           ("table-table-AC", (4, -9, 20), (100, -400), (-2.721, -18.052, -12.795)),
           ("table-table-BC", (10, 0, 5), (30, 90), (2.5, 10, 4.33)),
           ("table-table-BC", (-12.5, 7, 3), (-71.841, -35.93), (-4.725, 13.003, -4.78)),
           ("table-table-BC", (4, -9, 20), (100, 400), (18.159, -4.323, -12.188))]
IMPELLER = Path("/usr/share/doc/linuxcnc/examples/sample-configs/sim/axis/vismach/5axis/table-rotary-tilting/demos/"
                "impeller-7bl-xyzac.ngc")
CONTROLLER = Path(__file__).parents[2].parent / "shared" / "tools" / "linuxcnc_run.sh"


def turned(letter, angle):
    """Homogeneous turn about X, Y or Z, entry by entry."""
    i, j = {"A": (1, 2), "B": (2, 0), "C": (0, 1)}[letter]
    m = np.eye(4)
    m[i, i] = m[j, j] = np.cos(angle)
    m[i, j], m[j, i] = -np.sin(angle), np.sin(angle)
    return m


def moved(x, y, z):
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def about(point, m):
    return moved(*point) @ m @ moved(*-np.array(point))


def chain(machine, joints, turn, gauge):
    """Tip and axis on the part: head frame and table frame as products of matrices, one link after the other."""
    tilt, spin = turned(machine.letters[0], turn[0]), turned("C", turn[1])
    head, table = np.eye(4), np.eye(4)
    if machine.tilts_head:
        swivel = np.array([*joints[:2], joints[2] + machine.pivots[0][2] + gauge])
        head = about(swivel, spin @ tilt if machine.turns_head else tilt)
    else:
        table = about(machine.pivots[0], tilt)
    if not machine.turns_head:
        table = table @ about(machine.pivots[1], spin)
    both = np.linalg.inv(table) @ head
    return (both @ [*joints, 1])[:3], (both @ [0, 0, 1, 0])[:3]


def machine_of(kind):
    return Kinematics(kind, PIVOTS[kind])


def cases(count=200):
    rng = np.random.default_rng(11)
    return rng.uniform(-80, 80, (count, 3)), rng.uniform(-7, 7, (count, 2)), rng.uniform(40, 160, count)


@pytest.mark.parametrize("kind, tip, degrees, joints", PRINTED)
def test_joints_printed_by_linuxcnc(kind, tip, degrees, joints):
    machine, turn = Kinematics(kind, (ZERO, ZERO)), np.radians([degrees])
    np.testing.assert_allclose(machine.joints(np.array([tip], float), turn, 0.0)[0], joints, atol=6e-4)
    np.testing.assert_allclose(machine.tip(np.array([joints], float), turn, 0.0)[0], tip, atol=1.5e-3)


@pytest.mark.parametrize("kind, degrees, axis", [
    ("table-table-AC", (90, 0), (0, 1, 0)), ("table-table-AC", (90, 90), (1, 0, 0)),
    ("table-table-BC", (90, 0), (-1, 0, 0)), ("head-table-BC", (90, 0), (1, 0, 0)),
    ("head-table-BC", (90, 90), (0, -1, 0)), ("head-head-BC", (90, 90), (0, 1, 0)),
    ("head-head-AC", (90, 0), (0, -1, 0)), ("head-head-AC", (90, 90), (1, 0, 0))])
def test_axes_by_hand(kind, degrees, axis):
    np.testing.assert_allclose(Kinematics(kind).axis(np.radians([degrees]))[0], axis, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_chain_of_matrices_says_the_same(kind):
    machine = machine_of(kind)
    joints, turn, gauge = cases()
    want = [chain(machine, j, t, g) for j, t, g in zip(joints, turn, gauge, strict=True)]
    np.testing.assert_allclose(machine.tip(joints, turn, gauge), [w[0] for w in want], atol=1e-10)
    np.testing.assert_allclose(machine.axis(turn), [w[1] for w in want], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_there_and_back(kind):
    machine = machine_of(kind)
    joints, turn, gauge = cases()
    np.testing.assert_allclose(machine.joints(machine.tip(joints, turn, gauge), turn, gauge), joints, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(machine.axis(turn), axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(machine.tip(joints, np.zeros_like(turn), gauge), joints, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_tables_move_the_part_rigidly_and_heads_do_not_move_it(kind):
    """With the axes standing, a step of the joints is as long on the part; up the tool it is a step along the axis."""
    machine = machine_of(kind)
    joints, turn, gauge = cases()
    step = np.random.default_rng(3).normal(size=joints.shape)
    made = machine.tip(joints + step, turn, gauge) - machine.tip(joints, turn, gauge)
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), np.linalg.norm(step, axis=1), atol=1e-10)
    if machine.turns_head:
        np.testing.assert_allclose(made, step, atol=1e-10)
    if not machine.tilts_head:
        up = machine.tip(joints + [0, 0, 1], turn, gauge) - machine.tip(joints, turn, gauge)
        np.testing.assert_allclose(up, machine.axis(turn), atol=1e-10)


@pytest.mark.parametrize("kind, pivots, words", [
    ("table-AC", None, "unknown kinematics"), ("table-table-AC", (ZERO,), "2 pivots"),
    ("head-head-BC", (ZERO, ZERO), "1 pivots"), ("head-table-BC", ((1.0, 0.0, 5.0), ZERO), "swivel"),
    ("head-head-AC", ((0.0, 0.0, -5.0),), "swivel")])
def test_a_machine_that_cannot_be_is_refused(kind, pivots, words):
    with pytest.raises(VerificationError, match=words) as caught:
        Kinematics(kind, pivots)
    assert caught.value.code == "bad_kinematics" and caught.value.remedy


def test_joints_want_pivots():
    with pytest.raises(VerificationError) as caught:
        Kinematics("table-table-AC").joints(np.zeros((1, 3)), np.zeros((1, 2)), 0.0)
    assert caught.value.code == "no_pivots" and "machine.pivots_mm" in caught.value.remedy


@pytest.mark.skipif(not IMPELLER.exists(), reason="the example programs of LinuxCNC are not installed")
def test_an_impeller_by_others_is_read_and_its_joints_go_as_far_as_on_the_controller():
    """LinuxCNC's own demo. The controller, which rounds corners, was asked for its joints every 20 ms of 157 s."""
    machine = Kinematics("table-table-AC", (ZERO, ZERO))
    p = read_program(IMPELLER.read_text(), kinematics=machine, spindle_tool=1)
    assert len(np.unique(p.line)) == 4492 and (p.tool == 1).all()
    (told,) = p.remarks
    assert "neither G61 nor G64" in told.message
    assert p.assumed == ("G21", "G90", "G17", "G54", "T1 M6", "G43 H1")
    assert np.nansum(p.minutes) == pytest.approx(sum(
        1 / float(line.split("F")[1]) for line in IMPELLER.read_text().splitlines() if line.startswith("G1")))
    joints = machine.joints(p.end, p.poses.end_turn, 0.0)
    for found, printed in ((joints.min(axis=0), (-45.434, -19.826, -9.295)),
                           (joints.max(axis=0), (30.524, 43.559, 44.268))):
        np.testing.assert_allclose(found, printed, atol=0.45)
    np.testing.assert_allclose(np.degrees(p.poses.end_turn).min(axis=0), (-74.49, -399.805))


@pytest.mark.slow
@pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller ../shared/tools/linuxcnc_run.sh is not there")
@pytest.mark.parametrize("kins, kind", [("xyzac", "table-table-AC"), ("xyzbc", "table-table-BC")])
def test_the_controller_itself_goes_there(tmp_path, kins, kind):
    machine = Kinematics(kind, (ZERO, ZERO))
    tip, degrees = np.array([[23.0, -31.0, 12.5]]), np.array([[-48.25, 211.5]])
    words = "X{} Y{} Z{}".format(*tip[0]) + " {}{} C{}".format(kind[-2], *degrees[0])
    file = tmp_path / "there.ngc"
    file.write_text(f"G21 G17 G90 G94\nM428\nG0 {words}\nM429\nG4 P0.1\nM2\n")
    with open(Path(tempfile.gettempdir()) / "zonemill-linuxcnc.lock", "w") as alone:
        fcntl.flock(alone, fcntl.LOCK_EX)  # a machine has shared memory for one controller
        for _ in range(8):  # the interpreter, which other tests run beside it, takes the same memory for a moment
            done = subprocess.run(["bash", str(CONTROLLER), "--kins", kins, "--limit", "60", str(file)],
                                  capture_output=True, text=True, timeout=180)
            if "did not start" not in done.stdout + done.stderr:
                break
            time.sleep(5.0)
    assert done.returncode == 0, done.stdout + done.stderr
    end = json.loads(done.stdout.strip().splitlines()[-1])["end"]
    np.testing.assert_allclose(machine.joints(tip, np.radians(degrees), 0.0)[0], end[:3], atol=1e-3)
