"""Deep parts: every kind of opening is one valid solid, deeper than its tool is wide, the same each time."""

from __future__ import annotations

import pytest

from examples.family.deep import COUNT, DEEPEST, OUTLINES, SHALLOWEST, THINNEST, WIDEST, deep_part
from schemas.setup import Setup

cq = pytest.importorskip("cadquery")


@pytest.fixture(scope="module")
def parts():
    return [deep_part(seed) for seed in range(len(OUTLINES))]


def test_every_kind_of_opening_is_cut_into_one_solid(parts):
    assert [p.outline for p in parts] == list(OUTLINES)
    for p in parts:
        box = p.shape.BoundingBox()
        assert p.shape.isValid() and abs(box.zmin) < 1e-6
        assert (box.zmax - p.depth < 1e-6) == p.through
        assert 0.1 < p.shape.Volume() / (box.xlen * box.ylen * box.zlen) < 0.98


def test_an_opening_is_deeper_than_its_tool_is_wide_and_the_neck_reaches_its_floor(parts):
    for p in parts:
        Setup.model_validate(p.setup)
        for tool in p.setup["tools"]:
            assert SHALLOWEST <= p.depth <= DEEPEST and p.depth >= tool["diameter_mm"]
            assert tool["neck_length_mm"] > p.depth and tool["flute_length_mm"] >= tool["diameter_mm"]


def test_what_is_left_out_is_the_outer_sides(parts):
    for p in parts:
        left_out = p.setup.get("operations", {}).get("exclude_faces", [])
        assert len(left_out) in (0, 4)
        box, faces = p.shape.BoundingBox(), p.shape.Faces()
        sides = sum(faces[int(name[1:]) - 1].Area() for name in left_out)
        assert not left_out or sides == pytest.approx(2.0 * (box.xlen + box.ylen) * box.zlen)


def test_the_series_has_the_whole_range_of_tools_and_the_same_bytes_again(parts, tmp_path):
    sizes = sorted(deep_part(seed).setup["tools"][0]["diameter_mm"] for seed in (0, 47))
    assert sizes == [THINNEST, WIDEST] and COUNT == 60
    first, again = (deep_part(1).write(tmp_path / name) for name in ("a", "b"))
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in again]
