"""Figures by zone and by face: sums that can be done by hand, and of several accesses the least that is left."""


import numpy as np
import pytest

from geometry.sampling import SurfaceSamples
from tests.pocket_case import SETUP, TOOL, ZONES, block, program, scored, text
from verify.model import ProofSetup
from verify.prove import prove
from verify.surface.sample_scores import face_proofs, proved_samples, zone_proofs

BUDGET = ProofSetup(scallop_height=0.02, gouge_tolerance=0.01, stock_allowance=0.1)
FACE = np.array([7, 3, 7, 7, 3, 7], np.int32)
AREA = np.array([1.0, 2.0, 1.0, 1.0, 2.0, 3.0])
SAMPLES = SurfaceSamples(np.zeros((6, 3)), np.tile([0.0, 0, 1], (6, 1)), AREA, FACE, np.zeros(6, np.int32))
RESIDUAL = np.array([0.1, 0.12, 0.115, 0.4, -0.03, 0.11])
REACHED = np.array([True, False, True, False, True, True])


def test_figures_of_faces_are_those_of_their_samples():
    proved = proved_samples(RESIDUAL, BUDGET)
    assert proved.tolist() == [True, True, True, False, False, True]
    faces = face_proofs(SAMPLES, RESIDUAL, REACHED, proved, BUDGET)
    assert list(faces) == [3, 7]
    three, seven = faces[3], faces[7]
    assert (three.number, three.area, three.proved_area, three.coverage) == (3, 4.0, 2.0, 0.5)
    # not reached, and within the budget as the blank has it: not uncut
    assert three.uncut == 0.0 and three.gouge == pytest.approx(0.03) and three.left_max == pytest.approx(0.02)
    assert seven.uncut == 1.0 and seven.gouge == 0.0 and seven.coverage == pytest.approx(5 / 6)
    # by area: 0, 0.01, 0.015 and 0.3 with weights 1, 3, 1 and 1; half of the way between the middles lies at 2.5
    assert seven.left_p50 == pytest.approx(0.01 + 0.005 * 0.25) and seven.left_max == pytest.approx(0.3)


def test_faces_without_samples_are_not_named():
    none = np.zeros(0, np.int64)
    empty = SAMPLES.subset(none)
    assert face_proofs(empty, RESIDUAL[none], REACHED[none], REACHED[none], BUDGET) == {}


def test_a_proof_names_every_judged_face_and_adds_up():
    part = block()
    judged = scored(part)
    proof = prove([("pocket", text(program()))], part, (TOOL,), SETUP, judged, ZONES)
    assert list(proof.faces) == [7, 8, 9, 10, 11]
    assert sum(f.area for f in proof.faces.values()) == pytest.approx(judged.samples.area.sum())
    good = judged.samples.area[proof.proved].sum()
    assert sum(f.proved_area for f in proof.faces.values()) == pytest.approx(good)
    floor = proof.faces[11]
    assert floor.gouge < 1e-9 and floor.left_p50 == pytest.approx(0.0, abs=1e-6) and floor.coverage > 0.98
    assert proof.as_dict()["faces"]["F11"]["area"] == floor.area
    assert zone_proofs(judged, proof.residual, proof.proved, SETUP, ZONES) == proof.zones


def test_a_program_that_cuts_air_leaves_every_face_uncut():
    part = block()
    lines = program()
    air = [line for line in lines if "Z-" not in line and not line.startswith("G1 Z")]
    proof = prove([("air", text(air))], part, (TOOL,), SETUP, scored(part), ZONES)
    assert all(f.uncut == pytest.approx(f.area) and f.coverage == 0 for f in proof.faces.values())
