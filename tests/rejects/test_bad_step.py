"""Every bad STEP input has its own words, and leaves nothing running."""

import gzip
import os
import sys
import time

import psutil
import pytest

from geometry.child_process import run_limited
from geometry.errors import PartError, ResourceError, SetupError, StepError
from geometry.step_import.occ.loading import load_part
from geometry.step_import.reader import read_part
from geometry.step_import.text_checks import check_text
from tests.child_processes import running, started_since
from tests.step_files import real_part, write_step
from tests.time_limits import in_time

cq = pytest.importorskip("cadquery")


@pytest.fixture(autouse=True)
def nothing_left_running():
    before = running()
    yield
    assert started_since(before) == []


@pytest.fixture(scope="module")
def box_text(tmp_path_factory):
    path = write_step(cq.Workplane().box(10, 20, 30), tmp_path_factory.mktemp("box") / "box.step")
    return path.read_text()


def refused(error, code, act):
    with pytest.raises(error) as caught:
        act()
    found = caught.value
    assert found.code == code, found.message
    assert found.message and found.remedy
    return found


def test_missing_file(tmp_path):
    refused(StepError, "no_file", lambda: read_part(tmp_path / "none.step"))


@pytest.mark.parametrize("content", [b"", b" \r\n\n"])
def test_empty_file(tmp_path, content):
    path = tmp_path / "empty.step"
    path.write_bytes(content)
    refused(StepError, "empty_file", lambda: load_part(path))


def test_error_crosses_the_process_border(tmp_path):
    path = tmp_path / "empty.step"
    path.touch()
    found = refused(StepError, "empty_file", lambda: read_part(path))
    assert found.subjects == ("empty.step",) and found.limit == 1


@pytest.mark.parametrize(("content", "hint"), [
    (b"Dear machinist,\nplease mill this.\n", "export"),
    (b"solid wall\nfacet normal 0 0 1\n", "STL"),
    (b"PK\x03\x04rest", "zip"),
    (gzip.compress(b"ISO-10303-21;\nHEADER;", mtime=0), "holds a STEP file"),
])
def test_no_step_file(tmp_path, content, hint):
    path = tmp_path / "letter.step"
    path.write_bytes(content)
    assert hint in refused(StepError, "not_step", lambda: load_part(path)).remedy


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9, 0.995])
def test_truncated_step(tmp_path, box_text, share):
    path = tmp_path / "cut.step"
    path.write_text(box_text[:int(share * len(box_text))])
    refused(StepError, "truncated_step", lambda: load_part(path))


def test_step_with_a_hole_in_the_middle(tmp_path, box_text):
    lines = box_text.splitlines(keepends=True)
    middle = next(i for i, line in enumerate(lines) if "ADVANCED_FACE" in line)
    path = tmp_path / "hole.step"
    path.write_text("".join(lines[:middle] + lines[middle + 1:]))
    found = refused(StepError, "dangling_reference", lambda: load_part(path))
    assert found.subjects[0].startswith("#") and found.measured >= 1


def test_quoted_numbers_are_no_references(tmp_path, box_text):
    path = tmp_path / "quoted.step"
    path.write_text(box_text.replace("'Open CASCADE STEP", "'part #99999999 ENDSEC; Open CASCADE STEP", 1))
    assert check_text(path).faces == 6


@pytest.mark.parametrize("number", ["NAN", "nan", "-nan(ind)", "INF", "-Infinity", "1.#QNAN", "1.E300", "-2.5e+100"])
def test_a_coordinate_that_is_none(tmp_path, box_text, number):
    at = box_text.index("CARTESIAN_POINT('',(") + len("CARTESIAN_POINT('',(")
    entity = "#" + box_text[:at].rpartition("#")[2].split("=")[0].strip()
    path = tmp_path / "nan.step"
    path.write_text(box_text[:at] + number + box_text[box_text.index(",", at):])
    began = time.monotonic()
    found = refused(StepError, "bad_number", lambda: check_text(path))
    assert in_time(time.monotonic() - began, 1.0)
    assert found.subjects == (entity,) and found.measured == number and entity in found.remedy


HEAD, TAIL = b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n", b"\nENDSEC;\nEND-ISO-10303-21;\n"


@pytest.mark.parametrize("middle", [
    b"/* " * 200_000, b"CARTESIAN_POINT(" + b"1" * 500_000, b"CARTESIAN_POINT(" * 40_000,
    b"CARTESIAN_POINT(1E" * 40_000, b"1E400 CARTESIAN_POINT(;" * 40_000, b"'" * 500_001, b"#1" + b" " * 500_000,
    b"(nan(" * 100_000, b"=PRODUCT('" * 50_000], ids=lambda m: m[:20].decode())
def test_a_text_that_is_built_to_be_slow_takes_its_length_and_no_more(tmp_path, middle):
    path = tmp_path / "slow.step"
    path.write_bytes(HEAD + middle + TAIL)
    began = time.process_time()
    try:
        check_text(path)
    except StepError as error:
        assert error.code in ("dangling_reference", "truncated_step", "bad_number")
    assert in_time(time.process_time() - began, 2.0)


def test_names_and_numbers_of_any_length_are_told_in_short(tmp_path):
    path = tmp_path / "long.step"
    path.write_bytes(HEAD + b"#1=X(#" + b"9" * 10_000 + b",#30,#4);" + TAIL)
    found = refused(StepError, "dangling_reference", lambda: check_text(path))
    assert found.subjects == ("#4", "#30", "#" + "9" * 60) and found.measured == 3
    path.write_bytes(HEAD + b"#1=CARTESIAN_POINT('',(0.,-" + b"9" * 10_000 + b".E+100,0.));" + TAIL)
    found = refused(StepError, "bad_number", lambda: check_text(path))
    assert found.subjects == ("#1",) and found.measured == "-" + "9" * 59


def test_a_comment_ends_where_it_says_and_a_huge_number_counts_in_a_point_alone(tmp_path, box_text):
    path = tmp_path / "comments.step"
    harmless = "DATA;\n/* CARTESIAN_POINT(1.E400) */ #99998=X(1.E400);/**/ #99997=Y(); /*/ 1.E400 /* */"
    path.write_text(box_text.replace("DATA;", harmless, 1))
    assert check_text(path).faces == 6
    path.write_text(box_text.replace("DATA;", "DATA;\n#99998=(X() CARTESIAN_POINT ('',(0.,/* */ 1.E400)));", 1))
    assert refused(StepError, "bad_number", lambda: check_text(path)).measured == "1.E400"


def test_words_that_look_like_no_number_are_no_harm(tmp_path, box_text):
    path = tmp_path / "words.step"
    path.write_text(box_text.replace("'Open CASCADE STEP", "'(NAN,INF) Open CASCADE STEP", 1)
                    .replace("DATA;", "DATA;\n#99998=X(.INF.,1.E-300,NANO());\n/* (NAN) */", 1))
    assert check_text(path).faces == 6


def test_file_too_large(tmp_path, box_text):
    path = tmp_path / "big.step"
    path.write_text(box_text)
    found = refused(StepError, "file_too_large", lambda: check_text(path, max_bytes=1000))
    assert found.measured == len(box_text) and found.limit == 1000


def test_step_without_shapes(tmp_path, box_text):
    head = box_text[:box_text.index("DATA;")]
    path = tmp_path / "bare.step"
    path.write_text(head + "DATA;\nENDSEC;\nEND-ISO-10303-21;\n")
    refused(StepError, "no_solid", lambda: load_part(path))


def test_step_with_a_wire_only(tmp_path):
    path = write_step(cq.Workplane().circle(5).val(), tmp_path / "wire.step")
    refused(StepError, "no_solid", lambda: load_part(path))


def test_open_shell(tmp_path):
    faces = cq.Workplane().box(10, 20, 30).faces().vals()
    path = write_step(cq.Shell.makeShell(faces[:-1]), tmp_path / "open.step")
    found = refused(PartError, "open_shell", lambda: load_part(path))
    assert found.measured["free_edges"] == 4 and found.measured["largest_gap_mm"] >= 5


def test_faces_too_far_apart_to_sew(tmp_path):
    faces = cq.Workplane().box(10, 20, 30).faces().vals()
    faces[0] = faces[0].translate(cq.Vector(-0.05, 0, 0))
    path = write_step(cq.Compound.makeCompound(faces), tmp_path / "gap.step")
    found = refused(PartError, "open_shell", lambda: load_part(path))
    assert found.measured["free_edges"] == 8
    assert found.measured["largest_gap_mm"] == pytest.approx(0.05, rel=0.01) and found.limit == 0.01


def test_two_separate_solids(tmp_path):
    two = cq.Compound.makeCompound([cq.Solid.makeBox(10, 10, 10), cq.Solid.makeBox(5, 5, 5, cq.Vector(30, 0, 0))])
    path = write_step(two, tmp_path / "two.step")
    found = refused(PartError, "several_solids", lambda: load_part(path))
    assert found.subjects == ("solid 1", "solid 2") and found.measured == 2
    assert "10 x 10 x 10" in found.message and "125 mm³" in found.message
    for wrong in (0, 3, -1):
        assert refused(PartError, "no_such_solid", lambda k=wrong: load_part(path, solid=k)).limit == 2


def test_part_of_a_tenth_of_a_millimetre(tmp_path):
    path = write_step(cq.Workplane().box(0.1, 0.1, 0.1), tmp_path / "dust.step")
    found = refused(PartError, "part_too_small", lambda: load_part(path))
    assert found.measured == pytest.approx(0.1, rel=1e-3) and found.limit == 0.5 and "factor" in found.message


def test_part_of_twenty_metres(tmp_path):
    path = write_step(cq.Workplane().box(20_000, 100, 100), tmp_path / "ship.step")
    found = refused(PartError, "part_too_large", lambda: load_part(path))
    assert found.measured == pytest.approx(20_000, rel=1e-3) and found.limit == 10_000


def test_millimetres_declared_as_metres(tmp_path):
    path = write_step(cq.Workplane().box(117_000, 20_000, 9_000), tmp_path / "metres.step", "M")
    found = refused(PartError, "part_too_large", lambda: load_part(path))
    assert "117 m in the file" in found.message and "read as mm it would be 117 mm (factor 0.001)" in found.message


@pytest.mark.parametrize("bad", [{"chord": 0}, {"chord": -1}, {"chord": float("nan")}, {"angle": 0}, {"angle": 4}])
def test_impossible_mesh_tolerances(tmp_path, bad):
    refused(SetupError, "bad_tolerance", lambda: read_part(tmp_path / "any.step", **bad))


def test_heavy_part_runs_out_of_time():
    path = real_part("imp_kj66_compressor_wheel.step")
    began = time.monotonic()
    found = refused(PartError, "reader_timeout", lambda: read_part(path, time_limit=2.0))
    assert in_time(time.monotonic() - began, 4.0) and found.limit == 2.0
    assert "scallop_height_mm" in found.remedy


def test_memory_limit_stops_the_reader(tmp_path, box_text):
    path = tmp_path / "box.step"
    path.write_text(box_text)
    refused(PartError, "reader_memory", lambda: read_part(path, memory_limit=50e6))


def test_a_reader_that_crashes_blames_the_part_and_one_killed_from_outside_does_not(tmp_path, monkeypatch):
    def dying(name):
        def run(*_, **__):
            return run_limited([sys.executable, "-c", f"import os, signal; os.kill(os.getpid(), signal.{name})"], b"",
                               time_limit=20.0, memory_limit=1e9)
        return run

    monkeypatch.setattr("geometry.step_import.reader.run_limited", dying("SIGSEGV"))
    refused(PartError, "reader_crashed", lambda: read_part(tmp_path / "any.step"))
    monkeypatch.setattr("geometry.step_import.reader.run_limited", dying("SIGKILL"))
    refused(ResourceError, "reader_crashed", lambda: read_part(tmp_path / "any.step"))


def child(code, **limits):
    return run_limited([sys.executable, "-c", code], b"", **{"time_limit": 20.0, "memory_limit": 1e9, **limits})


def test_segfault_becomes_a_typed_error():
    found = refused(ResourceError, "reader_crashed", lambda: child("import ctypes; ctypes.string_at(0)"))
    assert found.measured == "SIGSEGV"


def test_abort_and_silent_exit_become_typed_errors():
    assert refused(ResourceError, "reader_crashed", lambda: child("import os; os.abort()")).measured == "SIGABRT"
    assert refused(ResourceError, "reader_crashed", lambda: child("raise SystemExit(9)")).measured == "exit code 9"
    assert refused(ResourceError, "reader_crashed", lambda: child("pass")).measured == "exit code 0"


def test_hang_is_stopped_with_its_descendants():
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; time.sleep(60)'])"
    refused(ResourceError, "reader_timeout", lambda: child(code, time_limit=1.0))


def test_memory_hog_is_stopped():
    code = "x = []\nwhile True: x.append(bytearray(b'1') * 20_000_000)"
    refused(ResourceError, "reader_memory", lambda: child(code, memory_limit=200e6))


def test_child_dies_with_its_parent(tmp_path):
    note = tmp_path / "pid"
    inner = ("from geometry.child_process import guard_child; guard_child(); import os, time; "
             f"open({str(note)!r}, 'w').write(str(os.getpid())); time.sleep(60)")
    outer = ("import sys; from geometry.child_process import run_limited; "
             f"run_limited([sys.executable, '-c', {inner!r}], b'', time_limit=60, memory_limit=1e9)")
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parent = psutil.Popen([sys.executable, "-c", outer], cwd=root, env={**os.environ, "PYTHONPATH": root})
    deadline = time.monotonic() + 120
    while not (note.exists() and note.read_text()) and time.monotonic() < deadline:
        time.sleep(0.02)
    grandchild = psutil.Process(int(note.read_text()))
    parent.kill()
    parent.wait()
    psutil.wait_procs([grandchild], timeout=5)
    assert not grandchild.is_running() or grandchild.status() == psutil.STATUS_ZOMBIE


def test_unstitched_faces_are_refused_with_words():
    found = refused(PartError, "open_shell", lambda: read_part(real_part("nasty_unstitched_faces.stp")))
    assert found.measured["free_edges"] > 0 and 0.01 < found.measured["largest_gap_mm"] < 0.1
