"""The STEP files of the package: those the generator draws, without trace of a machine, in every built wheel."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from examples import demo
from geometry.step_import.reader import read_part
from tests.source_tree import ROOT

DRAWN = {"demo": demo.draw_demo, "small": demo.draw_small}


@pytest.mark.parametrize("name", DRAWN)
def test_the_file_holds_no_date_and_no_machine(name):
    text = (demo.PARTS / f"{name}.step").read_bytes().decode("ascii")
    header = text[:text.index("ENDSEC")]
    assert f"FILE_NAME('{name}','1970-01-01T00:00:00',('zonemill'),('zonemill'),'zonemill family'" in header
    assert not re.search(r"/(home|root|tmp|usr|work|Users)\b|[A-Z]:\\|\b20\d\d-\d\d-\d\d", text)
    assert "\r" not in text


def test_the_files_are_written_as_committed(tmp_path):
    for write, name in ((demo.write_demo, "demo"), (demo.write_small, "small")):
        step, setup = write(tmp_path / name)
        assert (step.name, setup.name) == (f"{name}.step", f"{name}.setup.json")
        assert step.read_bytes() == (demo.PARTS / step.name).read_bytes() and setup.stat().st_size > 1000


def test_they_are_package_data():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "parts/*.step" in project["tool"]["setuptools"]["package-data"]["examples"]
    assert sorted(p.stem for p in demo.PARTS.glob("*.step")) == sorted(DRAWN)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n == "demo" else ()) for n in DRAWN])
def test_the_generator_draws_the_same_solid(name, tmp_path):
    """Geometry is compared: the text depends on the version of the kernel that wrote it."""
    pytest.importorskip("cadquery")
    path = tmp_path / f"{name}.step"
    path.write_bytes(DRAWN[name]())
    drawn, committed = read_part(path, chord=0.02), read_part(demo.PARTS / path.name, chord=0.02)
    assert drawn.volume == pytest.approx(committed.volume, rel=1e-9)
    np.testing.assert_allclose(drawn.bounds, committed.bounds, atol=1e-9)
    assert [f.surface for f in drawn.faces] == [f.surface for f in committed.faces]
    np.testing.assert_allclose([f.area for f in drawn.faces], [f.area for f in committed.faces], rtol=1e-9)
    assert [(e.faces, e.kind) for e in drawn.edges] == [(e.faces, e.kind) for e in committed.edges]
    np.testing.assert_allclose([e.length for e in drawn.edges], [e.length for e in committed.edges], rtol=1e-9)
