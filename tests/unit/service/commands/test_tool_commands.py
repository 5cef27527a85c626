"""zonemill tools import and export."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from service.cli import app
from service.commands.tool_commands import library_of
from service.from_wire import parse_setup
from tests.unit.service.test_cli import chain, files  # noqa: F401

TABLE = "id,kind,diameter,flutes,flute length,shank diameter,stickout\nEM-1,flat,0.25,3,0.75,0.25,1.5\n"


def run(*words: object):
    return CliRunner().invoke(app, ["tools", *map(str, words)])


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "tools.csv"
    path.write_text(TABLE)
    return path


def test_import_prints_the_tools_of_a_setup(table, tmp_path):
    done = run("import", table, "--unit", "in")
    assert done.exit_code == 0, done.output
    tools = json.loads(done.stdout)
    assert tools[0]["id"] == "EM-1" and tools[0]["diameter_mm"] == 6.35
    assert parse_setup(json.dumps({"tools": tools})).tools[0].stickout_mm == 38.1
    assert "1 taken, 0 taken with notes, 0 left out" in done.stderr
    out = tmp_path / "out.json"
    assert run("import", table, "--unit", "in", "-o", out).stdout == "" and json.loads(out.read_text()) == tools


def test_a_dry_run_prints_what_becomes_of_each_entry(table):
    done = json.loads(run("import", table, "--unit", "in", "--dry-run").stdout)
    assert (done["format"], done["taken"], done["dry_run"]) == ("csv", 1, True)
    assert (done["entries"][0]["place"], done["entries"][0]["name"]) == ("row 2", "EM-1")


def test_a_library_without_a_unit_is_a_question_and_exit_code_2(table):
    done = run("import", table)
    assert done.exit_code == 2 and "are they mm or inches?" in done.stderr and "--unit mm or --unit in" in done.stderr
    problem = json.loads(run("import", table, "--json").stdout)
    assert (problem["code"], problem["subjects"]) == ("unit_missing", ["row 2 'EM-1'"])
    assert run("import", table, "--unit", "parsec").exit_code == 2
    assert run("import", table.with_name("none.csv")).exit_code == 2


def test_stored_tools_serve_setups_and_exports(table, tmp_path):
    data = tmp_path / "data"
    assert run("import", table, "--unit", "in", "--data", data, "-o", tmp_path / "x").exit_code == 0
    setup = parse_setup(json.dumps({"tools": ["lib:EM-1"]}), library_of(data))
    assert setup.tools[0].diameter_mm == 6.35
    done = run("export", "--data", data, "--format", "fusion")
    assert json.loads(done.stdout)["data"][0]["geometry"]["DC"] == 6.35
    assert library_of(None) is None


def test_commands_find_stored_tools_with_data(chain, files, table, tmp_path):  # noqa: F811
    data = tmp_path / "data"
    run("import", table, "--unit", "in", "--data", data, "-o", tmp_path / "x")
    (files / "s.json").write_text(json.dumps({"tools": ["lib:EM-1"]}))
    words = ["zones", str(files / "p.step"), "--setup", str(files / "s.json")]
    without = CliRunner().invoke(app, words)
    assert without.exit_code == 2 and "it has: none" in without.stderr
    assert CliRunner().invoke(app, [*words, "--data", str(data)]).exit_code == 0


def test_export_of_a_setup_says_what_is_lost(tmp_path):
    setup = tmp_path / "setup.json"
    setup.write_text(json.dumps({"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 6, "coolant": "flood"},
                                           {"id": "T2", "kind": "chamfer", "diameter_mm": 6}]}))
    out = tmp_path / "tools.xml"
    done = run("export", setup, "--format", "hypermill", "-o", out)
    assert done.exit_code == 0, done.output
    assert "tool T2 is left out: hyperMILL has no kind chamfer" in done.stderr
    assert "tool T1: hyperMILL has no place for stickout_mm, coolant" in done.stderr
    assert json.loads(run("import", out).stdout)[0]["id"] == "T1"
    assert run("export").exit_code == run("export", setup, "--format", "klingon").exit_code == 2


def test_a_freecad_library_finds_its_bits_in_the_folder_beside(tmp_path):
    for folder in ("Library", "Bit"):
        (tmp_path / folder).mkdir()
    (tmp_path / "Library" / "a.fctl").write_text(json.dumps({"tools": [{"nr": 3, "path": "six.fctb"}], "version": 1}))
    (tmp_path / "Bit" / "six.fctb").write_text(json.dumps({
        "version": 2, "name": "six", "shape": "endmill.fcstd", "parameter": {"Diameter": "6 mm"}, "attribute": {}}))
    tools = json.loads(run("import", tmp_path / "Library" / "a.fctl").stdout)
    assert (tools[0]["id"], tools[0]["number"], tools[0]["diameter_mm"]) == ("six", 3, 6)
