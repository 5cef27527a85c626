"""The stock as a field of distances against slow twins: nodes, cuts, bodies, tiles, and its surface."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import verify.material.stock_field
from geometry.mesh import TriangleMesh
from tests.hand_parts import box_mesh
from tests.machined_cases import BOX, LEFT, block, mill, path
from tests.oracle.turning_twin import least_distance, random_moves
from tests.pocket_case import block as pocket_block
from verify.kernels.field import brick_tops
from verify.kernels.grid import cross_columns
from verify.kernels.stock import CUTTER, HOLDER, NECK, PLUNGE, SHANK
from verify.material.stock_field import DistanceField, run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.material.stock_pass import parts
from verify.model import ProofSetup
from verify.moves import BOW, Moves
from verify.tool_axes import ToolAxes

MESH = box_mesh(*BOX)
TOOLS = {"ball": mill(4.0, 2.0, 7.0), "flat": mill(5.0, 0.0, 8.0), "bull": mill(6.0, 1.0, 8.0)}


def nodes(field: DistanceField):
    """(n, 3) places of all nodes, mm."""
    at = np.stack(np.meshgrid(*(np.arange(n) for n in field.values.shape), indexing="ij"), -1).reshape(-1, 3)
    return field.origin + field.step * at


def box_distance(p, box):
    """Signed distance into a box, positive inside, exact on both sides."""
    off = np.maximum(box[0] - p, p - box[1])
    return -np.where((off > 0).any(axis=1), np.linalg.norm(np.maximum(off, 0), axis=1), off.max(axis=1))


@pytest.mark.parametrize("kind", TOOLS)
def test_nodes_hold_the_distance_to_what_was_cut(kind):
    tool, rng = TOOLS[kind], np.random.default_rng(1)
    moves = random_moves(rng, 5, length=4.0)
    field = stock_field(MESH, block(), 0.5)
    p, h = nodes(field), field.step
    want = np.minimum(p - BOX[0], BOX[1] - p).min(axis=1)
    run = run_field(field, moves, [tool], block(), bare=True)
    for m in range(len(moves)):
        want = np.minimum(want, least_distance(p, moves, m, tool, 41))
    assert np.abs(field.values.ravel() - np.clip(want, -h, h)).max() <= BOW + 1e-4
    assert ((run.ways.volume > 0) == run.cut).all()
    assert run.ways.volume.sum() == pytest.approx(LEFT - field.volume, abs=1e-3)


@pytest.mark.parametrize("step", [0.5, 0.13461225148968145, 0.3])
def test_a_node_that_is_gone_is_known_for_one(step):
    # steps that no float32 holds: rounded towards zero, gone nodes were asked again by every move that passed
    field = stock_field(MESH, block(), step)
    run_field(field, path([[-14, 0, -4], [14, 0, -4]]), [mill(6.0, 0.0)], block(), bare=True)
    deep = field.values[(np.abs(nodes(field) - [0.0, 0.0, -1.0]) < 1.0).all(axis=1).reshape(field.values.shape)]
    assert len(deep) and (deep.astype(np.float64) == -field.band).all()
    assert field.values.astype(np.float64).max() == field.band


def test_volumes_taken_say_which_move_took_what():
    tool = mill(4.0, 0.0)
    moves = path([[-9, 0, -1], [9, 0, -1], [9, 0, 1], [-9, 0, 1], [-9, 0, -1], [9, 0, -1.5]])
    run = run_field(stock_field(MESH, block(), 0.2), moves, [tool], block(), bare=True)
    assert run.cut.tolist() == [True, False, False, False, True]
    # the last goes down to half a millimetre lower; over a place its disc is lowest where it leaves, pi R / 4 later
    taken = run.ways.of_moves(parts(moves, [tool])).volume
    np.testing.assert_allclose(taken[[0, 4]], [48.0, 48.0 * (0.25 + 0.5 / 18.0 * np.pi / 2.0)], rtol=0.01)


def slot(tool, depth=4.0, lean=0.0):
    """A slot right through the box with the whole tool, leaning forward."""
    axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
    field = stock_field(MESH, block(), 0.25)
    run = run_field(field, path([[-14, 0, -depth], [14, 0, -depth]], axis), [tool], block())
    return field, run.events


@pytest.mark.parametrize("lean", [0.0, 0.2])
def test_flutes_too_short_leave_stock_that_the_neck_meets(lean):
    long, short = mill(4.0, 0.0, 6.0), mill(4.0, 0.0, 2.0)
    field, events = slot(long, lean=lean)
    assert len(events) == 0
    i, j = (round(float(-field.origin[c] / field.step)) for c in (0, 1))
    column = field.values[i, j]
    z = field.origin[2] + field.step * np.arange(len(column))
    assert (column[z > -3.9] < 0).all()
    field, events = slot(short, lean=lean)
    column = field.values[i, j]
    assert (column[(z > -1.5) & (z < -0.3)] > 0).all() and (column[(z > -3.5) & (z < -2.3)] < 0).all()
    met = events[events[:, 1] == NECK]
    # a neck of 3.6 with 0.05 clearance: as deep in as its radius, or down from the end of the flutes to the top
    assert len(met) and met[:, 2].max() == pytest.approx(1.8 + 0.05, abs=0.3)


@pytest.mark.parametrize("tile, threads", [(64, 1), (20, 2), (13, 2), (13, 1)])
def test_tiles_and_threads_change_no_byte(monkeypatch, tile, threads):
    tool = replace(mill(4.0, 1.0, 3.0), neck_length=6.0, shank_diameter=8.0, stickout=9.0)
    moves = random_moves(np.random.default_rng(2), 30, length=5.0)
    moves = Moves(moves.start, moves.end, np.arange(30) % 3 > 0, moves.tool, moves.axes)

    def cut(size, count):
        monkeypatch.setattr(verify.material.stock_field, "TILE", size)
        field = stock_field(MESH, block(), 0.3, threads=count)
        run = run_field(field, moves, [tool], block(), threads=count)
        deepest = {}
        for row in run.events[run.events[:, 1] != PLUNGE]:
            deepest[row[0], row[1]] = max(deepest.get((row[0], row[1]), 0.0), row[2])
        return field, run, deepest
    (one, first, met), (other, second, also) = cut(64, 2), cut(tile, threads)
    assert one.values.tobytes() == other.values.tobytes() and met == also and len(met) > 10
    np.testing.assert_allclose(first.ways.volume, second.ways.volume, atol=1e-7)
    if tile == 64:
        assert first.events.tobytes() == second.events.tobytes()
        assert first.ways.volume.tobytes() == second.ways.volume.tobytes()
        assert first.ways.depth.tobytes() == second.ways.depth.tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_a_rapid_meets_the_stock_it_goes_through(seed):
    """Never where nothing stands, and always where more than the spacing of the nodes is met, as deep within it."""
    tool, step, grow = mill(4.0, 2.0, 7.0), 0.4, 1.0
    rng = np.random.default_rng(seed)
    moves = random_moves(rng, 24, length=9.0, turn=1.0)
    moves = Moves(moves.start, moves.end, np.zeros(24, bool), moves.tool, moves.axes)
    run = run_field(stock_field(MESH, block(), step), moves, [tool], block())
    got = {int(e[0]): e[2] for e in run.events if e[1] == CUTTER}
    fine = np.stack(np.meshgrid(*(np.arange(a, b + 1e-9, 0.5) for a, b in BOX.T), indexing="ij"), -1).reshape(-1, 3)
    met = 0
    for m in range(24):
        bare = -least_distance(fine, moves, m, tool, 21).min()
        near = grow + bare
        if bare > 0.0:
            met += 1
            # a node stands for the ball of stock round it, at most a step wide; the twin's points are 0.5 mm apart
            assert grow + bare - step - 0.1 <= got.get(m, grow) <= grow + bare + step + 0.3
        if near < -0.4:
            assert m not in got
        if near > step:
            assert m in got
    assert 5 < met < 24


def test_bodies_meet_stock_that_stands():
    """A leaning tool that goes down a slot of its own cut: shank and holder meet the top, as deep as geometry says."""
    tool = replace(mill(4.0, 0.0, 8.0), neck_length=8.0, shank_diameter=7.0, stickout=40.0)
    field, events = slot(tool, 2.0)
    assert not (events[:, 1] == SHANK).any()
    _, events = slot(replace(tool, flute_length=3.0, neck_length=3.0, neck_diameter=4.0), 4.0)
    met = events[events[:, 1] == SHANK]
    # from 3 over the tip up, 1 mm below the top: 1 mm from its end up to the top, and the clearance of 0.2
    assert met[:, 2].max() == pytest.approx(1.0 + 0.2, abs=field.step)
    assert not (events[:, 1] == HOLDER).any()


def test_a_plunge_along_a_leaning_axis_is_as_deep_as_it_goes():
    """What a disc digs along its axis is its area times the way of its middle below the top."""
    tool, lean = mill(4.0, 0.0), 0.3
    axis, deep = np.array([0.0, np.sin(lean), np.cos(lean)]), 2.5
    moves = path([4.0 * axis, -deep * axis], axis)
    run = run_field(stock_field(MESH, block(), 0.1), moves, [tool], block(), bare=True)
    (row,) = run.events
    assert row[1] == PLUNGE and row[2] == pytest.approx(deep, rel=0.03)
    down = run_field(stock_field(MESH, block(), 0.1), path([[-9, 0, -0.5], [9, 0, -0.5]]), [tool], block(), bare=True)
    assert len(down.events) == 0


@pytest.mark.parametrize("off", [0.0, 1e-16, -1e-16, 1e-8, -1e-8, 0.05])
def test_a_plunge_that_ends_in_a_layer_of_nodes_is_as_deep_as_any_other(off):
    """Rounding decided there which nodes the end stood on: a plunge of 2 mm came out as 233 mm."""
    tool, field = mill(6.0, 0.0), stock_field(MESH, block(), 0.15)
    layers = field.origin[2] + field.step * np.arange(field.values.shape[2])
    z = float(layers[np.argmin(np.abs(layers + 2.0))]) + off
    run = run_field(field, path([[0.0, 0.0, 1.0], [0.0, 0.0, z]]), [tool], block(), bare=True)
    (row,) = run.events
    assert row[1] == PLUNGE and row[2] == pytest.approx(-z, rel=0.03)


@pytest.mark.parametrize("steps", [20, 80])
def test_a_way_downhill_is_a_plunge_as_deep_as_the_stock_it_leaves(steps):
    """However many steps it is written in: what was dug where the tool no longer stands is not dug again."""
    tool, s = mill(4.0, 0.0), np.linspace(0.0, 1.0, steps + 1)[:, None]
    moves = path(np.array([-6.0, 0.0, 0.2]) + s * [11.0, 0.0, -1.2])
    run = run_field(stock_field(MESH, block(), 0.2), moves, [tool], block(), bare=True)
    dug = run.events[run.events[:, 1] == PLUNGE][:, 2]
    assert 0.5 <= dug.max() <= 1.02  # 1 mm at the end of the way, less where the back of the tool still stands


@pytest.mark.parametrize("kind", ["box", "part_offset"])
def test_blanks_are_as_far_as_their_closed_forms(kind):
    part = np.array([[-4.0, -3.0, -5.0], [4.0, 3.0, 0.0]])
    if kind == "box":
        setup, box, grow = ProofSetup(stock_kind="box", stock_box=part), part, 0.0
    else:
        setup, box, grow = ProofSetup(margin=0.7, uncertainty=0.2), part, 0.9
    field = stock_field(box_mesh(*part), setup, 0.3)
    p = nodes(field)
    want = box_distance(p, box) + grow
    if kind == "box":  # beyond an edge the larger of two ways is taken
        want = np.minimum(p - part[0], part[1] - p).min(axis=1)
    np.testing.assert_allclose(field.values.ravel(), np.clip(want, -field.step, field.step), atol=1e-6)


def test_a_cylinder_blank_is_as_wide_as_asked():
    setup = ProofSetup(stock_kind="cylinder", stock_cylinder=(1.0, -2.0, -5.0, 4.0, 6.0))
    field = stock_field(MESH, setup, 0.2)
    p = nodes(field)
    want = np.minimum(4.0 - np.hypot(p[:, 0] - 1, p[:, 1] + 2), np.minimum(p[:, 2] + 5, 1 - p[:, 2]))
    np.testing.assert_allclose(field.values.ravel(), np.clip(want, -0.2, 0.2), atol=1e-6)
    assert field.volume == pytest.approx(np.pi * 16 * 6, rel=0.005)


def test_steps_are_widened_where_nodes_would_be_too_many(monkeypatch):
    monkeypatch.setattr(verify.material.stock_field, "MAX_NODES", 20_000)
    field = stock_field(MESH, block(), 0.05)
    assert field.values.size < 30_000 and field.step > 0.3
    assert field.volume == pytest.approx(LEFT, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_nodes_inside_a_hull_are_those_behind_all_its_planes(seed):
    rng = np.random.default_rng(seed)
    hull = ConvexHull(rng.normal(size=(30, 3)))
    faces = hull.simplices.copy()
    outward = np.einsum("ij,ij->i", np.cross(*(hull.points[faces[:, k]] - hull.points[faces[:, 0]] for k in (1, 2))),
                        hull.equations[:, :3])
    faces[outward < 0] = faces[outward < 0][:, ::-1]
    inside = np.zeros((40, 41, 42), bool)
    origin, h = np.array([-2.5, -2.4, -2.6]), 0.125
    for a, b in ((0, 17), (17, 40)):
        cross_columns(inside, a, b, origin, h, hull.points, faces.astype(np.int32))
    p = nodes(DistanceField(origin, h, inside)).reshape(*inside.shape, 3)
    off = (p @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=-1)
    clear = np.abs(off) > 1e-5
    assert (inside == (off < 0))[clear].all() and 0.03 < inside.mean() < 0.5


def test_nodes_on_round_numbers_of_a_pocket():
    """Nodes in line with walls, edges and corners of a part: only those on its surface may go either way."""
    mesh = pocket_block().mesh
    inside = np.zeros((43, 33, 24), bool)
    cross_columns(inside, 0, 43, np.array([-21.0, -16.0, -10.75]), 1.0, mesh.vertices, mesh.faces)
    p = nodes(DistanceField(np.array([-21.0, -16.0, -10.75]), 1.0, inside)).reshape(*inside.shape, 3)

    def held(room):
        block_ = (np.abs(p) < [20 + room, 15 + room, 99]).all(-1) & (p[..., 2] > -10) & (p[..., 2] < 0)
        return block_ & ~((np.abs(p[..., :2]) < [10 - room, 6 - room]).all(-1) & (p[..., 2] > -5))
    assert not (held(-1e-6) & ~inside).any() and not (inside & ~held(1e-6)).any()


def closed(mesh: TriangleMesh) -> bool:
    """Whether every edge is used once each way as often as the other."""
    way = np.concatenate([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]).astype(np.int64)
    n = len(mesh.vertices)
    there, back = np.sort(way[:, 0] * n + way[:, 1]), np.sort(way[:, 1] * n + way[:, 0])
    return bool((there == back).all())


def test_the_surface_is_closed_seen_from_outside_and_as_large_as_the_stock():
    field = stock_field(MESH, block(), 0.3)
    run_field(field, random_moves(np.random.default_rng(4), 12, length=5.0), [TOOLS["bull"]], block(), bare=True)
    mesh = field.surface()
    assert closed(mesh) and mesh.volume == pytest.approx(field.volume, rel=0.01)
    empty = DistanceField(field.origin, field.step, np.full_like(field.values, -0.3))
    assert empty.volume == 0.0 and len(empty.surface().faces) == 0


@pytest.mark.parametrize("shift", [0.0, 0.01, 0.13])
def test_the_surface_of_a_ball_is_within_its_bound(shift):
    """Linear interpolation is off by h²/8 of the curvature 2/R of a ball at most, and a vertex lies among crossings."""
    h, radius = 0.25, 3.0
    at = np.stack(np.meshgrid(*(np.arange(-16, 17) * h + shift,) * 3, indexing="ij"), -1)
    values = np.clip(radius - np.linalg.norm(at, axis=-1), -h, h).astype(np.float32)
    field = DistanceField(np.full(3, -16 * h + shift), h, values)
    mesh = field.surface()
    off = radius - np.linalg.norm(mesh.vertices, axis=1)
    assert off.min() > -1e-5 and off.max() < 2.0 * h * h / radius
    assert closed(mesh) and mesh.volume == pytest.approx(4 / 3 * np.pi * 27, rel=0.01)
    assert field.volume == pytest.approx(4 / 3 * np.pi * 27, abs=h * h / 8 * 8 * np.pi * radius)


def test_tops_of_bricks():
    values = np.random.default_rng(5).normal(size=(11, 9, 14)).astype(np.float32)
    tops = brick_tops(values, 1, 11, 0, 9, 3, 14)
    assert tops.shape == (3, 3, 3)
    for i, j, k in itertools.product(range(3), repeat=3):
        own = values[1 + 4 * i:min(5 + 4 * i, 11), 4 * j:min(4 + 4 * j, 9), 3 + 4 * k:min(7 + 4 * k, 14)]
        assert tops[i, j, k] == own.max()


@pytest.mark.parametrize("away", [12.0, 40.0, 150.0])
def test_stock_is_within_the_stray_of_a_rapid_however_far_it_is(away):
    tool = mill(4.0, 0.0, 8.0)
    start, end = np.array([[BOX[1, 0] + 2.0 + away, -3.0, -2.0]]), np.array([[BOX[1, 0] + 2.0 + away, 3.0, -2.0]])
    for lean in (0.0, 0.1):
        z = np.array([[0.0, np.sin(lean), np.cos(lean)]])
        for stray in (away - 1.5, away + 5.0):
            moves = Moves(start, end, np.zeros(1, bool), np.zeros(1, np.int32), ToolAxes.between(z, z),
                          np.array([stray]))
            events = run_field(stock_field(MESH, block(), 0.3), moves, [tool], block()).events
            upright = replace(moves, axes=None)
            lines = run_stock(blank(MESH, 0.3, block()), upright, [tool], block()).events if lean == 0.0 else events
            near = block().clearance_rapid + stray - away
            for found in (events, lines):
                met = found[found[:, 1] == CUTTER, 2]
                assert met.max(initial=0.0) == pytest.approx(max(near, 0.0), abs=0.4)
