"""Cutters under an arm along Z: what they cut there is seen, and ways through the slot they cut are clean."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import prism
from tests.pocket_case import line_of, text
from verify.model import NcProgram, ProofSetup, ScoredSamples
from verify.prove import prove

MILL = ToolBody("T1", 1, 10.0, 0.0, 12.0, 9.8, 20.0, 10.0, 40.0)
SLOT = ToolBody("T2", 2, 12.0, 0.0, 3.0, 6.0, 25.0, 6.0, 40.0, (HolderFrustum(20.0, 20.0, 20.0),))
SETUP = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, rapid_feed=5000.0)
PROFILE = [(-20, -10), (20, -10), (20, -6), (-2, -6), (-2, -3), (0, -3), (0, 0), (-20, 0)]  # X, Z
FANS = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 7), (4, 5, 6), (4, 6, 7)]
PART = prism(PROFILE, FANS, 15.0)
"""An arm 2 mm out over a slot 3 mm high, 30 mm long in Y; faces 1..8 along the profile, 9 and 10 the ends."""


def scored(faces: tuple[int, ...]) -> ScoredSamples:
    """Samples of floor, web and underside; those of ``faces`` are claimed."""
    s = sample_surface(PART.mesh, 100.0, seed=5, triangles=np.flatnonzero(np.isin(PART.mesh.face_ids, (3, 4, 5))))
    return ScoredSamples(s, np.where(np.isin(s.face, faces), 1, 0).astype(np.int32))


def program(*way: str) -> list[str]:
    """The open side is milled away, then the slot cutter does what is said, from X30 Y-30 at its depth."""
    out = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X5 Y-25"]
    for z in (0.0, -2.0, -4.0, -6.0):
        for x in (5.0, 12.0, 19.0, 25.0):
            out += [f"G0 X{x} Y-25", f"Z{z}", "G1 Y25 F400", "G0 Z20"]
    out += ["T2 M6", "S8000 M3", "G0 G43 H2 Z20", "X30 Y-30", "Z-6", *way, "G0 Z20", "M5", "M30", "%"]
    return out


CUT = ["X5.5 Y-25", "G1 X4 F400", "G1 Y25"]


def proved(lines, faces=(4,), **setup):
    return prove([NcProgram("p", text(lines))], PART, [MILL, SLOT], replace(SETUP, **setup), scored(faces), ("Z1",))


def test_the_bracket_is_closed():
    assert PART.mesh.volume == pytest.approx(30.0 * (40 * 4 + 18 * 6 + 2 * 3))


@pytest.mark.parametrize("blank", ["box", "part_offset"])
def test_a_rapid_through_the_slot_it_cut_is_clean(blank):
    lines = program(*CUT, "G0 X5.5", "Y-25", "X30")
    found = proved(lines, faces=(3, 4), stock_kind=blank, clearance_rapid=0.0)
    assert not found.findings, found.findings
    assert found.line_spacing < 0.2


def test_a_rapid_that_drags_over_the_floor_of_its_slot_is_told():
    """The rapid clearance holds above and below the cutter too."""
    lines = program(*CUT, "G0 X5.5", "Y-25", "X30")
    found = proved(lines, faces=(3, 4))
    assert [(f.kind, f.line, f.near) for f in found.findings] == [("rapid", line_of(lines, "Y-25", -1), True)]
    assert found.findings[0].depth == pytest.approx(0.0, abs=1e-6)


def test_a_rapid_into_the_slot_before_it_is_cut_is_told():
    """The cutter goes 1.5 mm into what stands under the arm."""
    lines = program("X4.5 Y-25", "Y25")
    told = [f for f in proved(lines).findings if f.kind == "rapid" and f.line == line_of(lines, "Y25")]
    assert told and "into stock" in told[0].message
    assert told[0].depth == pytest.approx(1.5, abs=0.16)


def test_engagement_under_the_arm_counts():
    """1.5 mm wide of 12: 41 degrees."""
    found = proved(program("X5.5 Y-25", "G1 X4.5 F400", "G1 Y25"), max_engaged={2: np.radians(30.0)})
    assert any(f.kind == "engagement" for f in found.findings)


@pytest.mark.parametrize("way", [(), (*CUT, "G0 X5.5", "Y-25", "X30")], ids=["alone", "after the slot"])
def test_a_plunge_beside_the_edge_is_as_deep_whatever_the_slot_cutter_did_before(way):
    plunge = ["G0 Z20", "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X-24.1 Y0", "Z1", "G1 Z-4 F100", "G1 Z1", "G0 Z20"]
    found = proved(program(*way)[:-3] + plunge + ["M5", "M30", "%"], faces=())
    assert [f.depth for f in found.findings if f.kind == "plunge"] == pytest.approx([4.5], abs=1e-6)
