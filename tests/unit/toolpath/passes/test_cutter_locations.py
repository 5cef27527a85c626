"""Tips from contacts for ball, bull nose and flat, along any axis, and passes raised over what stands in the way."""

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_cutter
from toolpath.passes.cutter_locations import lifted, tips
from toolpath.passes.forward_step import PassProfile, steps

TOOLS = {name: ToolBody("T1", 1, 6.0, corner, 20.0, 6.0, 30.0, 6.0, 40.0)
         for name, corner in (("ball", 3.0), ("bull", 1.0), ("flat", 0.0))}


def signed(point, tip, axis, tool):
    """Signed distance of a place to a standing cutting part."""
    w = point - tip
    h = w @ axis
    rho = np.linalg.norm(w - h * axis)
    x, y = rho - (tool.radius - tool.corner_radius), tool.corner_radius - h
    out = np.hypot(max(x, 0.0), max(y, 0.0)) if x > 0 or y > 0 else max(x, y)
    return out - tool.corner_radius


@pytest.mark.parametrize("name", TOOLS)
def test_a_tool_touches_its_contact_and_no_place_of_the_plane_there(name):
    rng = np.random.default_rng(4)
    tool = TOOLS[name]
    for _ in range(60):
        contact, normal, axis = rng.normal(size=3) * 20, rng.normal(size=3), rng.normal(size=3)
        normal, axis = normal / np.linalg.norm(normal), axis / np.linalg.norm(axis)
        if normal @ axis < 0.05 or normal @ axis > 0.99:
            continue
        tip = tips(contact[None], normal[None], tool, axis)[0]
        assert signed(contact, tip, axis, tool) == pytest.approx(0.0, abs=1e-9)
        a = np.cross(normal, axis)
        b = np.cross(normal, a)
        for t in rng.uniform(-4, 4, (40, 2)):
            assert signed(contact + t[0] * a + t[1] * b - 1e-9 * normal, tip, axis, tool) > -1e-7


def test_a_flat_on_a_level_place_is_not_guessed():
    up = np.array([[0.0, 0.0, 1.0]])
    assert np.isnan(tips(np.zeros((1, 3)), up, TOOLS["flat"])).any()
    assert tips(np.zeros((1, 3)), up, TOOLS["ball"]) == pytest.approx(np.zeros((1, 3)))


@pytest.mark.parametrize("name", ["bull", "flat"])
def test_on_level_places_of_a_pass_the_end_stands_on_the_side_it_has_beside_them(name):
    """A round of 4 mm that goes over into a plane, crossed, and the edge between both, followed."""
    body = TOOLS[name]

    def across(t):
        turn = np.radians(90.0) * np.clip(2.0 * t - 1.0, 0.0, 1.0)
        x = 4.0 * np.sin(turn) + 6.0 * np.minimum(2.0 * t, 1.0)
        return (np.column_stack([x, 0 * t, 4.0 * np.cos(turn)]),
                np.column_stack([np.sin(turn), 0 * t, np.cos(turn)]))

    def along(t):
        return np.column_stack([0 * t, 9.0 * t, 0 * t]), np.tile([0.0, 0.0, 1.0], (len(t), 1))

    for curve, side in ((across, [1.0, 0, 0]), (along, [-1.0, 0, 0])):
        profile = PassProfile.of(curve, 0.01, 1.0)
        ends = np.linspace(0.0, profile.length, 30)
        (made,), raised = lifted(profile, ends, body, lambda xy: np.full(len(xy), -np.inf), 0.01)
        assert np.isfinite(made).all() and not raised
        apart = made[0, :2] - curve(np.zeros(1))[0][0, :2]
        assert apart == pytest.approx((body.radius - body.corner_radius) * np.array(side[:2]), abs=1e-9)


def level_pass(length=30.0):
    return PassProfile.of(lambda t: (np.column_stack([length * t, 0 * t, 0 * t]),
                                     np.tile([0.0, 0.0, 1.0], (len(t), 1))),
                      0.001, 3.0)


def test_a_pass_is_raised_over_a_block_on_its_way_and_nowhere_else():
    tool = TOOLS["ball"]
    floor = TriangleMesh([[-50, -50, 0], [80, -50, 0], [80, 50, 0], [-50, 50, 0]], [[0, 1, 2], [0, 2, 3]])
    block = box_mesh([14.0, -2.0, 0.0], [16.0, 2.0, 1.5])
    both = TriangleMesh(np.vstack([floor.vertices, block.vertices]),
                        np.vstack([floor.faces, block.faces + len(floor.vertices)]))
    tree, cutter = TriangleTree(both), Cutter.of(tool)

    def limit(xy):
        return drop_cutter(tree, cutter, xy)

    profile = level_pass()
    (made,), raised = lifted(profile, steps(profile, 3.0, 0.002), tool, limit, 0.002)
    assert raised
    x = np.linspace(0.0, 30.0, 4001)
    high = np.interp(x, made[:, 0], made[:, 2])
    true = np.maximum(limit(np.column_stack([x, 0 * x])), 0.0)
    assert high == pytest.approx(true, abs=0.01)
    assert (high[np.abs(x - 15.0) > 6.0] == 0.0).all() and high.max() == pytest.approx(1.5, abs=1e-3)


def test_a_free_pass_keeps_its_locations():
    tool = TOOLS["ball"]
    profile = level_pass()
    ends = steps(profile, 3.0, 0.002)
    (made,), raised = lifted(profile, ends, tool, lambda xy: np.full(len(xy), -np.inf), 0.002)
    assert not raised and made[:, 0] == pytest.approx(ends) and len(made) == len(ends)


def test_a_pass_is_broken_at_a_wall_it_cannot_climb():
    def limit(xy):
        return np.where(np.abs(xy[:, 0] - 15.0) < 4.0, 20.0, -np.inf)

    profile = level_pass()
    pieces, raised = lifted(profile, steps(profile, 3.0, 0.002), TOOLS["ball"], limit, 0.002)
    assert raised and len(pieces) == 2
    assert pieces[0][-1, 0] == pytest.approx(11.0, abs=0.03) and pieces[1][0, 0] == pytest.approx(19.0, abs=0.03)
    assert all((p[:, 2] == 0.0).all() for p in pieces)
