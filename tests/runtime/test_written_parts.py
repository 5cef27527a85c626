"""The runtime environment comes to the bytes of the development environment, without cadquery."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
from importlib.metadata import distributions
from pathlib import Path

import pytest

from tests.runtime.write_parts import DIGESTS, FAMILY, SHAPES, as_planned, as_read
from tests.source_tree import ROOT, modules

FOLDER = Path(os.environ["ZONEMILL_PARTS"])
NAMES = [*(f"{recipe}-{seed}" for recipe, seed in FAMILY), *SHAPES]


@pytest.fixture(scope="module")
def digests():
    return json.loads((FOLDER / DIGESTS).read_text())


def test_this_is_the_environment_of_the_runtime_lock():
    found = {d.metadata["Name"].lower().replace("_", "-"): d.version for d in distributions()}
    lock = (ROOT / "requirements-runtime.lock").read_text().splitlines()
    wanted = dict(line.split("==") for line in lock if ";" not in line)
    assert wanted.items() <= found.items()
    assert not {"cadquery", "cadquery-ocp", "vtk", "casadi", "trame", "matplotlib"} & set(found)
    assert importlib.util.find_spec("cadquery") is None and importlib.util.find_spec("vtkmodules") is None


def test_every_module_of_the_product_can_be_imported():
    names = [n.removesuffix(".__init__") for n, _ in modules() if not n.endswith("__main__")]
    names = [n for n in names if not n.startswith("examples.clients") and ".migrations" not in n]
    assert len(names) > 300
    for name in names:
        importlib.import_module(name)


@pytest.mark.parametrize("name", NAMES)
def test_a_part_is_read_to_the_same_bytes(name, digests):
    assert as_read(FOLDER / f"{name}.step") == digests["read"][name]


@pytest.mark.timeout(900)
def test_the_small_part_is_planned_to_the_same_bytes(tmp_path, digests):
    planned = as_planned(tmp_path)
    assert {"program.linuxcnc.ngc", "job.stpnc", "report.json"} <= set(planned)
    assert planned == digests["planned"]
