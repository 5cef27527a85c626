"""The page under bad treatment: phones, links that are pasted, broken files and streams, setups it has no fields for.

``web/tests/harm.mjs`` does the harm; here is what it needs.
"""

import json

import pytest

from service.api.server import background, settings_with
from tests.e2e.test_page import driven, shown
from tests.e2e.test_withheld import call, part  # noqa: F401

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600), pytest.mark.network]


def test_a_job_is_seen_on_bad_days(part, tmp_path):  # noqa: F811
    assert call(part, tmp_path, machine={"arcs": False}).exit_code == 0  # the tool is followed along straight lines
    with shown(tmp_path / "out") as url:
        driven("harm.mjs", "folder", url, tmp_path)


def test_the_form_changes_no_setup_and_the_page_outlives_its_connection(tmp_path):
    flat = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
    setups = [
        {"tools": [flat], "quality": {"scallop_height_mm": 0.4}, "stock": {"kind": "box", "margin_mm": 3},
         "machine": {"kind": "5-axis", "dialects": ["siemens", "heidenhain"]}, "labels": {"order": "of before"}},
        {"tools": ["lib:em4", flat], "machine": "lib:vmc@2", "material": {"name": "own steel", "kc11_n_mm2": 1500},
         "stock": {"kind": "step", "step_file": "blank.step"}},
        {"tools": ["lib:em4"]},
    ]
    files = [tmp_path / f"setup{k}.json" for k in range(len(setups))]
    for file, setup in zip(files, setups, strict=True):
        file.write_text(json.dumps(setup))
    with background(settings_with({"host": "127.0.0.1", "port": 0, "data_dir": tmp_path / "data"})) as url:
        first, second, third = driven("harm.mjs", "service", f"{url}/", *files)["setups"]
    assert "box_mm" not in second["stock"] and second["labels"] == {}
    # what a setup leaves out is the service's own, not that of the setup before
    assert first["quality"]["scallop_height_mm"] == 0.4 and third["quality"]["scallop_height_mm"] == 0.01
    assert third["stock"] == {"kind": "part_offset", "margin_mm": 1} and third["material"] == "Ti-6Al-4V"
    assert third["machine"] == {"kind": "3-axis", "dialects": ["linuxcnc"]} and third["labels"] == {}
