"""Libraries by others in ../shared/tools/libraries: what is taken of each, and export and import again."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.libraries.entry import Source
from service.libraries.exchange import ImportedLibrary, export_library, import_library
from tests.source_tree import ROOT

FOLDER = next((p for p in (ROOT.parent / "shared" / "tools" / "libraries",
                           ROOT.parent.parent / "shared" / "tools" / "libraries") if p.is_dir()), None)
HELD = {
    # file: format, taken, taken with notes, left out
    "camotics.json": ("camotics", 0, 3, 0), "din4000-82.csv": ("din4000", 0, 1, 0),
    "din4000-82_2013.xml": ("din4000", 0, 1, 0), "din4000-82_2016.xml": ("din4000", 0, 1, 0),
    "hypermill.xml": ("hypermill", 0, 1, 0), "iso13399.p21": ("iso13399", 0, 1, 0),
    "solidcam.xml": ("solidcam", 1, 0, 0)}


@pytest.fixture(params=HELD)
def held(request) -> tuple[str, ImportedLibrary]:
    path = Path(FOLDER or ".") / request.param
    if not path.is_file():
        pytest.skip(f"no {request.param} in ../shared/tools/libraries")
    return request.param, import_library(path.read_bytes(), Source(request.param))


def test_what_is_taken_of_each(held):
    name, library = held
    counts = library.counts
    assert (library.format.name, counts["taken"], counts["noted"], counts["left_out"]) == HELD[name]


@pytest.mark.parametrize("name", ["fusion", "hsmlib", "csv", "xlsx", "zonemill"])
def test_export_and_import_give_the_same_tools(held, name):
    tools = held[1].tools
    assert import_library(export_library(tools, name).data, Source("again")).tools == tools


def test_editions_of_one_list_give_one_tool():
    if FOLDER is None:
        pytest.skip("no libraries in ../shared/tools/libraries")
    found = {import_library((FOLDER / n).read_bytes(), Source(n)).tools[0].model_dump_json()
             for n in HELD if n.startswith("din4000")}
    assert len(found) == 1


def test_dimensions_of_one_article_are_the_same_in_three_systems():
    if FOLDER is None:
        pytest.skip("no libraries in ../shared/tools/libraries")
    tools = [import_library((FOLDER / n).read_bytes(), Source(n)).tools[0]
             for n in ("iso13399.p21", "hypermill.xml", "solidcam.xml")]
    shapes = {(t.kind, t.diameter_mm, t.flute_length_mm, t.shank_diameter_mm, t.flutes, t.order_code) for t in tools}
    assert shapes == {("flat", 6.35, 19.05, 6.35, 4, "6676918")}
