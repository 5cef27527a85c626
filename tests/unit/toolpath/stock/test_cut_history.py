"""What counts as walked: moves of level lines, whole lines of others, and nothing that was not."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from tests.hand_parts import SHORT_TOOLS, blocks, plan_part
from toolpath.counterexamples import NONE
from toolpath.lines import Line, true_runs
from toolpath.planning import zone_finishing
from toolpath.planning.zone_finishing import Finish
from toolpath.planning.zone_layout import Strategy
from toolpath.stock.cut_history import ON, OVERLAP, Depths, Walked, still_to_walk
from toolpath.stock.residual_map import ResidualMap
from toolpath.workingsteps import CutDirection, TrajectoryKind
from verify.checks.repeated_passes import WINDOW
from zones.lattice import Lattice


def line(*x, z=1.0, closed=False):
    return Line(np.array([[float(v), 0.1 * float(v) ** 2, z] for v in x]), closed)


def walked(*lines):
    out = Walked()
    for q in lines:
        out.add(q.points)
    return out


def test_parts_of_a_level_line_are_known_either_way_and_from_between_its_points():
    w = walked(line(0, 1, 2, 3, 4, 5))
    assert not w.fresh(line(1, 2, 3)).any()
    assert not w.fresh(line(3, 2, 1)).any()
    between = Line(np.array([[1.5, 0.25, 1.0], [2, 0.4, 1.0], [3, 0.9, 1.0], [3.5, 1.25, 1.0]]), False)
    assert not w.fresh(between).any()  # its ends lie on moves of the first
    assert w.fresh(line(4, 5, 6)).tolist() == [False, True]
    assert w.fresh(line(1, 2, 3, z=1.001)).all()


def test_places_from_different_lines_are_no_move():
    """Both ends known and nobody walked the way between; an end far beyond; a line that crosses at one place."""
    w = walked(line(0, 1), line(5, 6))
    assert w.fresh(line(0, 1, 5, 6)).tolist() == [False, True, False]
    assert w.fresh(line(1, 9)).tolist() == [True]
    cross = Line(np.array([[1.0, -5.0, 1.0], [1.0, 0.1, 1.0], [1.0, 5.0, 1.0]]), False)
    assert w.fresh(cross).all()


def test_of_lines_that_go_up_and_down_the_moves_are_known_too():
    up = Line(np.array([[0.0, 0, 0], [1, 0, 0.5], [2, 0, 0.7]]), False)
    w = walked(up)
    assert not w.fresh(up).any()
    assert not w.fresh(Line(up.points[:2], False)).any()
    raised = up.points + [0.0, 0.0, 0.01]  # a layer above it
    assert w.fresh(Line(raised, False)).all()
    on = Line(np.array([[0.0, 0, 0], [1, 0, 0.5], [3, 0, 0.9]]), False)
    assert w.fresh(on).tolist() == [False, True]


def test_a_copy_is_added_to_on_its_own_until_it_is_taken_over():
    w = walked(line(0, 1))
    other = w.copied()
    other.add(line(1, 2).points)
    assert w.fresh(line(1, 2)).all() and not other.fresh(line(1, 2)).any()
    w.become(other)
    assert not w.fresh(line(0, 1, 2)).any()


@pytest.mark.slow
def test_nothing_is_measured_as_walked_that_no_pass_of_the_tool_went_over(monkeypatch):
    """Short tools in tall blocks, whose lines are cut and topped: what the plan measured, from its own cuts again."""
    import toolpath.planning.job_plan as planner

    finishes = []

    class Kept(planner.Finish):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            finishes.append(self)

    monkeypatch.setattr(planner, "Finish", Kept)
    for seed, kind in ((1, "flat"), (7, "flat"), (5, "ball")):
        finishes.clear()
        c = plan_part(blocks(seed), [SHORT_TOOLS[kind]], near_net=False)
        cuts = [(s.tool, t.points) for s in c.plan.steps for t in s.trajectories if t.motion is TrajectoryKind.CUT]
        for f in finishes:
            true = ResidualMap(f.residual.points, f.checks.normals, margin=f.residual.margin)
            for body, points in cuts:
                true.cut(points, body)
            done = f.residual.residual <= c.settings.scallop_height
            assert (true.residual[done] <= c.settings.scallop_height + c.settings.chordal_tolerance).all(), (seed, kind)


def test_lines_that_are_the_same_once_thinned_out_are_walked_once():
    """Two rings of a floor with other points on the same straight moves: the second is measured, not walked."""
    added = []

    class Stub(Finish):
        def __init__(self):
            self.field, self.walked = SimpleNamespace(tool=SHORT_TOOLS["flat"]), Walked()
            self.strategy = Strategy("spiral", 1.0, None, True)
            self.settings = SimpleNamespace(chordal_tolerance=0.01, ramp_angle=0.05, cut_direction=CutDirection.CLIMB)
            self.residual = SimpleNamespace(cut=lambda points, tool: None)

        def _add_one(self, linker, line, skin, slope, thin):
            added.append(line)
            self.walked.add(line.points)
            self.walked.add(corners)

    corners = np.array([[0.0, 0, 1], [4, 0, 1], [4, 3, 1], [0, 3, 1], [0, 0, 1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])

    def ring(spacing):
        at = np.unique(np.concatenate([way, np.arange(0.0, way[-1], spacing)]))
        return Line(np.column_stack([np.interp(at, way, corners[:, k]) for k in range(3)]), True)

    linker = SimpleNamespace(motions=SimpleNamespace(tolerance=0.002), at=None)
    stub = Stub()
    stub._add(linker, [ring(0.31)], 0)
    assert len(added) == 1 and len(added[0].points) > 20  # with its own points
    stub._add(linker, [ring(0.47)], 0)
    assert len(added) == 1
    other = Line(corners + [0.0, 0.0, 0.5], True)
    stub._add(linker, [other], 0)
    assert len(added) == 2


def test_of_a_layer_over_a_line_only_what_was_not_walked_before_is_walked(monkeypatch):
    """Turns of a spiral along one border have layers that share a stretch: seed 103 ran ten moves twice."""
    lower, layer = line(*range(31)), Line(line(*range(31)).points + [0.0, 0.0, 0.2], False)
    monkeypatch.setattr(zone_finishing.zigzag, "skimmed", lambda *_: [layer, lower])
    added = []

    class Stub(Finish):
        def __init__(self):
            self.field, self.walked, self.stock = SimpleNamespace(tool=SHORT_TOOLS["flat"]), Walked(), None
            self.zone = SimpleNamespace(form=None)
            self.settings = SimpleNamespace(found=NONE)
            self.residual = SimpleNamespace(cut=lambda points, tool: None)

    stub = Stub()
    stub.walked.add(layer.points[8:20])
    linker = SimpleNamespace(motions=SimpleNamespace(tolerance=1e-9), trajectories=[], refused=0,
                             add=lambda way, thin: added.append(way.points) or True)
    stub._add_one(linker, lower, 0.1, 0.05, None)
    whole = [p for p in added if len(p) == 31]
    assert len(added) == 3 and len(whole) == 1 and whole[0] is lower.points
    assert [len(p) for p in added[:2]] == [8 + 1 + OVERLAP, 31 - 19 + OVERLAP]


def test_turns_of_a_line_that_fall_on_one_another_are_found():
    a = np.linspace(0.0, 4.0 * np.pi, 81)
    turns = np.column_stack([np.cos(a), np.sin(a), np.zeros(81)])
    turns[41:] = turns[1:41]  # exactly the same again
    assert Walked.again(Line(turns, False)).tolist() == [False] * 40 + [True] * 40
    assert not Walked.again(Line(turns[:41], True)).any()
    back = Line(np.vstack([turns[:20], turns[18::-1]]), False)  # out and back
    assert Walked.again(back).tolist() == [False] * 19 + [True] * 19
    noise = np.random.default_rng(5).uniform(-4e-5, 4e-5, turns.shape) * (np.arange(81) > 40)[:, None]
    nearly = turns + noise  # the frame of the part, in which it is written, rounds other digits
    assert Walked.again(Line(nearly, False)).tolist() == [False] * 40 + [True] * 40
    known = Walked()
    known.add(turns)
    assert not known.fresh(Line(nearly, False)).any()
    assert known.fresh(Line(nearly + [0.0, 0.0, 1e-3], False)).all()
    spiral = turns * (1.0 + 0.01 * np.arange(81)[:, None])
    assert not Walked.again(Line(spiral, False)).any()


def passed_over(p, q, moves):
    """Whether one of moves (m, 2, 3) that ends at p passes over q: all of them looked at."""
    for a, b in (ends for move in moves for ends in (move, move[::-1])):
        way, size = b - p, float(np.linalg.norm(b - p))
        along = float((q - p) @ way) / size if size > 0.0 else 0.0
        off = np.linalg.norm(q - p - along * way / max(size, 1e-300))
        if np.linalg.norm(a - p) < ON and 0.0 <= along <= size + ON and off < ON:
            return True
    return False


@pytest.mark.parametrize("seed", range(8))
def test_known_moves_are_those_that_a_look_at_all_moves_finds(seed):
    """Places on a coarse and on a fine grid, some a little off, so that moves meet, overlap and cross cells."""
    rng = np.random.default_rng(seed)
    step = (5.0, 0.1, 1e-3, 3e-4)[seed % 4]
    points = rng.integers(-3, 4, (60, 3)) * [step, step, 0.0] + rng.uniform(-6e-5, 6e-5, (60, 3)) * (seed > 3)
    known, moves = Walked(), []
    for _ in range(12):
        way = points[rng.integers(0, 60, rng.integers(2, 20))]
        known.add(way)
        moves += list(np.stack([way[:-1], way[1:]], axis=1))
        asked = points[rng.integers(0, 60, 12)]
        here = known.copied() if seed % 2 else known
        assert here.fresh(Line(asked, False)).tolist() == [
            not (passed_over(p, q, moves) or passed_over(q, p, moves)) for p, q in itertools.pairwise(asked)]
    own = list(np.stack([points[:-1], points[1:]], axis=1))
    again = [passed_over(*m, own[:k]) or passed_over(*m[::-1], own[:k]) for k, m in enumerate(own)]
    assert Walked.again(Line(points, False)).tolist() == again and (step < 5.0 or seed > 3 or any(again))


@pytest.mark.parametrize("known", range(1, 20))
def test_less_is_walked_again_than_the_proof_takes_for_a_stretch_run_twice(known):
    """What lies between two new stretches of a line: all of it where it is short, three moves at each end else."""
    class Stub(Finish):
        def __init__(self):
            self.walked, self.field = Walked(), SimpleNamespace(tool=None)
            self.residual = SimpleNamespace(cut=lambda points, tool: None)

    stub = Stub()
    whole = line(*range(31))
    stub.walked.add(whole.points[5:6 + known])
    pieces = stub._unwalked(whole)
    keys = [tuple(p) for p in whole.points.tolist()]
    walked = np.zeros(30, int)
    for p in pieces:
        first = keys.index(tuple(p.points[0].tolist()))
        walked[first:first + len(p.points) - 1] += 1
    assert walked[:5].all() and walked[5 + known:].all() and walked.max() == 1
    again = walked[5:5 + known]
    longest = max((b - a for a, b in true_runs(again.astype(bool))), default=0)
    assert longest < WINDOW
    assert again.all() == (known <= 7)


def test_what_a_program_says_with_the_same_words_is_the_same():
    """Two lines bent by the same facets met from other sides: their places differ by a few nm."""
    points = line(*range(12)).points + 3e-5
    known = Walked()
    known.add(points)
    again = Line(points + 1e-5 * np.sin(np.arange(36.0)).reshape(12, 3), False)
    assert not known.fresh(again).any()
    assert known.fresh(Line(points + [0.0, 0.0, 1e-3], False)).all()


def test_depths_know_the_lowest_cut_by_place_and_by_cell():
    lattice = Lattice(0.0, 0.0, 0.5, 21, 11)
    depths = Depths(lattice)
    depths.cut(np.array([[1.0, 2.0, 3.0], [6.0, 2.0, 3.0]]))
    depths.cut(np.array([[4.0, 2.0, 1.0], [4.0, 4.0, 1.0]]))
    assert depths.lowest(np.array([1.0, 2.0, 0.0])) == 3.0
    assert depths.lowest(np.array([3.0, 2.0, 0.0])) == np.inf  # between two points of it
    assert (depths.above(np.array([[2.0, 2.0, 2.5], [3.0, 2.0, 2.5]])) == 0.5).all()
    assert depths.above(np.array([[4.0, 2.5, 1.2], [4.0, 3.5, 1.2]])).max() == pytest.approx(-0.2)
    assert depths.above(np.array([[3.0, 2.0, 2.5], [3.0, 3.0, 2.5]])).max() == np.inf  # where it never was
    assert depths.above(np.array([[-3.0, 2.0, 2.5], [-2.0, 2.0, 2.5]])).min() == np.inf  # off the lattice
    other = depths.copied()
    other.cut(np.array([[1.0, 2.0, 0.0], [2.0, 2.0, 0.0]]))
    assert depths.lowest(np.array([1.0, 2.0, 0.0])) == 3.0
    depths.become(other)
    assert depths.lowest(np.array([1.0, 2.0, 0.0])) == 0.0


def test_a_closed_line_is_not_cut_at_its_beginning():
    """What is fresh on both sides of it is one piece, with known moves on each side."""
    turn = np.linspace(0.0, 2.0 * np.pi, 41)
    ring = Line(np.column_stack([np.cos(turn), np.sin(turn), np.zeros(41)]), True)
    fresh = np.zeros(40, np.bool_)
    fresh[[0, 1, 38, 39]] = True
    (piece,) = still_to_walk(ring, fresh)
    assert not piece.closed and len(piece.points) == 5 + 2 * OVERLAP
    np.testing.assert_allclose(piece.points[len(piece.points) // 2], ring.points[0], atol=1e-12)


def test_nothing_fresh_is_nothing_to_walk():
    line = Line(np.column_stack([np.arange(9.0), np.zeros(9), np.zeros(9)]), False)
    assert still_to_walk(line, np.zeros(8, np.bool_)) == []
    assert still_to_walk(line, np.ones(8, np.bool_)) == [line]


def test_near_a_place_the_lowest_of_each_cell_is_told_nearest_first():
    depths = Depths(Lattice(0.0, 0.0, 0.5, 21, 11))
    depths.cut(np.array([[1.0, 2.0, 3.0], [6.0, 2.0, 3.0]]))
    depths.cut(np.array([[4.1, 2.1, 1.0], [4.1, 4.0, 2.0]]))
    been = depths.near(np.array([4.0, 2.0]), 1.0)
    assert len(been) and been[0, 2] == 1.0  # of both ways through the nearest cell the deeper one
    np.testing.assert_allclose(been[0, :2], [4.1, 2.1])
    far = np.hypot(*(been[:, :2] - [4.0, 2.0]).T)
    assert (np.diff(far) >= 0.0).all() and far[-1] <= 1.0
    for x, y, z in been:  # on one of both ways
        assert z == 3.0 and y == 2.0 or np.isclose(z, 1.0 + (y - 2.1) / 1.9) and np.isclose(x, 4.1)
    assert not len(depths.near(np.array([8.0, 5.0]), 1.0)) and not len(depths.near(np.array([-9.0, 5.0]), 1.0))
    depths.cut(np.array([[8.0, 3.0, 2.0], [8.01, 3.0, 0.5], [8.02, 3.0, 1.5]]))
    np.testing.assert_allclose(depths.near(np.array([8.0, 3.0]), 0.2), [[8.01, 3.0, 0.5]])
    tried = depths.copied()
    tried.cut(np.array([[8.01, 3.05, 0.0], [8.01, 3.06, 0.0]]))
    np.testing.assert_allclose(depths.near(np.array([8.0, 3.0]), 0.2), [[8.01, 3.0, 0.5]])
    depths.become(tried)
    assert (depths.near(np.array([8.0, 3.0]), 0.2)[:, 1:] == [[3.06, 0.0]]).all()
