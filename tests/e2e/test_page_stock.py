"""The stock of the page against the verifier's: the same surface at its states, and nearly so cut on between them.

``web/tests/stock.mjs`` runs what the page runs, without a browser.
"""

import itertools
import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from service.stages.access_plan import ProofFrame
from service.viewer import view_stock
from service.viewer.view_data import tool_shape
from service.viewer.view_file import Chunk, read_view, write_view
from service.viewer.view_paths import AXIS_UNIT, path_chunks, track_of
from service.viewer.view_stock import stock_chunk
from tests.e2e.test_page import ROOT, node
from tests.pocket_case import SETUP, block
from verify.checks.program_sequence import read_all
from verify.kinematics import Kinematics
from verify.material.machined_part import stock_in_time
from verify.model import NcProgram

pytestmark = pytest.mark.timeout(300)
PART = block()
TOOLS = (ToolBody("T1", 1, 6.0, 1.0, 10.0, 5.8, 20.0, 6.0, 40.0),
         ToolBody("T2", 2, 4.0, 2.0, 9.0, 3.8, 20.0, 6.0, 40.0),
         ToolBody("T3", 3, 5.0, 0.0, 9.0, 4.8, 20.0, 6.0, 40.0))
MACHINE = replace(SETUP, kinematics=Kinematics("table-table-AC", None), gauge_length={1: 80.0, 2: 80.0, 3: 80.0})
HEAD = "%\nG21 G90 G17 G94 G40 G49 G54\n"
# a slot, one whose floor the tool leans over more and more, and a cut from the side
TURNING = HEAD + "\n".join(
    f"T{n} M6\nS1000 M3\nG43 H{n}\nG0 A0 C0\nX0 Y0\nZ80\nM428\n{cuts}\nG0 Z80\nM429"
    for n, cuts in ((1, "G0 X-30 Y8\nZ-2\nG1 X30 F600"),
                    (2, "G0 X-30 Y-4 A10\nZ-3\nG1 X0 A30 F600\nX30 Z-4 A50"),
                    (3, "G0 X-14 Y-40 A70\nZ-4\nG1 Y-12 F300\nX-4\nG0 Y-40"))) + "\nM30\n%\n"
TURN = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # the page's frame is not that of the proof


@pytest.fixture(scope="module")
def given():
    read = read_all([NcProgram("p.ngc", TURNING)], PART, TOOLS, MACHINE, 0, lambda _share: None)
    assert read[0].program.poses is not None
    return read


def view_of(read, stretches, nodes=20_000, open_=True):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(view_stock, "STRETCHES", stretches)
        patch.setattr(view_stock, "NODES", nodes)
        field = stock_chunk(read, PART, TOOLS, MACHINE, ProofFrame("A1", TURN, PART), open_=open_)
    way = track_of(read, [NcProgram("p.ngc", TURNING)], TURN)
    low = np.floor(np.minimum(way.start, way.end).min(axis=0))
    first, then, steps, grid = path_chunks(way, low, open_=open_)
    chunks: list[Chunk] = [*first, field, *then]
    head = {"low_mm": low.tolist(), "path_grid_mm": grid, "axis_unit": AXIS_UNIT, "steps": steps,
            "tools": [tool_shape(t) for t in TOOLS]}
    return write_view(head, chunks)


def page(data, seconds, tmp_path):
    """What the page makes of a file at some seconds."""
    if node() is None or not (ROOT / "web" / "node_modules" / "typescript").is_dir():
        pytest.skip("no Node with the packages of the page here: make web")
    (tmp_path / "view.bin").write_bytes(data)
    done = subprocess.run([node(), str(ROOT / "web" / "tests" / "stock.mjs"), str(tmp_path / "view.bin"),
                           *(repr(float(s)) for s in seconds)], capture_output=True, text=True, cwd=ROOT / "web")
    assert done.returncode == 0, done.stderr[-2000:]
    out = [json.loads(line) for line in done.stdout.splitlines()]
    return [{k: np.array(v).reshape(-1, 3) if k in ("place", "normal", "index") else np.array(v) for k, v in s.items()}
            for s in out]


def test_the_cutter_of_the_page_is_the_shape_of_the_tool():
    """Nodes beside a tool at rest have their distance from it, with and without a taper."""
    if node() is None or not (ROOT / "web" / "node_modules" / "typescript").is_dir():
        pytest.skip("no Node with the packages of the page here: make web")
    bodies = [ToolBody("T1", 1, d, c, 6.0, 2.0, 20.0, 6.0, 40.0, taper=np.tan(np.radians(angle)))
              for d, c in ((1.0, 0.5), (2.0, 0.4), (2.0, 0.0), (3.0, 0.5)) for angle in (0.0, 3.0, 30.0)]
    n, step, tip = 34, 0.26, np.array([4.1, 4.3, 1.2])
    axis = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    words = ({"nx": n, "ny": n, "nz": n, "step": step, "origin": [0, 0, 0]}, tip.tolist(), axis.tolist(),
             [tool_shape(b) for b in bodies])
    done = subprocess.run([node(), str(ROOT / "web" / "tests" / "cutter.mjs"), *map(json.dumps, words)],
                          capture_output=True, text=True, cwd=ROOT / "web")
    assert done.returncode == 0, done.stderr[-2000:]
    places = step * np.stack(np.meshgrid(*(np.arange(n),) * 3, indexing="ij"), axis=-1).reshape(-1, 3) - tip
    up = places @ axis
    aside = np.sqrt(np.maximum((places**2).sum(axis=1) - up**2, 0.0))
    for body, text in zip(bodies, done.stdout.splitlines(), strict=True):
        values, outline = np.array(json.loads(text)), np.array([*body.cutting_profile(400), (0.0, body.flute_length)])
        far = np.full(len(up), np.inf)
        for (r0, z0), (r1, z1) in itertools.pairwise(outline):
            way = np.array([r1 - r0, z1 - z0])
            if way @ way > 0.0:
                share = np.clip(((aside - r0) * way[0] + (up - z0) * way[1]) / (way @ way), 0.0, 1.0)
                far = np.minimum(far, np.hypot(aside - r0 - share * way[0], up - z0 - share * way[1]))
        wide = np.interp(up, outline[:-1, 1], outline[:-1, 0])
        inside = (up > 0.0) & (up < body.flute_length) & (aside < wide)
        assert inside.sum() > 40 and (values[inside] <= 1e-6).all()
        near = ~inside & (far < 0.9 * step) & (up < body.flute_length)  # the page cuts nodes a step away
        # beside an edge the field has the larger of two distances, which is none too large
        assert near.sum() > 60 and (values[near] <= far[near] + 2e-4).all()
        side = near & (up > body.corner_end[1] + body.taper * aside) & (up < body.flute_length - 2.0 * step)
        assert side.sum() > 30 and np.allclose(values[side], far[side], atol=2e-4)


def test_its_surface_is_that_of_the_verifier(given, tmp_path):
    stock = stock_in_time(given, PART, TOOLS, MACHINE, stretches=5, nodes=20_000)
    assert len(stock.ended) == 5
    # forwards, back to the blank, and forwards again
    wanted = [0, 2, 5, 1]
    seconds = [0.0 if k == 0 else stock.ended[k - 1] + 0.001 for k in wanted]
    for k, got in zip(wanted, page(view_of(given, 5), seconds, tmp_path), strict=True):
        field = stock.after(k)
        values = field.values.copy().ravel()
        true = field.surface()
        assert len(got["place"]) == len(true.vertices) and len(got["index"]) == len(true.faces), k
        assert np.abs(got["values"] - values).max() < (1e-5 if k in (0, 5) else 0.05)  # a millisecond of cutting
        if k in (0, 5):
            assert np.abs(got["place"] - true.vertices).max() < 1e-3
        a, b, c = (got["place"][got["index"][:, n]] for n in range(3))
        volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
        assert volume == pytest.approx(true.volume, rel=1e-4) and volume > 0.0  # seen from outside
        # normals look out of the stock
        facet = np.cross(b - a, c - a)
        mean = sum(got["normal"][got["index"][:, n]] for n in range(3))
        assert ((facet * mean).sum(axis=1) > 0).mean() > 0.99


def test_it_is_cut_on_between_two_states(given, tmp_path):
    """One stretch alone: all of the way is cut by the page, leaning and turning, with three kinds of end."""
    fine = stock_in_time(given, PART, TOOLS, MACHINE, stretches=40, nodes=20_000)
    rows = [k for k in range(2, len(fine.ended), 3)]
    seconds = [fine.ended[k] for k in rows]
    gone = []
    for k, got in zip(rows, page(view_of(given, 1), [s - 1e-3 for s in seconds], tmp_path), strict=True):
        true = fine.after(k + 1).values.ravel()
        off = got["values"] - true
        near = np.abs(true) < 0.9 * fine.step  # round the surface
        assert np.abs(off[near]).mean() < 0.03 * fine.step, k
        assert np.quantile(np.abs(off[near]), 0.99) < 0.25 * fine.step, k
        gone.append(int((true < 0).sum()) - int((fine.after(0).values < 0).sum()))
    assert gone[-1] > 500 and len(set(gone)) > 4


def test_where_the_part_is_bare_nothing_spares(given, tmp_path):
    got, = page(view_of(given, 3), [1e6], tmp_path)
    assert got["spare"].max() > 0.4 and (got["place"][:, 2] < 0.51).all()
    # the sides of the blank stand half a millimetre out of the part, its foot lies on that of the part
    side = np.abs(got["place"][:, 0] - 20.5) < 0.01
    flat = side & (np.abs(got["place"][:, 1]) < 12) & (np.abs(got["place"][:, 2] + 6) < 2)
    assert flat.any() and np.allclose(got["spare"][flat], 0.5, atol=0.02)
    foot = (np.abs(got["place"][:, 2] + 10) < 0.01) & (np.hypot(*got["place"][:, :2].T) < 10)
    assert foot.any() and np.abs(got["spare"][foot]).max() < 0.02


def test_of_a_job_that_is_not_proved_seconds_are_whole(given):
    head, chunks = read_view(view_of(given, 6, open_=False))
    rows = [(w, c) for w, c in zip(head["chunks"], chunks, strict=True) if w["kind"] == "field"]
    (words, field), = rows
    assert not (field["ended"] % 1000).any() and (np.diff(field["ended"][:, 0]) > 0).all()
    assert np.prod(words["shape"]) == len(field["first"]) == len(field["part"])
    assert field["begins"][-1, 0] == len(field["node"]) == len(field["value"])
