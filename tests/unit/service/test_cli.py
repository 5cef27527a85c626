"""The command line, with a chain that answers what it is told."""

import json
import subprocess
import sys
import types

import pytest
from typer.testing import CliRunner

import service
from geometry.errors import InternalError, PartError, VerificationError
from service.cli import app
from service.estimate import memory_room
from service.estimate.estimate import Estimate, Share

STEP = ("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
        "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\n"
        "END-ISO-10303-21;\n")
SETUP = {"tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3}]}


class FakeChain(types.ModuleType):
    def __init__(self):
        super().__init__("service.pipeline")
        self.answer, self.estimate = {"state": "proved", "findings": []}, None

    def _say(self, progress, admit):
        if self.estimate is not None:
            admit(self.estimate)
        progress("zones", 0.5)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def plan(self, part_path, setup, out, progress, mesh=None, blank_path=None, reading=None, admit=None):
        self.mesh = mesh
        return self._say(progress, admit)

    def zones_only(self, part_path, setup, progress, blank_path=None, reading=None, admit=None):
        return self._say(progress, admit)

    def verify_program(self, part_path, setup, program_text, progress, access=None, out=None, mesh=None,
                       spindle_tool=0, blank_path=None, dialect=None, ending="", program=None, reading=None,
                       admit=None):
        assert program_text.strip() and program.nc.text == program_text and program.spindle_tool == spindle_tool
        self.out, self.mesh, self.spindle_tool = out, mesh, spindle_tool
        return self._say(progress, admit)


@pytest.fixture
def chain(monkeypatch):
    fake = FakeChain()
    monkeypatch.setitem(sys.modules, "service.pipeline", fake)
    monkeypatch.setattr(service, "pipeline", fake, raising=False)
    return fake


@pytest.fixture
def files(tmp_path):
    (tmp_path / "p.step").write_text(STEP)
    (tmp_path / "s.json").write_text(json.dumps(SETUP))
    (tmp_path / "x.ngc").write_text("G21\nM2\n")
    return tmp_path


def call(*args):
    return CliRunner().invoke(app, [str(a) for a in args])


def test_plan_prints_the_report_alone_and_says_how_it_goes_on_stderr(chain, files):
    got = call("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "out")
    assert got.exit_code == 0 and json.loads(got.stdout) == chain.answer
    assert "zones" in got.stderr and (files / "out").is_dir()


@pytest.mark.parametrize(("answer", "code"), [
    ({"state": "unproved", "findings": []}, 3), (PartError("open"), 2), (VerificationError("broke"), 1),
    (InternalError("bug"), 1), (KeyError("x"), 1)])
def test_exit_codes_of_plan(chain, files, answer, code):
    chain.answer = answer
    got = call("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "out")
    assert got.exit_code == code
    if isinstance(answer, Exception):
        assert got.stdout == "" and "error:" in got.stderr


def test_verify_answers_0_without_and_3_with_findings(chain, files):
    args = ("verify", files / "p.step", "--setup", files / "s.json", "--program", files / "x.ngc")
    assert call(*args).exit_code == 0
    chain.answer = {"state": "unproved", "findings": [{"kind": "gouge"}]}
    assert call(*args).exit_code == 3
    assert chain.spindle_tool == 0 and call(*args, "--spindle-tool", 1).exit_code == 3 and chain.spindle_tool == 1
    chain.answer = {"state": "clean", "findings": [{"kind": "stock_left"}]}
    assert call(*args).exit_code == 3
    got = call(*args, "--spindle-tool", 4)
    assert got.exit_code == 2 and "no_such_tool" in got.stderr
    assert call(*args, "--spindle-tool", -1).exit_code == 2
    (files / "x.ngc").write_text("\n")
    got = call(*args)
    assert got.exit_code == 2 and "empty_program" in got.stderr


def test_zones_prints_what_the_chain_found(chain, files):
    got = call("zones", files / "p.step", "--setup", files / "s.json")
    assert got.exit_code == 0 and json.loads(got.stdout) == chain.answer


@pytest.mark.parametrize(("setup", "code"), [
    ("{", "setup_not_json"), (json.dumps({"tools": []}), "bad_setup"),
    (json.dumps({**SETUP, "unit": "inch"}), "bad_setup")])
def test_a_bad_setup_is_named_before_anything_is_computed(files, setup, code):
    (files / "s.json").write_text(setup)
    got = call("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "out")
    assert got.exit_code == 2 and code in got.stderr and got.stdout == ""
    got = call("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "out", "--json")
    assert got.exit_code == 2 and json.loads(got.stdout)["code"] == code


@pytest.mark.parametrize(("text", "code"), [("", "empty_file"), ("solid stl\n", "not_step"),
                                            (STEP[:120], "truncated_step")])
def test_a_file_that_is_no_step_is_refused(files, text, code):
    (files / "p.step").write_text(text)
    got = call("zones", files / "p.step", "--setup", files / "s.json")
    assert got.exit_code == 2 and code in got.stderr


def test_missing_files_are_bad_input(files):
    assert call("zones", files / "no.step", "--setup", files / "s.json").exit_code == 2
    assert call("zones", files / "p.step", "--setup", files / "no.json").exit_code == 2
    (files / "taken").write_text("")
    got = call("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "taken")
    assert got.exit_code == 2 and "out_not_writable" in got.stderr


def test_serve_refuses_to_be_reached_from_outside_without_a_key(files, monkeypatch):
    monkeypatch.delenv("ZONEMILL_AUTH", raising=False)
    got = call("serve", "--host", "0.0.0.0", "--port", "0", "--data", files / "data")
    assert got.exit_code == 2 and "exposed_without_key" in got.stderr
    got = call("serve", "--port", "70000")
    assert got.exit_code == 2 and "bad_setting" in got.stderr


def test_keys_are_made_listed_and_revoked(files, monkeypatch):
    monkeypatch.delenv("ZONEMILL_DATABASE_URL", raising=False)
    data = ("--data", files / "data")
    made = call("keys", "create", "--principal", "mes", "--scopes", "submit, read", "--note", "night shift", *data)
    key = json.loads(made.stdout)
    assert "zonemill.db" in made.stderr
    assert made.exit_code == 0 and key["key"].startswith(f"zm_{key['id']}_") and key["scopes"] == ["submit", "read"]
    assert key["expires_at"] and (files / "data").stat().st_mode & 0o077 == 0
    secret = key["key"].split("_", 2)[2]
    assert all(secret.encode() not in p.read_bytes() for p in (files / "data").rglob("*") if p.is_file())
    call("keys", "create", "--principal", "ops", "--scopes", "admin", "--days", 0, *data)
    listed = call("keys", "list", *data)
    assert secret not in listed.stdout
    assert [(k["principal"], k["expires_at"] is None, k["revoked_at"]) for k in json.loads(listed.stdout)] == [
        ("mes", False, None), ("ops", True, None)]
    assert call("keys", "revoke", key["id"], *data).exit_code == 0
    assert json.loads(call("keys", "list", *data).stdout)[0]["revoked_at"]
    got = call("keys", "revoke", "nonesuch", *data)
    assert got.exit_code == 2 and "no_such_key" in got.stderr


@pytest.mark.parametrize(("args", "code"), [
    (("--principal", "a b"), "bad_principal"), (("--principal", "x" * 65), "bad_principal"),
    (("--principal", "a\nb"), "bad_principal"), (("--principal", "a", "--scopes", "root"), "bad_scope"),
    (("--principal", "a", "--scopes", ""), "bad_scope"), (("--principal", "a", "--days", "1e9"), "bad_expiry")])
def test_a_key_that_makes_no_sense_is_not_made(files, args, code):
    got = call("keys", "create", *args, "--data", files / "data")
    assert got.exit_code == 2 and code in got.stderr and got.stdout == ""


def test_help_imports_nothing_heavy():
    text = ("import sys, service.cli; "
            "print([m for m in ('numpy', 'numba', 'fastapi', 'pydantic', 'OCP', 'dask') if m in sys.modules])")
    assert subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.fixture
def drawn(monkeypatch):
    """The family with a maker that builds nothing."""
    from pathlib import Path

    from examples.family import recipes
    from examples.family.layout import LayoutError

    class Part:
        def __init__(self, name):
            self.name = name

        def write(self, folder, *, reach=False):
            paths = [Path(folder, f"{self.name}.{end}") for end in ("step", "truth.json", "setup.json")]
            for path in paths:
                path.write_text(str(reach))
            return tuple(paths)

    def make(seed, recipe, **wanted):
        if wanted.get("walls", 2) > 12:
            raise LayoutError("the family has 2 to 12 walls and 0 to 16 connections")
        return Part(f"{recipe}-{seed}")

    monkeypatch.setattr(recipes, "make_part", make)


def test_family_writes_three_files_a_part_and_lists_them(drawn, tmp_path):
    got = call("family", "--seed", 7, "--count", 2, "--out", tmp_path / "parts")
    files = json.loads(got.stdout)
    assert got.exit_code == 0 and len(files) == 6
    assert [f.rsplit("/", 1)[1] for f in files[:3]] == ["mixed-7.step", "mixed-7.truth.json", "mixed-7.setup.json"]
    assert all((tmp_path / "parts" / f.rsplit("/", 1)[1]).exists() for f in files)


@pytest.mark.parametrize(("args", "code"), [
    (("--recipe", "teapot"), "unknown_recipe"), (("--walls", "40"), "impossible_layout"),
    (("--recipe", "demo", "--walls", "3"), "not_of_this_recipe")])
def test_family_says_what_it_cannot_draw(drawn, tmp_path, args, code):
    got = call("family", *args, "--out", tmp_path / "parts")
    assert got.exit_code == 2 and code in got.stderr and got.stdout == ""


def test_family_names_the_package_it_lacks(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cadquery", None)  # as if it were not installed
    got = call("family", "--recipe", "demo", "--out", tmp_path / "parts")
    assert got.exit_code == 2 and "generator_not_installed" in got.stderr and "cadquery" in got.stderr


def test_what_a_verification_found_is_said_in_words():
    from service.console import verification_summary

    findings = [{"kind": "gouge", "line": 40, "message": "T1 cuts 0.2 mm"},
                {"kind": "gouge", "line": 12, "message": "T1 cuts 0.1 mm"},
                {"kind": "coverage", "line": 0, "message": "coverage 0.5 is below"}]
    text = verification_summary({
        "state": "unproved", "findings": findings, "finding_counts": {"coverage": 1, "gouge": 7}, "coverage": 0.5,
        "gouge_max_mm": 0.2, "machined": {"volume_mm3": 12.5, "step_mm": 0.2}, "files": [{"name": "deviation.png"}]},
        3.21)
    assert text.splitlines() == [
        "unproved: 8 findings", "  coverage      1  coverage 0.5 is below",
        "  gouge         7  line 12: T1 cuts 0.1 mm",
        "  coverage   50.00 % of the judged area within the budget", "  deepest    0.2 mm cut into the part",
        "  machined   12.5 mm3 remain, nodes 0.2 mm apart", "  files      deviation.png, report.json",
        "  took       3.2 s"]
    assert verification_summary({"state": "proved", "findings": []}, 1.0).startswith("proved: no findings\n")


def test_a_mesh_is_made_when_it_is_asked_for(chain, files):
    plan = ("plan", files / "p.step", "--setup", files / "s.json", "--out", files / "out")
    assert call(*plan).exit_code == 0 and chain.mesh is None
    assert call(*plan, "--mesh-step", "0.1").exit_code == 0 and chain.mesh.step == 0.1 and chain.mesh.box is None
    got = call(*plan, "--mesh-box", "0,0,0,1,1,1")
    assert got.exit_code == 2 and "box_without_step" in got.stderr
    verify = ("verify", files / "p.step", "--setup", files / "s.json", "--program", files / "x.ngc")
    assert call(*verify).exit_code == 0 and chain.out is None and chain.mesh is None
    assert call(*verify, "--out", files / "v", "--mesh-box", "0,0,0,1,1,1").exit_code == 0
    assert chain.out == files / "v" and chain.mesh.step == 0.2 and chain.mesh.box.tolist() == [[0, 0, 0], [1, 1, 1]]


def test_stdout_of_a_verification_is_the_report_alone(chain, files):
    got = call("verify", files / "p.step", "--setup", files / "s.json", "--program", files / "x.ngc")
    assert json.loads(got.stdout) == chain.answer and "proved: no findings" in got.stderr


SHARES = (Share("program and libraries", 1, 800, 20.0), Share("samples of the proof", 480_000, 1200, 90.0))


def run_with_estimate(chain, files, command, monkeypatch, **variables):
    chain.estimate = Estimate(2000, 110.0, SHARES)
    monkeypatch.setattr(memory_room, "room_folder", lambda: files / "room")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    more = {"plan": ["--out", str(files / "out")], "zones": [], "verify": ["--program", str(files / "x.ngc")]}[command]
    return CliRunner().invoke(app, [command, str(files / "p.step"), "--setup", str(files / "s.json"), *more])


@pytest.mark.parametrize("command", ["plan", "zones", "verify"])
def test_the_estimate_is_printed_before_anything_is_computed(chain, files, command, monkeypatch):
    ran = run_with_estimate(chain, files, command, monkeypatch, ZONEMILL_MEMORY_MB="2000")
    assert ran.exit_code == 0
    words = "estimate: 2000 MB of memory, 110 s of processor; the most for the samples of the proof"
    assert words in ran.stderr and ran.stderr.index(words) < ran.stderr.index("zones")
    assert not list((files / "room").glob("*.json"))  # it takes no room any more


@pytest.mark.parametrize("command", ["plan", "zones", "verify"])
def test_a_job_above_the_memory_of_the_setting_is_refused(chain, files, command, monkeypatch):
    ran = run_with_estimate(chain, files, command, monkeypatch, ZONEMILL_MEMORY_MB="1999")
    assert ran.exit_code == 2 and "zones" not in ran.stderr.split("error:")[0]
    for words in ("about 2000 MB", "machine_too_small (CapacityError)", "samples of the proof", "limit     1999",
                  "raise ZONEMILL_MEMORY_MB"):
        assert words in ran.stderr, ran.stderr


def test_a_setting_that_is_no_number_is_named(chain, files, monkeypatch):
    ran = run_with_estimate(chain, files, "zones", monkeypatch, ZONEMILL_MEMORY_MB="much")
    assert ran.exit_code == 2 and "bad_setting" in ran.stderr and "memory_mb" in ran.stderr
