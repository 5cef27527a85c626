"""The setup sheet of a plan made by hand: all that the report says, in both forms, and nothing it must not say."""

from __future__ import annotations

import html
import json
import re
import zlib
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from geometry.errors import OutputError
from geometry.part import FaceInfo, Part
from service.delivery.result_files import Files
from service.delivery.written_program import WrittenProgram
from service.from_wire import parse_setup
from service.pictures.clamping_picture import box_mesh, corners_of
from service.setup_sheet.model import Facts, SetupSheet, SheetSection
from service.setup_sheet.pdf import latin, pdf_of
from service.setup_sheet.setup_sheet import clamp_pictures, sheet_files
from service.setup_sheet.tables import needed
from service.stages.blank_model import blank_of
from service.stages.job_inputs import JobInputs
from tests.synthetic_plan import plan, step
from toolpath.workingsteps import Workingstep
from zones.reach.access_view import access_rotation, turned

HOSTILE = "<script>alert('Ø')</script> & \"4711\""
FACES = " ".join(f"F{k}" for k in range(1, 900))
SETUP = {
    "tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 9, "neck_diameter_mm": 2.8,
               "life_min": 20, "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 45, "gauge_length_mm": 81,
               "holder": [{"diameter_mm": 20, "length_mm": 30}]},
              {"id": "rougher", "number": 7, "kind": "bull", "diameter_mm": 8, "corner_radius_mm": 1,
               "stickout_mm": 50},
              {"id": "T9", "kind": "flat", "diameter_mm": 2}],
    "stock": {"kind": "box", "box_mm": [[-1, -2, -3], [41, 22, 14]]},
    "fixtures": [{"box_mm": [[-20, 0, -3], [-5, 20, 2]]}],
    "placement": {"origin_mm": [1.5, 0, 7]}, "labels": {"order": HOSTILE, "customer": "Müller → 漢"}}


class Page(HTMLParser):
    """Tags with their attributes, and the text between them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def pdf_text(data: bytes) -> str:
    """All that is shown as text, in the order it stands in the file."""
    out = []
    for stream in re.findall(rb"stream\r?\n(.*?)\nendstream", data, re.DOTALL):
        try:
            page = zlib.decompressobj().decompress(stream)  # what may stand between its end and the next word is left
        except zlib.error:
            continue
        for shown in re.findall(rb"\(((?:[^()\\]|\\.)*)\) Tj", page):
            out.append(re.sub(rb"\\(.)", rb"\1", shown).decode("latin-1"))
    return " ".join(" ".join(out).split())


def steps() -> tuple[Workingstep, ...]:
    from service.from_wire import tool_bodies
    one, two, _ = tool_bodies(parse_setup(json.dumps(SETUP)))
    return (step(1, two, "depth_layers", zone=None, faces=(), z=8.0), step(2, one, "waterline", zone="Z1"),
            step(3, one, "zigzag", zone="Z2", z=-4.0))


def report_of(state: str, findings: list[dict[str, Any]]) -> dict[str, Any]:
    zones = [{"id": f"Z{k}", "kind": "SCZ", "profile": "C4", "level": "simple", "access": "A1", "tool": "T1",
              "form": "steep", "strategy": "waterline", "area_mm2": 10.0 * k,
              "faces": FACES.split() if k == 2 else ["F12"],
              "scallop_mm": {"requested": 0.0125, "p50": None, "p99": 0.0117, "max": 0.0119}, "coverage": 0.99999,
              "steps": [f"S0{k + 1}"], "machining_time_s": 66.0} for k in (1, 2)]
    return {
        "state": state, "labels": SETUP["labels"], "inputs": {"part_sha256": "ab" * 32, "setup_sha256": "cd" * 32},
        "part": {"bbox_mm": [[0, 0, 0], [40, 20, 13]], "warnings": ["hot ; cool", "a face was mended"]},
        "time": {"in_cut_s": 600.0, "in_air_s": 60.0, "rapid_s": 6.0, "retracts": 17, "tool_changes": 1},
        "machining_time_s": 660.0, "coverage": 0.98765, "reach_coverage": 1.0, "gouge_max_mm": 0.0031,
        "proof": {"samples": 31415, "error_bound_mm": 0.002, "cutting_length_mm": 2718.0,
                  "notes": ["a note of the proof"],
                  "assumed": [{"what": "between_samples", "value": 0.25, "effect": "a narrow gouge may be missed",
                               "remedy": "verify a piece"}]},
        "steps": [{"id": s.id, "name": "S01 layers rougher Z1 Z2" if s.zone is None else s.name, "zone": s.zone,
                   "tool": s.tool.id, "operation": s.operation, "strategy": s.strategy, "spindle_rpm": 12000.0,
                   "feed_mm_min": 600.0 + k, "machining_time_s": 222.0, "fresh_cutter": k == 2}
                  for k, s in enumerate(steps())],
        "zones": zones, "findings": findings, "finding_counts": {"gouge": 3} if findings else {}, "accesses": [],
        "remainder": [
            {"reason": "gap", "area_mm2": 4.56, "faces": ["F7"], "at_mm": [1.0, 2.0, 3.0], "tool_at_hand": None,
             "why_left": None, "would_need": {"kind": "ball", "diameter_mm": 0.8, "corner_radius_mm": 0.4,
                                              "neck_length_mm": 14, "shank_diameter_mm": 4, "stickout_mm": 18,
                                              "share": 0.7}},
            {"reason": "pass", "area_mm2": 0.12, "faces": ["F8"], "at_mm": [1.0, 2.0, 3.0], "tool_at_hand": "T1",
             "why_left": "no pass gets there", "would_need": {}},
            {"reason": "undercut", "area_mm2": 9.0, "faces": ["F9"], "at_mm": [1.0, 2.0, 3.0], "tool_at_hand": None,
             "why_left": None, "would_need": {"kind": "other process", "slenderness": 22.5, "access": "A1"}}],
        "warnings": [{"kind": "tool_life", "subjects": ["T1", "S03"], "message": "T1 lasts for 20 min", "remedy":
                      "have 2 cutters at hand", "measured": 25.0, "limit": 20.0, "at_mm": None}],
        "tools": [{"id": t, "number": n, "minutes_in_cut": m, "metres_in_cut": 0.5 * m, "life_min": life, "cutters": c,
                   "slenderness": 7.1, "deflection_mm": None if t == "T9" else 0.0231}
                  for t, n, m, life, c in (("T1", 1, 25.125, 20.0, 2), ("rougher", 7, 9.5, None, 1),
                                           ("T9", 9, 0.0, None, 0))],
        "version": "0.1.0"}


def block() -> Part:
    """40 x 20 x 13 mm."""
    mesh = box_mesh(corners_of(np.array([[0.0, 0.0, 0.0], [40.0, 20.0, 13.0]])))
    faces = tuple(FaceInfo(n, "plane", 1.0, False, 0.0, 0.0) for n in range(1, 7))
    return Part(mesh, faces, (), mesh.volume, mesh.bounds, "mm", 0.01, 0.2, 0.0, (), "ab" * 32)


def made(state: str = "proved", findings: list[dict[str, Any]] | None = None, cut: bool = True) -> dict[str, bytes]:
    setup, part = parse_setup(json.dumps(SETUP)), block()
    view = SimpleNamespace(id="A1", rotation=np.eye(3), part=part, direction=np.array([0.0, 0.0, 1.0]))
    ready = SimpleNamespace(inputs=JobInputs.of(setup), part=part, blank=blank_of(setup, part), views=(view,),
                            accesses=setup.access, view=lambda _name: view)
    work = plan(*steps(), restart=True)
    report = report_of(state, findings or [])
    if not cut:
        report |= {"steps": [], "zones": [], "tools": [{**t, "cutters": 0} for t in report["tools"]]}
    files: Files = {"zones.json": ("zones", "", None, b"{}")}
    if state == "proved":
        files["program.linuxcnc.ngc"] = ("program", "linuxcnc", "A1", b"G21\n")
    written = [WrittenProgram("A1", work, "G21 (not to be seen)\n")] if cut else []
    got = sheet_files(ready, written, report, files, clamp_pictures(ready, written))  # type: ignore[arg-type]
    assert {name: f[0] for name, f in got.items()} == {"sheet.html": "sheet", "sheet.pdf": "sheet"}
    return {name: data for name, (*_, data) in got.items() if isinstance(data, bytes)}


GOUGE = {"kind": "gouge", "message": "T1 cuts 0.2 mm into the part", "line": 77, "program": "program.linuxcnc.ngc",
         "zone": "Z1", "face": "F12", "point": [1.0, 2.0, 3.0], "count": 5, "depth": 0.2, "limit": 0.01}


@pytest.fixture(scope="module")
def proved() -> dict[str, bytes]:
    return made()


@pytest.fixture(scope="module")
def unproved() -> dict[str, bytes]:
    return made("unproved", [GOUGE])


def both(sheet: dict[str, bytes]) -> list[str]:
    """The text of the page and that of the PDF."""
    return [" ".join(" ".join(Page(sheet["sheet.html"].decode()).words).split()), pdf_text(sheet["sheet.pdf"])]


def test_all_that_the_report_names_is_on_both(proved):
    wanted = [
        "PROVED", "S01", "S02", "S03", "N100", "N200", "N300", "Z1 Z2", "T7 rougher", "T9", "not used", "fresh cutter",
        "12000", "600", "601", "602", "3.7", "11 min as simulated", "98.76 %", "99.99 %", "0.0125", "0.0117", "0.0119",
        "F12", "F899", "4.56", "ball Ø0.8, neck 14, shank Ø4, stickout 18, for 70 % of it",
        "no pass gets there, T1 would",
        "another process, as a tool would be 22.5 times as long as", "G54", "X1.5 Y0 Z7", "Z25", "Z-4",
        "4 below the blank",
        "X -1 to 41, Y -2 to 22, Z -3 to 14", "X 0 to 40, Y 0 to 20, Z 0 to 13", "fixture 1", "-20 to -5",
        "T1 lasts for 20 min", "have 2 cutters at hand", "a face was mended", "a note of the proof",
        "between samples", "0.25", "a narrow gouge may be missed", "verify a piece", "abababababababab",
        "cdcdcdcdcdcdcdcd", "25.12", "Ø2.8", "81 gauge length", "0.0031 mm", "The proof has no finding",
        "program.linuxcnc.ngc", "31415", "Ti-6Al-4V"]
    for text in both(proved):
        assert [w for w in wanted if w not in text] == []
        assert "not to be seen" not in text and "UNPROVED" not in text


def test_a_tapered_mill_has_its_angle_in_table_heading_and_drawing(monkeypatch):
    cone = {**SETUP["tools"][0], "kind": "tapered_ball", "diameter_mm": 1, "taper_angle_deg": 3, "flute_length_mm": 12,
            "neck_diameter_mm": 2.1}
    monkeypatch.setitem(SETUP, "tools", [cone, *SETUP["tools"][1:]])
    for text in both(made()):
        assert [w for w in ("T1: tapered ball 3° Ø1", "3° side", "Ø2.2068 cone", "Ø1 tip") if w not in text] == []
        assert text.count("tapered ball 3°") >= 2
    need = {"kind": "tapered_bull", "diameter_mm": 2, "corner_radius_mm": 0.4, "taper_angle_deg": 1.5,
            "neck_length_mm": 14, "shank_diameter_mm": 4, "stickout_mm": 18}
    assert needed({"why_left": None, "tool_at_hand": None, "would_need": need}) == \
        "tapered bull 1.5° Ø2 R0.4, neck 14, shank Ø4, stickout 18"


def test_what_users_write_stays_text(proved):
    page = Page(proved["sheet.html"].decode())
    assert not [t for t, _ in page.tags if t == "script"]
    escaped = html.escape(HOSTILE).replace("&#x27;", "&#39;").replace("&quot;", "&#34;")
    assert escaped in proved["sheet.html"].decode()
    text, pdf = both(proved)
    assert HOSTILE in text and "Müller → 漢" in text and "Müller ? ?" in pdf


def test_the_page_asks_for_nothing_and_can_be_heard(proved):
    page = Page(proved["sheet.html"].decode())
    for tag, attributes in page.tags:
        assert tag not in ("link", "script", "iframe", "object", "form")
        for name in ("src", "href"):
            assert (attributes.get(name) or "#").startswith(("#", "data:image/png;base64,"))
        if tag == "img":
            assert len(attributes["alt"] or "") > 40
        if tag == "svg":
            assert attributes["role"] == "img" and attributes["aria-label"]
        if tag == "th":
            assert attributes["scope"] in ("row", "col")
    assert ("html", {"lang": "en"}) in page.tags and "url(" not in proved["sheet.html"].decode()


def test_the_same_job_gives_the_same_bytes(proved, monkeypatch):
    assert made() == proved
    assert b"/CreationDate (D:19700101000000Z)" in proved["sheet.pdf"]
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    again = made()
    assert again["sheet.html"] == proved["sheet.html"] and b"D:20231114221320Z" in again["sheet.pdf"]
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(OutputError) as caught:
        made()
    assert caught.value.code == "bad_epoch"


def test_an_unproved_job_says_so_and_why(unproved):
    for text in both(unproved):
        assert "UNPROVED Nothing may be run: the proof has 3 findings, and no program was written." in text
        assert "T1 cuts 0.2 mm into the part" in text and "line 77" in text and "2 more are counted only" in text
        assert "none written" in text and "N100" not in text and "not to be seen" not in text
        assert text.index("T1 cuts 0.2") < text.index("Program zero")
    large = Page(unproved["sheet.html"].decode())
    assert ("p", {"class": "verdict unproved"}) in large.tags


def test_a_job_that_cuts_nothing_has_a_sheet_too():
    for text in both(made("unproved", [{**GOUGE, "kind": "nothing_cut", "line": 0, "program": "", "point": None}],
                          cut=False)):
        assert "nothing could be cut" in text and "No zone" in text and "T9" in text


def test_a_part_that_is_turned_by_hand_is_shown_as_it_lies_each_time():
    setup = parse_setup(json.dumps({**SETUP, "access": [{"id": "A1"}, {"id": "A2", "direction": [-1, 0, 0],
                                                                       "work_offset": "G55"}]}))
    part = block()
    views = {}
    for access in setup.access:
        turn = access_rotation(access.direction)
        views[access.id] = SimpleNamespace(id=access.id, rotation=turn, part=turned(part, turn), direction=turn[2])
    ready = SimpleNamespace(inputs=JobInputs.of(setup), part=part, blank=blank_of(setup, part),
                            views=tuple(views.values()), accesses=setup.access, view=lambda name: views[name])
    first, second, third = steps()
    written = [WrittenProgram("A1", plan(first), "G21\n"),
               WrittenProgram("A2", plan(second, clearance_plane=33.0), "G21\n", ".A2"),
               WrittenProgram("A2", plan(third, clearance_plane=33.0), "G21\n", ".A2.part2")]
    report = report_of("proved", [])
    files: Files = {name: ("program", "linuxcnc", p.access, b"G21\n") for p in written for _, name, _ in p.files()}
    for name, (*_, data) in sheet_files(ready, written, report, files, clamp_pictures(ready, written)).items():  # type: ignore[arg-type]
        text = " ".join(" ".join(Page(data.decode()).words).split()) if name.endswith("html") else pdf_text(data)
        standing = text.split("Clamping and program zero, A2")[-1]
        assert "-X of the setup is Z of the program" in standing and "X of the program is +Y and Z is -X" in standing
        assert "X 0 to 20, Y -13 to 0, Z -40 to 0 in the frame of access A2" in standing and "G55" in standing
        assert "program.A2.linuxcnc.ngc, program.A2.part2.linuxcnc.ngc" in standing and "Z33" in standing
        assert "Z25" not in standing.split("Tools in order of use")[0]
        rows = "".join(text.split("Steps in the order they are run")[1].split())
        assert all(f"{s.id}program{p.end}{s.zone or 'Z'}" in rows for p in written for s in p.work.steps)


def test_each_control_has_its_own_label():
    setup, part = parse_setup(json.dumps(SETUP)), block()
    view = SimpleNamespace(id="A1", rotation=np.eye(3), part=part, direction=np.array([0.0, 0.0, 1.0]))
    ready = SimpleNamespace(inputs=JobInputs.of(setup), part=part, blank=blank_of(setup, part), views=(view,),
                            accesses=setup.access, view=lambda _name: view)
    for others, told in (({"haas": "", "siemens": ""}, "N200, STEP_S02"), ({"siemens": "", "heidenhain": ""},
                         'N200, STEP_S02, LBL "S02"'), ({"haas": ""}, "N200")):
        written = [WrittenProgram("A1", plan(*steps(), restart=True), "G21\n", dialect="fanuc", others=others)]
        files: Files = {name: ("program", d, "A1", b"G21\n") for d, name, _ in written[0].files()}
        got = sheet_files(ready, written, report_of("proved", []), files, clamp_pictures(ready, written))  # type: ignore[arg-type]
        words = " ".join(" ".join(Page(got["sheet.html"][3].decode()).words).split())
        assert told in words and ("STEP_S02" in words) == ("STEP" in told)
        assert "when all steps before it have been cut" in words
        assert "N200" in pdf_text(got["sheet.pdf"][3])


def test_the_pdf_is_whole(proved):
    data = proved["sheet.pdf"]
    assert data.startswith(b"%PDF-1.") and data.rstrip().endswith(b"%%EOF")
    start = int(re.findall(rb"startxref\s+(\d+)", data)[-1])
    assert data[start:].startswith(b"xref")
    rows = re.findall(rb"(\d{10}) 00000 n", data[start:])
    for number, row in enumerate(rows, 1):
        assert data[int(row):].startswith(b"%d 0 obj" % number)
    assert data.count(b"/Type /Page\n") >= 4 and data.count(b"/Subtype /Image") >= 1
    assert f"of {data.count(b'/Type /Page' + bytes([10]))}" in pdf_text(data)


def test_a_line_is_cut_where_it_does_not_fit():
    section = SheetSection("job", "Job", (Facts((("W" * 200, "W" * 2000),)),))
    sheet = SetupSheet("W" * 300, True, "fine", "W" * 300, (section,))
    text = pdf_text(pdf_of(sheet))
    assert re.search(r" W{40,110}\.\.\. page 1 of 2", text) and text.count("W") > 2500


def test_what_stands_for_the_number_of_pages_is_nothing_a_user_can_write():
    said = "{nb} \x7f\x7f"
    sheet = SetupSheet(said, True, said, said, (SheetSection("job", "Job", (Facts((("W" * 200, "W" * 2000),)),)),))
    text = pdf_text(pdf_of(sheet))
    assert text.count("{nb}") >= 4 and "page 1 of 2" in text and "page 2 of 2" in text


def test_letters_the_pdf_has_not_are_spelt_out():
    assert latin("Ø8 ±0.1 → Łódź\n漢") == "Ø8 ±0.1 ? Lódz ?"
