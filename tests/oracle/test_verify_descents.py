"""What pays for a descent, what each move takes off the stock, and the stub under an end without a cutting centre."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.hand_parts import box_mesh
from tests.machined_cases import mill, path
from tests.pocket_case import SETUP, TOOL, block, scored, text
from toolpath.linking.ramp_entry import way_down
from verify.kernels.stock import PLUNGE
from verify.material import stock_pass
from verify.material.material import stock_spacing, unseen_cores
from verify.material.stock_field import run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.material.stock_pass import Ways, descents, hollow_ends, parts
from verify.model import NcProgram, ProofSetup, ScoredSamples
from verify.moves import Moves
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))
HOLLOW = replace(SETUP, cores={1: 1.2})  # of a tool of 4 mm


def plunges(lines, setup=SETUP, turn=None):
    head = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X-12 Y0", "Z1.5"]
    body = [*head, *lines, "G0 Z20", "M5", "M30", "%"]
    found = prove([NcProgram("p", text(body), turn)], PART, (TOOL,), setup, NOBODY, (), threads=2).findings
    return [f for f in found if f.kind == "plunge"]


def pecks(aside, up=None):
    """Three pecks of 0.35 mm from the top at 0.5 mm; after each a way of 16 mm to and fro."""
    out = []
    for k in range(1, 4):
        out += [f"G1 Z{0.5 - 0.35 * k:.3f} F200", *([f"Z{up}"] if up else []), f"X{-12 + aside}", "X-12"]
    return out


@pytest.mark.slow
@pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
def test_a_way_in_air_pays_for_no_descent(turn):
    drilled = plunges(pecks(16, up=0.8), turn=turn)
    assert max(f.depth for f in drilled) == pytest.approx(3 * 0.35, rel=0.1)
    assert plunges(pecks(16), turn=turn) == []  # the same ways at depth are slots


def test_a_nick_at_the_end_of_a_way_pays_by_its_size():
    """Each way back and forth in air cuts 0.3 mm deep and 0.5 mm far into a step at its end: far too little."""
    step = ["G0 Z1.5", "X-12 Y0"]
    lines = list(step)
    for k in range(1, 6):
        lines += [f"G1 Z{0.5 - 0.35 * k:.3f} F200", "Z0.8", "X4", "Z0.2" if k == 1 else "Z0.8", f"X{4 + 0.5 * k}",
                  "Z0.8", "X-12"]
    assert max(f.depth for f in plunges(lines)) > 1.4


def test_a_shallow_layer_pays_as_deep_as_it_is():
    """Layers of 0.1 mm, each entered straight down, are cleared one by one: no descent adds up."""
    lines = []
    for k in range(1, 13):
        lines += [f"G1 Z{0.5 - 0.1 * k:.3f} F200", "X12 F600", "X-12"]
    assert plunges(lines) == []


def test_what_ways_earn():
    p = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [40, 0, 0]])
    moves = Moves(p[:-1], p[1:], np.ones(4, bool), np.zeros(4, np.int32))
    first, slope = parts(moves, [TOOL]), math.tan(SETUP.ramp_angle)
    assert np.diff(first).tolist() == [10, 10, 10, 10]
    # a slot 1 deep, air, a nick 1 deep at the end, a layer of 0.1 mm
    volume = np.concatenate([np.full(10, 4.0), np.zeros(19), [1.0], np.full(10, 0.4)])
    depth = np.concatenate([np.ones(10), np.zeros(19), [1.0], np.full(10, 0.1)])
    earned = descents(moves, [TOOL], SETUP, Ways(volume, depth).in_cut(first))[1]
    np.testing.assert_allclose(np.diff(np.r_[0.0, earned]), [10 * slope, 0.0, slope, 0.1], rtol=1e-12)


@pytest.mark.parametrize("deep", [0.2, 2.0])
@pytest.mark.parametrize("model", ["lines", "field"])
def test_volume_and_depth_of_a_cut(model, deep):
    """A slot of 20 mm, then half as wide beside it: volume L D a, and L a ae; the depth is that of the layer."""
    p = np.array([[-30.0, 0, 0.5 - deep], [30, 0, 0.5 - deep], [30, 2, 0.5 - deep], [-30, 2, 0.5 - deep]])
    moves = Moves(p[:-1], p[1:], np.ones(3, bool), np.zeros(3, np.int32))
    if model == "lines":
        run = run_stock(blank(PART.mesh, 0.1, SETUP), moves, [TOOL], SETUP)
    else:
        run = run_field(stock_field(PART.mesh, SETUP, 0.2), moves, [TOOL], SETUP)
    ways, long = run.ways.of_moves(parts(moves, [TOOL])), 41.0
    np.testing.assert_allclose(ways.volume[[0, 2]], [long * 4 * deep, long * 2 * deep], rtol=0.05)
    np.testing.assert_allclose(ways.depth[[0, 2]], deep, atol=0.2 if model == "field" else 1e-6)
    assert ways.volume[1] == 0.0
    # parts of 1 mm: those over the stock take a mm of the slot each
    inside = run.ways.volume[np.arange(60) % 60][14:46]
    np.testing.assert_allclose(inside, 4 * deep, rtol=0.12)


def helix(radius, pitch, turns, per=48):
    t = 2.0 * np.pi * np.arange(per * turns + 1) / per
    return np.column_stack([radius * np.cos(t), radius * np.sin(t), 0.5 - pitch * t / (2.0 * np.pi)])


def pressed(path, core, setup=HOLLOW):
    moves = Moves(path[:-1], path[1:], np.ones(len(path) - 1, bool), np.zeros(len(path) - 1, np.int32))
    ramp = replace(setup, cores={1: 2.0 * core}, ramp_angles={1: math.radians(60.0)}, plunge_skin=1e9)
    run = run_stock(blank(PART.mesh, 0.1, setup), moves, [TOOL], ramp)
    events = run.events[run.events[:, 1] == PLUNGE]
    return float(events[:, 2].max(initial=0.0)), float(hollow_ends([TOOL], ramp)[0, 1])


def twin(path, core, step=0.1, per=0.01):
    """Highest stock under the core, tool by tool along the path over points; the ring round the core cuts."""
    x, y = np.meshgrid(np.arange(-4.0, 4.0, step), np.arange(-4.0, 4.0, step))
    top, worst = np.full(x.shape, 0.5), 0.0
    for a, b in zip(path[:-1], path[1:], strict=True):
        count = max(int(np.linalg.norm(b - a) / per), 1)
        for s in np.arange(1, count + 1) / count:
            tip = a + s * (b - a)
            rho = np.hypot(x - tip[0], y - tip[1])
            ring = (rho >= core) & (rho <= TOOL.radius)
            top[ring] = np.minimum(top[ring], tip[2])
            worst = max(worst, float((top[rho < core] - tip[2]).max()))
    return worst


@pytest.mark.parametrize("radius, pitch, core", [(0.3, 0.4, 0.6), (0.9, 0.6, 0.6), (0.55, 0.6, 0.6), (1.5, 0.9, 1.2)])
def test_the_stub_is_that_of_a_twin(radius, pitch, core):
    path = helix(radius, pitch, 3)
    got, left = pressed(path, core)
    want = twin(path, core)
    assert got == (pytest.approx(want, abs=0.06) if want > left else 0.0)


@pytest.mark.slow
def test_a_hollow_end_goes_neither_straight_down_nor_round_its_core():
    down = plunges(["G1 Z-0.5 F200"], HOLLOW)
    assert down and down[0].depth == pytest.approx(1.0, abs=0.01)
    paid = plunges(pecks(16), HOLLOW)  # steps that a centre-cutting mill may make, with slots between them
    assert paid and paid[0].depth == pytest.approx(0.35, abs=0.01)
    ramp = ["G1 Z0.5 F300", *(f"X{(-4, -12)[k % 2]} Z{0.5 - 0.4 * (k + 1):.3f}" for k in range(6)), "X-4"]
    assert plunges(ramp, HOLLOW) == []


@pytest.mark.parametrize("radius, harm", [(0.4, True), (1.6, False)])
def test_a_helix_round_the_core_of_a_hollow_end(radius, harm):
    pitch = 2 * math.pi * radius * math.tan(math.radians(2.9))
    turns = math.ceil(1.5 / pitch)
    path = helix(radius, pitch, turns)
    moves = Moves(path[:-1], path[1:], np.ones(len(path) - 1, bool), np.zeros(len(path) - 1, np.int32))
    found = {}
    for setup in (SETUP, HOLLOW):
        events = run_stock(blank(PART.mesh, 0.15, setup), moves, [TOOL], setup).events
        found[setup.cores.get(1)] = events[events[:, 1] == PLUNGE, 2]
    assert len(found[None]) == 0 and (len(found[1.2]) > 0) == harm
    if harm:
        assert found[1.2].max() == pytest.approx(turns * pitch, rel=0.02)


def stubs(path, setup=HOLLOW, spacing=0.15):
    """Depth by move of what the end presses or digs along a path over (n, 3) points."""
    path = np.array(path, dtype=float)
    moves = Moves(path[:-1].copy(), path[1:].copy(), np.ones(len(path) - 1, bool), np.zeros(len(path) - 1, np.int32))
    events = run_stock(blank(PART.mesh, spacing, setup), moves, [TOOL], setup).events
    events = events[events[:, 1] == PLUNGE]
    return dict(zip(events[:, 0].astype(int).tolist(), events[:, 2].tolist(), strict=True))


@pytest.mark.parametrize("deep", [0.045, 0.1, 0.16, 0.3])
def test_straight_down_a_hollow_end_presses_a_hundredth_of_its_diameter(deep):
    """The stub of a sound ramp, 0.166 mm here, is no limit where no way aside is made."""
    at = [1.03, 2.07]
    assert stubs([[*at, 2.0], [*at, 0.5 - deep]]) == {0: pytest.approx(deep)}
    assert stubs([[*at, 2.0], [*at, 0.5 - deep]], SETUP) == {}
    assert stubs([[*at, 2.0], [*at, 0.465], [*at, 1.0], [*at, 0.465]]) == {}  # pressed once only
    steps = [[at[0] + 0.001 * (k % 2), at[1], 0.5 - deep * k / 9] for k in range(10)]
    assert stubs(steps)[8] == pytest.approx(deep, abs=1e-6)
    pecks = [p for k in range(1, 10) for p in ([*at, 0.6], [*at, 0.5 - deep * k / 9])]
    assert stubs(pecks)[16] == pytest.approx(deep, abs=1e-6)
    # a way on the top pays nothing
    aside = [[*at, 0.501], [at[0] + 1.1, at[1], 0.499], [*at, 0.499], [*at, 0.5 - deep]]
    assert 2 in stubs(aside)


def test_straight_down_at_the_end_of_a_ramp():
    ramp = [[-6.0, 0.0, 0.5], [2.0, 0.0, 0.5 - 8.0 * math.tan(SETUP.ramp_angle)]]
    assert stubs(ramp) == {}
    assert list(stubs([*ramp, [2.0, 0.0, ramp[1][2] - 0.06]])) == [1]
    # the ring has been over what stood under the core
    assert stubs([*ramp, [-6.0, 0.0, ramp[1][2]], [2.0, 0.0, ramp[1][2]], [2.0, 0.0, ramp[1][2] - 0.03]]) == {}


@pytest.mark.parametrize("radius, deep", [(0.1, 0.13), (0.2, 0.2), (0.0, 0.06)])
def test_a_shallow_helix_inside_the_core(radius, deep):
    pitch = 2.0 * math.pi * max(radius, 0.01) * math.tan(SETUP.ramp_angle)
    turns = math.ceil(deep / pitch)
    assert turns * pitch > 2.0 * math.sqrt(8.0) * radius * math.tan(SETUP.ramp_angle) + 0.04
    found = stubs(helix(radius, pitch, turns, per=24))
    assert found and max(found.values()) == pytest.approx(turns * pitch, rel=0.02)


@pytest.mark.parametrize("seed", range(6))
def test_sound_ramps_of_a_hollow_end_are_none(seed):
    """To and fro along ways longer than its core, with corners, at the angle of a ramp; and helices round the core."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        radius = float(rng.uniform(0.65, 2.5))
        pitch = 0.99 * 2.0 * math.pi * radius * math.tan(SETUP.ramp_angle)  # chords are steeper than arcs
        assert stubs(helix(radius, pitch, math.ceil(2.0 / radius))) == {}
        return
    corners = [np.zeros(2)]
    for turn in rng.uniform(-1.2, 1.2, 2).cumsum():
        corners.append(corners[-1] + rng.uniform(1.5, 4.0) * np.array([math.cos(turn), math.sin(turn)]))
    way = [*corners, *corners[-2:0:-1]] * 3
    path = [[*way[0], 0.5]]
    for a, b in zip(way[:-1], way[1:], strict=True):
        path.append([*b, path[-1][2] - float(np.linalg.norm(b - a)) * math.tan(SETUP.ramp_angle)])
    assert stubs(path) == {}


def sheer_twin(path, core, slope, step=0.15, per=0.004):
    """Most that a core presses beyond what ramps over the same ground leave, pose by pose."""
    x, y = np.meshgrid(np.arange(-3.0, 3.0, step), np.arange(-3.0, 3.0, step))
    top, low = np.full(x.shape, 0.5), np.full(x.shape, np.inf)
    dug, paid, worst = np.zeros(x.shape), np.zeros(x.shape), 0.0
    box = np.array([np.full(x.shape, v) for v in (np.inf, -np.inf, np.inf, -np.inf)])
    for a, b in zip(path[:-1], path[1:], strict=True):
        count = max(int(np.linalg.norm(b - a) / per), 1)
        aside, drop = np.hypot(*(b - a)[:2]), max(a[2] - b[2], 0.0)
        for s in np.arange(1, count + 1) / count:
            tip = a + s * (b - a)
            rho = np.hypot(x - tip[0], y - tip[1])
            cut = (rho >= core) & (rho <= TOOL.radius) & (top > tip[2])
            top[cut] = tip[2]
            dug[cut] = np.minimum(dug[cut], np.maximum(top[cut] - low[cut], 0.0))
            paid[cut] = np.minimum(paid[cut], dug[cut])
            low[cut & (dug == 0.0)] = np.inf
            box[0::2, cut & (dug == 0.0)], box[1::2, cut & (dug == 0.0)] = np.inf, -np.inf
            over = np.minimum(low, top)
            down = (rho < core) & (over > tip[2]) & (drop > 0.0)
            gone = np.where(down, np.minimum(over - tip[2], drop), 0.0)
            dug, paid = dug + gone, paid + gone * min(1.0, aside * slope / drop if drop else 0.0)
            low = np.where((rho < core) & (over > tip[2]), tip[2], low)
            for k, v in enumerate((tip[0], tip[0], tip[1], tip[1])):
                box[k] = np.where(down, (np.minimum, np.maximum)[k % 2](box[k], v), box[k])
            ground = np.where(dug > 0.0, np.hypot(box[1] - box[0], box[3] - box[2]), 0.0)
            sheer = np.where(down, dug - np.minimum(paid, 2.0 * ground * slope), 0.0)
            worst = max(worst, float(sheer.max()))
    return worst


@pytest.mark.parametrize("seed", range(5))
def test_what_no_ramp_pays_for_is_that_of_a_twin(seed):
    """Ways at random: a skin a little lower than what the twin states is found, one a little higher is not."""
    rng = np.random.default_rng(40 + seed)
    n = 7
    path = np.column_stack([rng.uniform(-0.6, 0.6, (n, 2)).cumsum(axis=0) * 0.6, 0.5 - np.arange(n) * 0.03])
    path[2, :2], path[5, :2] = path[1, :2], path[4, :2]  # straight down
    core, slope = 0.6, math.tan(math.radians(20.0))
    want = sheer_twin(path, core, slope)
    moves = Moves(path[:-1].copy(), path[1:].copy(), np.ones(n - 1, bool), np.zeros(n - 1, np.int32))
    setup = replace(HOLLOW, ramp_angles={1: math.radians(20.0)}, plunge_skin=1e9)
    found = []
    for skin in (want - 0.012, want + 0.012):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(stock_pass, "PRESSED", max(skin, 1e-9) / TOOL.diameter)
            events = run_stock(blank(PART.mesh, 0.1, setup), moves, [TOOL], setup).events
        found.append(bool((events[:, 1] == PLUNGE).any()))
    assert want > 0.02 and found == [True, False]


def test_a_stub_far_from_a_dug_hole_stays_found():
    """Blocks in which ways decide over a plunge run twice, over the moves up to the last steep one."""
    down = [[-10.0, -8.0, 2.0], [-10.0, -8.0, -0.4], [-10.0, -8.0, 2.0]]
    pitch = 2.0 * math.pi * 0.2 * math.tan(SETUP.ramp_angle)
    path = np.concatenate([down, helix(0.2, pitch, 12, per=24) + [9.0, 8.0, 0.0]])
    moves = Moves(path[:-1].copy(), path[1:].copy(), np.ones(len(path) - 1, bool), np.zeros(len(path) - 1, np.int32))
    fine = replace(SETUP, cores={1: 1.2}, ramp_angles={1: math.radians(4.0)})
    events = run_stock(blank(PART.mesh, 0.15, fine), moves, [TOOL], fine).events
    found = events[events[:, 1] == PLUNGE]
    assert found[:, 0].min() == 0 and found[:, 0].max() > len(path) - 10


def test_lines_stand_in_every_core():
    moves = Moves(np.zeros((1, 3)), np.ones((1, 3)), np.ones(1, bool), np.zeros(1, np.int32))
    thin = replace(SETUP, cores={1: 0.2})
    assert stock_spacing(thin, moves, [TOOL]) == pytest.approx(0.14)
    assert stock_spacing(SETUP, moves, [TOOL]) > 0.14
    assert unseen_cores([TOOL], thin, 0.14, True) == [] and unseen_cores([TOOL], SETUP, 0.3, False) == []
    assert unseen_cores([TOOL], thin, 0.3, True) == unseen_cores([TOOL], thin, 0.14, False) == [TOOL]


@pytest.mark.parametrize("lean", [0.03, 0.05, 0.2])
@pytest.mark.parametrize("length", [0.65, 1.0])
@pytest.mark.parametrize("stands", [1.0, 0.5, 0.2])
def test_a_way_down_along_a_leaning_pass_is_no_plunge(lean, length, stands):
    """It begins higher than any stock over the pass, which may stand over its lower end only.

    The first ways back leave the stock and work off less, and all of them do where stock stands over a short end.
    """
    tool, top = mill(0.6, 0.3, 1.8), 0.2 + 0.5 * lean * length
    first = -2.0 if stands == 1.0 else (1.0 - stands) * length
    box = np.array([[first, -2.0, -1.0], [length + 2.0, 2.0, top]])
    setup = ProofSetup(stock_kind="box", stock_box=box)
    run = np.linspace(0.0, length, 4)
    line = np.column_stack([run, np.zeros(4), -lean * run])
    for pass_ in (line, line[::-1].copy()):
        way = way_down(pass_, False, top - line[:, 2].min(), tool, setup.ramp_angle, 1.0, stands)
        stock = blank(box_mesh(box[0], [*box[1, :2], -0.9]), 0.02, setup)
        events = run_stock(stock, path(way), [tool], setup).events
        assert not (events[:, 1] == PLUNGE).any(), events[events[:, 1] == PLUNGE, 2].max(initial=0.0)


def test_lines_stand_under_every_tool_that_only_goes_at_rapid():
    """Its width and its clearance count: a thin probe without clearance could pass between lines at rapid."""
    feed = np.array([True, False])
    moves = Moves(np.zeros((2, 3)), np.ones((2, 3)), feed, np.array([0, 1], np.int32))
    probe = replace(TOOL, diameter=0.1, number=2)
    close = [stock_spacing(replace(SETUP, clearance_rapid=room), moves, [TOOL, probe]) for room in (0.0, 0.05, 1.0)]
    assert close == pytest.approx([0.035, 0.07, SETUP.line_spacing])
