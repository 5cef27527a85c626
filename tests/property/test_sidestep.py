"""Distances between passes: closed forms, the promise on surfaces, and what must not matter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import slope_field
from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope
from toolpath.drop_cutter import drop_cutter
from toolpath.passes.feed_direction import CANDIDATES, best_direction
from toolpath.passes.pass_family import Dragged, FinishTarget, Promise, Swath
from toolpath.passes.side_step import lay_out
from toolpath.strategies.spiral import Rings, spiralled

R = 1.5
BALL = Cutter.ball(diameter=2 * R, length=20.0)


class Field:
    """A surface z = f(x, y) over a square with the target in its middle."""

    def __init__(self, f, half, spacing=0.12, cutter=BALL, corner=R, disc=False):
        self.f, self.cutter = f, cutter
        tree = TriangleTree(slope_field(f, size=16.0, n=160, base=-40.0))
        # to the very border, as the samples of a zone are
        self.points, self.normals = self.over(half, round(2 * half / spacing), disc)
        flat = cutter.radius - corner
        side = self.normals[:, :2] / np.maximum(np.linalg.norm(self.normals[:, :2], axis=1, keepdims=True), 1e-12)
        tips = self.points + corner * self.normals - [0.0, 0.0, corner]
        tips[:, :2] += flat * side
        self.target = FinishTarget(self.points, self.normals, tips, spacing)
        self.dragged = Dragged(cutter, lambda xy: drop_cutter(tree, cutter, xy), tree)
        self.dense = self.over(half, int(half / 0.025), disc)

    def over(self, half, n, disc):
        x, y = (v.ravel() for v in np.meshgrid(*2 * [np.linspace(-half, half, n + 1)]))
        if disc:
            inside, turn = np.hypot(x, y) < half, np.arange(3 * n) * 2 * math.pi / (3 * n)
            x, y = np.append(x[inside], half * np.cos(turn)), np.append(y[inside], half * np.sin(turn))
        e = 1e-5
        gx, gy = ((self.f(x + e * a, y + e * b) - self.f(x - e * a, y - e * b)) / (2 * e) for a, b in ((1, 0), (0, 1)))
        n = np.column_stack([-gx, -gy, np.ones_like(x)])
        return np.column_stack([x, y, self.f(x, y)]), n / np.linalg.norm(n, axis=1, keepdims=True)

    def swath(self, promise, angle=0.0):
        return Swath(self.dragged, self.target, promise, angle)

    def left(self, paths):
        return Envelope(paths, self.cutter).along(*self.dense)


def promise(h, chord=None):
    return Promise(h, chord or 0.05 * h, 0.3 * R, 4 * R)


def paths_of(passes):
    return [line for p in passes for line in p.lines]


SURFACES = {
    "plane": lambda x, y: 0.0 * x,
    "slope": lambda x, y: 0.8 * y + 0.3 * x,
    "dome": lambda x, y: np.sqrt(12.0**2 - x**2 - y**2) - 12.0,
    "valley": lambda x, y: 0.08 * y * y - 0.02 * x * x,
    "waves": lambda x, y: 0.5 * np.sin(0.9 * x + 0.4) * np.cos(0.7 * y),
    "steep": lambda x, y: 1.7 * y + 0.2 * np.sin(x),
}


@pytest.mark.parametrize("h", [0.03, 0.005])
@pytest.mark.parametrize("lean", [0.0, 0.5, 1.5])
def test_on_a_plane_the_step_is_the_closed_form(lean, h):
    field = Field(lambda x, y: lean * y, 2.0)
    at = np.array([p.at for p in lay_out(field.swath(promise(h)), subdivide=False)])
    along = np.diff(at)[:-1] * math.hypot(1.0, lean)
    want = 2.0 * math.sqrt(2.0 * R * h - h * h)
    assert (along <= want * 1.001).all() and (along >= 0.97 * want).all()


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("name", SURFACES)
def test_the_promise_is_kept_everywhere_and_not_by_far(name, angle):
    h, field = 0.02, Field(SURFACES[name], 3.0)
    passes = lay_out(field.swath(promise(h), math.radians(angle)))
    left = field.left(paths_of(passes))
    assert left.max() <= 1.03 * h  # samples are 0.12 mm apart, and this looks between them
    assert left.max() >= 0.9 * h
    assert left.min() >= -0.2 * h  # chords and facets


@pytest.mark.parametrize("cutter, corner", [
    (Cutter.bull(diameter=4.0, corner_radius=0.8, length=20.0), 0.8),
    (Cutter.tapered(tip_diameter=2.0, diameter=5.0, angle_deg=12.0, length=20.0), 1.0)],
    ids=["bull", "tapered"])
@pytest.mark.parametrize("name", ["slope", "dome"])
def test_the_promise_holds_for_other_cutters(name, cutter, corner):
    field = Field(SURFACES[name], 2.5, cutter=cutter, corner=corner)
    if corner == 1.0:  # the ball of a tapered one touches, not its widest circle
        field.target = replace(field.target, tips=field.points + field.normals - [0.0, 0.0, 1.0])
    h = 0.02
    left = field.left(paths_of(lay_out(field.swath(promise(h)))))
    assert left.max() <= 1.08 * h and (left <= 1.02 * h).mean() > 0.999  # between samples, at the border


@pytest.mark.parametrize("spacing", [0.2, 0.11])
def test_a_flat_end_keeps_the_promise_on_a_slope_between_its_steps_too(spacing):
    # it leaves steps with a jump at each rim: on a slope s a step apart, s sin of the slope high
    flat = Cutter.flat(diameter=4.0, length=20.0)
    field, h = Field(SURFACES["slope"], 1.0, spacing=spacing, cutter=flat, corner=0.0), 0.02
    passes = lay_out(field.swath(promise(h)), subdivide=False)
    inner = (np.abs(field.dense[0][:, :2]) < 0.9).all(axis=1)
    assert (field.left(paths_of(passes))[inner] <= 1.05 * h).mean() > 0.99


@pytest.mark.parametrize("edge", [1.2, -0.7])
def test_what_no_pass_mends_does_not_set_the_step(edge):
    field, begun = Field(SURFACES["plane"], 2.0), []
    free, open_to = len(lay_out(field.swath(promise(0.02)))), field.dragged.limit
    field.dragged = replace(field.dragged, limit=lambda xy: np.where(xy[:, 0] > edge, np.inf, open_to(xy)))
    swath = field.swath(promise(0.02))
    made = swath.pass_at
    swath.pass_at = lambda *args: begun.append(args) or made(*args)
    assert len(lay_out(swath)) <= free + 1 and len(begun) < 12 * free


def test_the_scallop_falls_with_the_square_of_the_distance():
    field = Field(SURFACES["dome"], 2.5)
    hs = 0.08 / 2.0 ** np.arange(4)
    steps = [np.mean(np.diff([p.at for p in lay_out(field.swath(promise(float(h))), subdivide=False)])[:-1])
             for h in hs]
    assert np.polyfit(np.log(steps), np.log(hs), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_a_narrow_spot_gets_pieces_and_not_a_closer_pass_everywhere():
    def waves(x, y):  # on a tenth of the length of the passes
        return 0.125 * np.exp(-((x - 1.0) / 0.8) ** 2) * np.cos(2.0 * y)

    h, field = 0.01, Field(waves, 7.5, spacing=0.15)
    promised = replace(promise(h), link=0.2)
    closer, pieces = (lay_out(field.swath(promised), subdivide=s) for s in (False, True))
    assert all(p.whole for p in closer) and any(not p.whole for p in pieces)
    way = [sum(p.length + promised.link * len(p.lines) for p in found) for found in (closer, pieces)]
    assert way[1] < 0.98 * way[0]
    for found in (closer, pieces):
        assert field.left(paths_of(found)).max() <= 1.08 * h  # between samples 0.15 mm apart


def test_greedy_steps_are_as_few_as_any():
    # the least number of passes out of a fine comb of places, by search over all of them
    field = Field(SURFACES["waves"], 2.0)
    h, swath = 0.03, field.swath(promise(0.03))
    places = np.arange(swath.t[0] - 0.01, swath.t[-1] + 0.06, 0.05)
    covers = [swath.envelope(swath.pass_at(float(t), 1.0)).along(*field.dense) for t in places]
    t = field.dense[0][:, 1] + R * field.dense[1][:, 1]
    fewest = _fewest(places, covers, t, h)
    got = len(lay_out(swath, subdivide=False))
    assert got <= fewest  # the comb costs a pass rather than we


def _fewest(places, covers, t, h):
    """Least number of places so that all points are within h of one: shortest path over pairs of neighbours."""
    n = len(places)
    best = np.full(n, np.inf)
    for b in range(n):
        if covers[b][t <= places[b]].max(initial=0.0) <= h:
            best[b] = 1
        for a in range(b):
            mine = (t > places[a]) & (t <= places[b])
            if best[a] + 1 < best[b] and np.minimum(covers[a], covers[b])[mine].max(initial=0.0) <= h:
                best[b] = best[a] + 1
    ends = [best[k] for k in range(n) if covers[k][t > places[k]].max(initial=0.0) <= h]
    return min(ends)


@pytest.mark.parametrize("name", ["valley", "steep", "waves"])
def test_the_coarse_search_finds_a_direction_nearly_as_short_as_the_shortest(name):
    field, promised = Field(SURFACES[name], 4.0), promise(0.01)

    def way(angle):
        passes = lay_out(field.swath(promised, angle), subdivide=False)
        return sum(p.length + promised.link * len(p.lines) for p in passes)

    ways = [way(a) for a in CANDIDATES]
    chosen = way(best_direction(field.dragged, field.target, promised))
    assert chosen <= 1.12 * min(ways) and chosen < max(ways)


@pytest.mark.parametrize("name", ["dome", "waves", "plane"])
def test_a_spiral_keeps_the_promise_in_one_path(name):
    h, field = 0.02, Field(SURFACES[name], 3.5, disc=True)
    rings = Rings(field.dragged, field.target, promise(h))
    passes = lay_out(rings, subdivide=False)
    assert field.left(paths_of(passes)).max() <= 1.07 * h
    spiral = spiralled(rings, [p.at for p in passes])
    assert len(spiral) == 1
    assert field.left(spiral).max() <= 1.08 * h
    moves = np.linalg.norm(np.diff(spiral[0][:, :2], axis=0), axis=1)
    assert moves.max() <= 1.0  # no leap from turn to turn


def test_nothing_to_do_is_no_pass():
    field = Field(SURFACES["plane"], 1.0)
    none = field.target.subset(np.zeros(0, np.int64))
    assert lay_out(Swath(field.dragged, none, promise(0.01), 0.0)) == []
