"""The file of the page, of whole jobs: it says what the report says, and gives no program of an unproved job away."""

import json

import numpy as np
import pytest

from service.viewer.view_file import read_view
from tests.e2e.test_withheld import FAKES, PROGRAMS, call, part  # noqa: F401

pytestmark = pytest.mark.timeout(900)


def test_a_program_that_takes_too_long_to_be_shown_is_proved_all_the_same(part, tmp_path):  # noqa: F811
    # a dwell-free day of cutting: seconds in ms do not fit the file, and the proof is not to be lost for that
    from service.from_wire import parse_setup
    from service.pipeline import verify_program
    from tests.e2e.test_withheld import SETUP

    slow = "G21 G17 G90 G94 G64 P0.001\nG54\nT1 M6\nG43 H1\nS1000 M3\nG0 Z20\nX0 Y0\nG1 Z10 F0.0002\nG0 Z20\nM2\n"
    report = verify_program(part, parse_setup(json.dumps(SETUP)), slow, lambda _stage, _share: None,
                            out=tmp_path / "out")
    assert not (tmp_path / "out" / "view.bin").exists()
    assert any("view.bin could not be made" in note for note in report["proof"]["notes"])
    assert "view.bin" not in [f["name"] for f in report["files"]]


def area_of(head, chunks, lod):
    """mm² by label at a level of detail."""
    out = {}
    for words, c in zip(head["chunks"], chunks, strict=True):
        if words["kind"] == "mesh" and words["lod"] == lod:
            p = head["mesh_grid_mm"] * c["place"][c["corners"]]
            cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
            out[words["label"]] = float(0.5 * np.linalg.norm(cross, axis=1).sum())
    return out


def test_the_demo_part_is_shown_as_its_report_has_it(demo_job):
    report, data = demo_job.report, (demo_job.out / "view.bin").read_bytes()
    head, chunks = read_view(data)
    assert not head["withheld"] and head["state"] == "proved" and head["findings"] == []
    assert [c["message"] for c in head["cautions"]] == [w["message"] for w in report["warnings"]]
    assert set(report["proof"]["notes"]) <= set(head["notes"])
    assert len(data) < 2e6
    finest = max(w["lod"] for w in head["chunks"] if w["kind"] == "mesh")
    area = area_of(head, chunks, finest)
    named = {tuple(v.items())[0]: area.get(k, 0.0) for k, v in enumerate(head["labelled"])}
    for z in report["zones"]:
        # strips narrower than a facet are as wide as their samples allow
        assert named["zone", z["id"]] == pytest.approx(z["proved_area_mm2"], rel=0.3, abs=3.0), z["id"]
    for k, e in enumerate(report["remainder"]):
        assert named["remainder", k] == pytest.approx(e["area_mm2"], rel=0.35, abs=2.5), (k, e["reason"])
    assert sum(area.values()) == pytest.approx(sum(area_of(head, chunks, 0).values()), rel=0.1)
    assert [s["id"] for s in head["steps"]] == [s["id"] for s in report["steps"]]
    assert head["seconds"] == pytest.approx(report["machining_time_s"], rel=1e-3)


def test_the_way_is_that_of_the_program(demo_job):
    from verify.gcode.reader import read_program

    head, chunks = read_view((demo_job.out / "view.bin").read_bytes())
    text = (demo_job.out / "program.linuxcnc.ngc").read_text()
    program = read_program(text, name="p", tools=frozenset({1, 2, 3}), work_offset="G54")
    fed = np.linalg.norm(program.end - program.start, axis=1)[program.kind == 1].sum()
    got, lines = 0.0, set()
    for words, c in zip(head["chunks"], chunks, strict=True):
        if words["kind"] == "path" and words["lod"] == 1:
            p = head["path_grid_mm"] * c["place"]
            rows = np.flatnonzero(c["kind"][:, 0] == 2)
            got += float(np.linalg.norm(p[rows] - p[rows - 1], axis=1).sum())
            lines |= set(c["line"][:, 0].tolist())
            assert (np.diff(c["time"][:, 0]) >= 0).all()
    assert got == pytest.approx(fed, rel=2e-3) and lines <= set(program.line.tolist())


def test_an_unproved_job_is_shown_without_its_program(part, tmp_path, monkeypatch):  # noqa: F811
    from service.stages import programs

    monkeypatch.syspath_prepend(str(FAKES))
    monkeypatch.setattr(programs, "write_program", programs.write_program)
    import gouging_chain

    monkeypatch.setattr(programs, "write_program", gouging_chain.gouging)
    got = call(part, tmp_path)
    assert got.exit_code == 3
    report = json.loads(got.stdout)
    head, chunks = read_view((tmp_path / "out" / "view.bin").read_bytes())
    assert head["withheld"] and head["state"] == "unproved"
    for words, c in zip(head["chunks"], chunks, strict=True):
        if words["kind"] == "path":
            assert set(c) == {"place", "kind", "time"} and words["lod"] == 0
            assert not (c["time"] % 1000).any()
    assert head["path_grid_mm"] == 0.25
    assert not [k for s in head["steps"] for k in s if "feed" in k or "rpm" in k]
    # the gouge is there with its place, its line and the second at which it happens, and red on the part
    (gouge,) = [f for f in head["findings"] if f["kind"] == "gouge"]
    (found,) = [f for f in report["findings"] if f["kind"] == "gouge"]
    assert gouge["line"] == found["line"] and gouge["point"] == found["point"]
    assert 0 < gouge["time_s"] <= head["seconds"] and gouge["program"] == PROGRAMS[0]
    # whole seconds do not say where the tool is: that is told, as coarsely as its way is
    assert head["steps"][gouge["step"]]["id"] == report["steps"][-1]["id"]
    assert gouge["tip_mm"] == [3.0, 6.0, 1.5] and gouge["axis"] == [0.0, 0.0, 1.0]
    assert head["found"] == report["finding_counts"]
    assert [f["tip_mm"] for f in head["findings"] if f["kind"] == "residual"] == [None] * 4
    left = [head["left_unit_mm"] * c["left"].min() for w, c in zip(head["chunks"], chunks, strict=True)
            if w["kind"] == "mesh"]
    assert min(left) == pytest.approx(-0.5, abs=0.01)
