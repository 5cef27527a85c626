"""Passes along the borders of faces in a plan: what they leave, where they go, and when they are taken."""

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import ball, field_of, plan_part, slope_field, tool
from toolpath.counterexamples import NONE
from toolpath.lines import Line
from toolpath.passes.isoparametric_passes import Flank
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import TrimmedFace
from toolpath.plan_settings import Pattern
from toolpath.planning.zone_finishing import Finish
from toolpath.planning.zone_layout import Strategy
from toolpath.scallop_budget import ScallopBudget
from toolpath.stock.cut_history import Depths, Walked
from toolpath.strategies import isoparametric
from toolpath.strategies.isoparametric import course, laid
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from zones.lattice import Lattice

SCALLOP, CHORD = 0.02, 0.004
SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
DISC = 0.5 + 0.4 * np.column_stack([f(np.linspace(0, 2 * np.pi, 81)[:-1]) for f in (np.cos, np.sin)])


def bowl(a, b, loop=SQUARE, size=12.0):
    """z = a x² + b y² as a mesh, face 2, and as the exact face."""
    half = 0.5 * size
    x = np.array([-half, 0.0, half])
    square = np.array([half**2, -half**2, half**2])  # the control points of x² over -half to half
    net = np.stack([*np.meshgrid(x, x, indexing="ij"), a * square[:, None] + b * square[None, :]], -1)
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    mesh = slope_field(lambda x, y: a * x * x + b * y * y, size, 160)
    area = float(mesh.areas[mesh.face_ids == 2].sum())
    return mesh, TrimmedFace(2, NurbsSurface(net, knots, knots, (3, 3)), (loop,), area)


def samples_on(mesh, face, region):
    """Even samples of the top with exact normals, those in plan where ``region`` holds."""
    s = sample_surface(mesh, 60.0, seed=3, triangles=np.flatnonzero(mesh.face_ids == 2))
    uv = np.clip(s.points[:, :2] / 12.0 + 0.5, 0.0, 1.0)
    points, normals = face.surface.points_and_normals(uv)
    keep = region(*s.points[:, :2].T)
    return points[keep], normals[keep]


def left_by(lines, points, normals, body):
    start, end = (np.vstack([line.points[k] for line in lines]) for k in (slice(None, -1), slice(1, None)))
    moves = Moves(start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32))
    return residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]


def everywhere(x, y):
    return np.ones(len(x), bool)


@pytest.mark.parametrize(("a", "b", "allowance"), [(0.05, -0.03, 0.0), (0.06, 0.02, 0.0), (0.05, -0.03, 0.15)])
def test_passes_leave_no_more_than_the_scallop_and_never_gouge(a, b, allowance):
    (mesh, face), body = bowl(a, b), ball(3.0)
    field = field_of(mesh, body, allowance)
    points, normals = samples_on(mesh, face, everywhere)
    target = FinishTarget(points, normals, points, 60.0**-0.5)
    found = course([face], target, field, SCALLOP, CHORD, None)
    lines = [line for group in laid(found, field, SCALLOP, CHORD, 0.002)[0] for line in group]
    left = left_by(lines, points, normals, body) - allowance
    assert left.max() <= SCALLOP and left.min() > -CHORD
    assert left.max() > 0.5 * SCALLOP
    for line in lines:
        assert (line.points[:, 2] >= field.tips(line.points[:, :2]) - 1e-3).all()


def test_passes_go_where_there_is_something_to_cut():
    (mesh, face), body = bowl(0.05, -0.03), ball(3.0)
    field = field_of(mesh, body)
    points, normals = samples_on(mesh, face, lambda x, y: x < -1.0)
    target = FinishTarget(points, normals, points, 60.0**-0.5)
    found = course([face], target, field, SCALLOP, CHORD, None)
    lines = [line for group in laid(found, field, SCALLOP, CHORD, 0.002)[0] for line in group]
    assert left_by(lines, points, normals, body).max() <= SCALLOP
    assert max(line.points[:, 0].max() for line in lines) < 1.5
    assert found.way == pytest.approx(sum(Line(line.points, False).length for line in lines), rel=0.1)


def test_passes_on_a_wall_have_the_material_on_their_right():
    (mesh, face), body = bowl(0.0, 0.3), ball(2.0)  # steep where |y| is large
    field = field_of(mesh, body)
    points, normals = samples_on(mesh, face, lambda x, y: y > 4.0)
    found = course([face], FinishTarget(points, normals, points, 60.0**-0.5), field, SCALLOP, CHORD, Flank(2.0, 10.0))
    assert found.groups
    for line in (one for group in laid(found, field, SCALLOP, CHORD, 0.002)[0] for one in group):
        assert np.ptp(line.points[:, 2]) < 0.01  # level: along x
        assert line.points[-1, 0] < line.points[0, 0]  # the wall is at greater y, which going to less x is on the right


def test_what_folds_is_named():
    mesh, _ = bowl(0.05, -0.03)
    knot = TrimmedFace(7, bowl(0.05, -0.03)[1].surface, (np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]]),), 144.0)
    target = FinishTarget(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.zeros((1, 3)), 0.1)
    found = course([knot], target, field_of(mesh, ball(3.0)), SCALLOP, CHORD, None)
    assert not found.groups and found.refused[0].startswith("F7: ")


def test_a_face_with_a_pole_is_named_and_the_plan_goes_on():
    """Control points of one side in one place: there the surface has no normal."""
    mesh, face = bowl(0.05, -0.03)
    net = face.surface.control.copy()
    net[:, 0] = net[1, 0]
    knots = face.surface.knots_u
    pole = TrimmedFace(2, NurbsSurface(net, knots, knots, (3, 3)), face.loops, face.area)
    case = plan_part(mesh, [ball(3.0)], scallop=SCALLOP, chord=CHORD, faces={2}, trimmed=(pole,))
    plan = max(case.plan.zones, key=lambda z: len(z.zone.samples))
    assert plan.strategy != isoparametric.NAME
    assert any(str(r["reason"]).startswith("F2: ") for r in plan.rejected)


@pytest.mark.parametrize(("a", "b", "loop"), [
    (0.05, -0.03, SQUARE), pytest.param(0.08, 0.05, SQUARE, marks=pytest.mark.slow), (0.03, 0.03, DISC)])
@pytest.mark.slow
def test_the_faster_strategy_is_taken_and_the_other_told_with_its_figure(a, b, loop):
    mesh, face = bowl(a, b, loop)
    case = plan_part(mesh, [ball(3.0)], scallop=SCALLOP, chord=CHORD, faces={2}, trimmed=(face,))
    plan = max(case.plan.zones, key=lambda z: len(z.zone.samples))
    told = [r for r in plan.rejected if isoparametric.NAME in (r["strategy"], plan.strategy)]
    assert told and told[-1]["value"] >= told[-1]["limit"] > 0
    plain = plan_part(mesh, [ball(3.0)], scallop=SCALLOP, chord=CHORD, faces={2})
    (usual,) = [z for z in plain.plan.zones if z.zone.id == plan.zone.id]
    assert len(plan.left) <= len(usual.left)
    seconds = [sum(s.seconds for s in c.plan.steps if s.zone == plan.zone.id) for c in (case, plain)]
    assert seconds[0] <= seconds[1] + 1e-9
    if plan.strategy == isoparametric.NAME:
        assert told[-1]["value"] == pytest.approx(seconds[1], abs=0.06)


@pytest.mark.slow
def test_who_asks_for_a_pattern_gets_it():
    mesh, face = bowl(0.05, -0.03)
    case = plan_part(mesh, [ball(3.0)], scallop=SCALLOP, faces={2}, trimmed=(face,), pattern=Pattern.ZIGZAG)
    assert {z.strategy for z in case.plan.zones} == {"zigzag"}


def test_a_sharp_end_gets_none():
    mesh, face = bowl(0.05, -0.03)
    case = plan_part(mesh, [tool(3.0, 0.0)], scallop=0.1, chord=CHORD, faces={2}, trimmed=(face,))
    assert isoparametric.NAME not in {z.strategy for z in case.plan.zones}


@pytest.mark.parametrize(("left", "seconds", "kept", "reason"), [
    ((3, 0), (10.0, 10.4), "isoparametric", "more samples are left above the scallop"),
    ((0, 3), (10.4, 10.0), "waterline", "more samples are left above the scallop"),
    ((2, 2), (10.4, 10.0), "isoparametric", "takes longer at equal scallop, s"),
    ((0, 0), (10.0, 10.4), "waterline", "takes longer at equal scallop, s"),
    ((4, 4), (None, 10.4), "isoparametric", "no pass can be cut")])
def test_of_two_strategies_the_one_that_leaves_less_stays_and_of_equals_the_faster(left, seconds, kept, reason):
    ways = [Line(np.array([[0.0, y, 1.0], [5.0, y, 1.0]]), False) for y in (1.0, 2.0)]

    class Stub(Finish):
        def __init__(self):
            self.checks, self.given, self.walked = SimpleNamespace(points=np.zeros((4, 3))), 4, Walked()
            self.settings = SimpleNamespace(scallop_height=0.02, found=NONE, turning=None,
                                            budget=ScallopBudget(0.02, 0.002))
            self.zone, self.stock = SimpleNamespace(id="Z1"), SimpleNamespace(become=lambda _: None)
            self.residual = SimpleNamespace(residual=np.ones(4))
            self.strategy, self.depths = Strategy("waterline", 1.0, None, False), Depths(Lattice(0.0, 0.0, 0.5, 12, 6))
            self.settled = False
            self.layout = SimpleNamespace(along_borders=(Strategy("isoparametric", 1.0, None, False), ()))

        def _copied(self, strategy):
            k = int(strategy.name == "isoparametric")
            rest = np.where(np.arange(4) < left[k], 0.03, 0.01)
            steps = [] if seconds[k] is None else [SimpleNamespace(seconds=seconds[k])]
            walked, depths = self.walked.copied(), self.depths.copied()
            walked.add(ways[k].points)
            depths.cut(ways[k].points)
            return SimpleNamespace(strategy=strategy, begun_with="", stock=None, walked=walked, depths=depths,
                                   cut=None, met=None, step=None, passes=0,
                                   residual=SimpleNamespace(residual=rest), _rounds=lambda _id, _wanted: steps)

    finish = Stub()
    remembered, depths = finish.walked, finish.depths
    finish.walk("S01")
    assert finish.walked is remembered and finish.depths is depths  # the zones of a tool share them
    assert [depths.lowest(way.points[0]) for way in ways] == [1.0 if kept == name else np.inf
                                                              for name in ("waterline", "isoparametric")]
    assert [not remembered.fresh(way).any() for way in ways] == [kept == "waterline", kept == "isoparametric"]
    assert finish.strategy.name == kept
    assert finish.strategy.rejected[-1]["reason"] == reason
    assert finish.strategy.rejected[-1]["strategy"] != kept
