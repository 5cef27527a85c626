"""One version, wherever it is written down."""

from __future__ import annotations

import json
import re
import tomllib

from typer.testing import CliRunner

from service.cli import app
from service.version import VERSION
from tests.source_tree import ROOT


def test_the_command_line_prints_the_version():
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"zonemill {VERSION}\n")


def test_help_stays_when_no_command_is_given():
    result = CliRunner().invoke(app, [])
    assert "Usage" in result.output and "--version" in result.output and "verify" in result.output


def test_package_page_contract_and_citation_carry_the_same_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    page = json.loads((ROOT / "web" / "package.json").read_text())
    lock = json.loads((ROOT / "web" / "package-lock.json").read_text())
    assert project["version"] == page["version"] == lock["version"] == lock["packages"][""]["version"] == VERSION
    assert re.search(rf"^  version: {re.escape(VERSION)}$", (ROOT / "openapi.yaml").read_text(), re.MULTILINE)
    assert re.search(rf"^version: {re.escape(VERSION)}$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)


def test_the_newest_release_in_the_changelog_is_this_version():
    releases = re.findall(r"^## \[(\d+\.\d+\.\d+)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert releases[0] == VERSION
    assert releases == sorted(releases, key=lambda r: tuple(map(int, r.split("."))), reverse=True)
