"""Libraries that are cut off, in another encoding, without units, huge or hostile: an error that names the entry."""

from __future__ import annotations

import io
import json
import time
import zipfile
from random import Random

import openpyxl
import pytest

from geometry.errors import LibraryError
from schemas.tools import Tool
from service.libraries import containers, entry
from service.libraries.containers import Archive
from service.libraries.conversion import tool_id_of
from service.libraries.entry import Entry, Source
from service.libraries.exchange import export_library, import_library
from service.libraries.registry import WRITTEN
from tests.unit.service.libraries.test_formats import HSM, fusion, hsm
from tests.unit.service.libraries.test_round_trips import TOOLS

MANY = 10_000


def refused(data: bytes | str, wanted: str | None = None, source: Source | None = None) -> LibraryError:
    with pytest.raises(LibraryError) as error:
        import_library(data.encode() if isinstance(data, str) else data, source or Source("x"), wanted)
    assert error.value.remedy and error.value.message
    return error.value


def packed(files: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return out.getvalue()


class TestCutOff:
    def test_json_names_the_entry(self):
        text = json.dumps({"data": [*fusion()["data"], {**fusion()["data"][0], "guid": "{b-2}"}]})
        error = refused(text[:-20])
        assert (error.code, error.subjects) == ("library_cut_off", ("entry 2 '{b-2}'",))
        error = refused(text.replace('"DC": 6', '"DC": six'))
        assert (error.code, error.subjects) == ("library_not_json", ("entry 1 '{a-1}'",))

    def test_xml_names_the_entry(self):
        one = HSM.format(kind="drill", unit="inches", taper=118, encoding="UTF-8")
        body = one[one.index(" <tool "):one.index("</tool-library>")]
        two = one.replace("</tool-library>", body.replace("g-1", "g-2") + "</tool-library>")
        error = refused(two[:-200])
        assert error.code == "library_cut_off" and error.subjects[0].startswith("entry 2 'g-2', line")
        error = refused(two.replace('"g-2"', "g-2"))
        assert error.code == "library_not_xml" and error.subjects[0].startswith("entry 2")

    @pytest.mark.parametrize("name", ["fusion", "fusion-tools", "hsmlib", "freecad", "din4000", "hypermill", "solidcam",
                                      "xlsx", "zonemill", "iso13399"])
    def test_no_written_library_is_read_when_half_of_it_is_missing(self, name):
        data = export_library(TOOLS, name).data
        refused(data[:len(data) // 2])

    def test_a_part21_file_names_itself(self):
        data = export_library(TOOLS[:1], "iso13399").data
        error = refused(data[:-40], source=Source("EM-1.p21"))
        assert (error.code, error.subjects[0]) == ("library_cut_off", "EM-1.p21")

    def test_a_row_of_a_table_is_left_out_and_a_quote_is_an_error(self):
        data = export_library(TOOLS, "csv").data
        library = import_library(data[:-60], Source("x"))
        assert [e.verdict == "left_out" for e in library.entries] == [False] * (len(TOOLS) - 1) + [True]
        assert "cut off" in library.entries[-1].reason
        assert refused('id,kind,diameter_mm\nA,flat,"6\n').code == "library_cut_off"

    def test_empty_files_and_other_files(self):
        assert refused(b"").code == refused(b" \n").code == refused(b'{"data": []}').code == "empty_library"
        assert refused(b"G21\nG0 X1\nM30\n").code == refused(b"<html/>").code == "unknown_format"
        assert refused(b"\x89PNG\r\n\x1a\n\0\0").code == "library_encoding"


class TestEncodings:
    ROW = "id,kind,diameter_mm,description\nA,flat,6,Schruppfräser\n"

    def test_a_table_in_windows_1252(self):
        data = self.ROW.encode("windows-1252")
        error = refused(data)
        assert (error.code, error.subjects) == ("library_encoding", ("line 2",)) and "Schruppfr" in error.measured
        tool = import_library(data, Source("x", encoding="windows-1252")).tools[0]
        assert tool.description == "Schruppfräser"

    def test_byte_order_marks_and_utf_16(self):
        for encoding in ("utf-8-sig", "utf-16"):
            assert import_library(self.ROW.encode(encoding), Source("x")).tools[0].description == "Schruppfräser"
        for encoding in ("UTF-16", "iso-8859-1"):
            assert import_library(hsm(encoding=encoding), Source("x")).tools

    def test_xml_whose_declaration_is_wrong(self):
        error = refused(hsm().decode("utf-16").replace("UTF-16", "UTF-8").encode("iso-8859-1"))
        assert error.code == "library_not_xml" and error.subjects[0].startswith("entry 1")
        assert refused(hsm().decode("utf-16").replace("UTF-16", "klingon").encode()).code in (
            "library_encoding", "library_not_xml")

    def test_an_encoding_that_is_not_read(self):
        assert refused(self.ROW, source=Source("x", encoding="punycode")).code == "unknown_encoding"


class TestHostile:
    LAUGHS = ('<?xml version="1.0"?><!DOCTYPE omtdx [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
              '<omtdx><tools><tool name="&b;" type="endMill"/></tools></omtdx>')

    @pytest.mark.parametrize("text", [
        LAUGHS, LAUGHS.replace('"ha"', 'SYSTEM "file:///etc/passwd"'),
        '<!DOCTYPE omtdx [<!ENTITY % p SYSTEM "http://x/y.dtd"> %p;]><omtdx/>'])
    def test_xml_with_entities(self, text):
        assert refused(text).code == "xml_entities"

    def test_a_document_type_without_entities_is_read_over(self):
        text = '<!DOCTYPE omtdx SYSTEM "http://nowhere.invalid/x.dtd"><omtdx><tools/></omtdx>'
        assert refused(text).code == "empty_library"

    def test_xml_and_json_nested_deep(self):
        deep = "<omtdx>" + "<a>" * 100_000
        assert refused(deep).code == "library_not_xml"
        assert refused('{"data": ' + "[" * 200_000).code == "library_not_json"

    def test_zip_bombs(self, monkeypatch):
        assert refused(packed({"x.json": b"0" * 50_000_000})).code == "zip_bomb"
        monkeypatch.setattr(containers, "MAX_UNPACKED_BYTES", 1000)
        assert refused(packed({"x.json": b"0" * 600, "y.json": b"1" * 600})).code == "zip_bomb"
        monkeypatch.setattr(containers, "MAX_ZIP_MEMBERS", 3)
        assert refused(packed({f"{k}.json": b"" for k in range(4)})).code == "zip_bomb"

    def test_a_member_that_is_larger_than_it_states(self):
        data = packed({"x.json": b"0" * 5000})
        wrong = data.replace((5000).to_bytes(4, "little"), (50).to_bytes(4, "little"))
        with pytest.raises(LibraryError):
            archive = Archive(wrong)
            archive.read("x.json")

    def test_a_zip_with_two_kinds_of_libraries(self):
        data = packed({"a.json": json.dumps(fusion()).encode(), "b.fctb": b"{}"})
        error = refused(data)
        assert (error.code, error.measured) == ("ambiguous_format", ["fusion", "freecad"])
        assert "--format fusion" in error.remedy and import_library(data, Source("x"), "fusion").tools

    def test_a_workbook_with_entities(self):
        book, out = openpyxl.Workbook(), io.BytesIO()
        book.active.append(["id", "kind", "diameter_mm"])
        book.save(out)
        with zipfile.ZipFile(out) as archive:
            files = {n: archive.read(n) for n in archive.namelist()}
        sheet = files["xl/worksheets/sheet1.xml"]
        files["xl/worksheets/sheet1.xml"] = b'<!DOCTYPE w [<!ENTITY a "ha">]>' + sheet[sheet.index(b"<worksheet"):]
        assert refused(packed(files)).code in ("xml_entities", "library_cut_off")

    def test_numbers_that_are_none(self):
        for word in ("NaN", "Infinity", "1e999"):
            text = json.dumps(fusion()).replace('"DC": 6', f'"DC": {word}')
            try:
                library = import_library(text.encode(), Source("x"))
            except LibraryError as error:
                assert error.code == "library_not_json"
            else:
                assert library.counts["left_out"] == 1
        for value in (True, [6], {"a": 1}, "6 apples", -6):
            found = fusion()
            found["data"][0]["geometry"]["DC"] = value
            library = import_library(json.dumps(found).encode(), Source("x"))
            assert library.counts["left_out"] == 1 and library.entries[0].reason

    @pytest.mark.parametrize("text", ['{"data": [1, null, "x", {}]}', '{"data": [{"type": "drill", "unit": "mm"}]}',
                                      '{"1": {"shape": "Conical", "units": "metric", "diameter": 1}}',
                                      '{"tools": [{"path": 3}, {"path": "x", "nr": "y"}, 7]}',
                                      '{"tools": [{"kind": "flat"}, 3]}',
                                      "<Tool-Data><Tool/></Tool-Data>", "<Results><Tools><Tool/></Tools></Results>",
                                      "<tool-library><tool type='drill' unit='mm'/></tool-library>"])
    def test_entries_that_state_nothing_are_left_out(self, text):
        library = import_library(text.encode(), Source("x"))
        assert library.tools == [] and all(e.reason for e in library.entries)


def mutated(data: bytes, random: Random) -> bytes:
    """A library with some bytes cut out, put in, changed or copied to another place."""
    out = bytearray(data)
    for _ in range(random.randint(1, 5)):
        at, choice = random.randrange(len(out) or 1), random.random()
        if choice < 0.3:
            del out[at:at + random.randint(1, 30)]
        elif choice < 0.6:
            out[at:at] = random.choice([b"null", b"[]", b"-1", b"1e999", b"NaN", b'"x"', b"<a/>", b"\0", b"\xff", b";"])
        elif choice < 0.8 and out:
            out[at] = random.randrange(256)
        else:
            out[at:at] = out[random.randrange(len(out) or 1):][:random.randint(1, 200)]
    return bytes(out)


@pytest.mark.parametrize("name", WRITTEN)
def test_damaged_libraries_give_tools_or_an_error_of_libraries(name):
    data, random = export_library(TOOLS, name).data, Random(name)
    refusals = 0
    for _ in range(150):
        try:
            library = import_library(mutated(data, random), Source("x"))
            assert all((e.tool is None) == bool(e.reason) for e in library.entries)
        except LibraryError as error:
            refusals += 1
            assert error.remedy
    assert refusals > 0


def test_a_zip_file_whose_directory_is_damaged():
    data = packed({"x.json": json.dumps(fusion()).encode()})
    for at in range(0, len(data), 3):
        try:
            import_library(data[:at] + b"\0" + data[at + 1:], Source("x"))
        except LibraryError:
            continue


@pytest.mark.parametrize("text", [
    "T1 " + "A1" * 1_000_000 + "!", "T1 D6 ;" + "kind" * 500_000,
    "id,kind,diameter_mm" + " " * 2_000_000 + "(x\n",
    "id,kind,diameter_mm," + "(" * 2_000_000 + "\n", "<omtdx>" + "<description " * 200_000,
    '{"data": [{"guid": "' + "x" * 3_000_000, "id,kind,diameter_mm\n" + "x" * 100_000 + ",flat,6\n"])
def test_texts_that_are_built_to_be_slow_to_read(text):
    started = time.process_time()
    try:
        import_library(text.encode(), Source("x"))
    except LibraryError as error:
        assert len(error.message) < 1000
    assert time.process_time() - started < 20.0


class TestIdentity:
    def test_an_id_that_occurs_twice_is_left_out_the_second_time(self):
        library = import_library(json.dumps({"data": fusion()["data"] * 2}).encode(), Source("x"))
        assert [e.verdict for e in library.entries] == ["noted", "left_out"]
        assert "is also that of entry 1 '{a-1}'" in library.entries[1].reason
        assert "2 entries have T number 4" in library.entries[0].notes[0]

    def test_ids_that_differ_in_letters_that_are_not_kept_stay_apart(self):
        made = {tool_id_of(Entry("entry 1", library_id=i)) for i in ("a/b", "a b", "a-b ", "a:b", "4711", "L4711",
                                                                       "x" * 40, "x" * 41)}
        assert len(made) == 7  # 4711 and L4711 are told apart by converted() alone
        assert all(len(i) <= 32 and i[0].isalpha() for i in made)

    def test_an_entry_without_an_id_gets_one_of_its_content(self):
        text = "kind,diameter_mm,description\nflat,6,a\nflat,6,b\n"
        library = import_library(text.encode(), Source("x"))
        assert len({t.id for t in library.tools}) == 2
        assert any("states no id" in n for n in library.entries[0].notes)
        assert [t.id for t in import_library(text.encode(), Source("x")).tools] == [t.id for t in library.tools]


@pytest.mark.parametrize("name", ["fusion", *(pytest.param(n, marks=pytest.mark.slow) for n in WRITTEN
                                               if not n.startswith("fusion"))])
def test_ten_thousand_entries_take_seconds(name):
    tools = [Tool(id=f"T{k}", number=k, kind="flat", diameter_mm=6 + k / 10_000, flutes=3, flute_length_mm=18,
                  shank_diameter_mm=8, stickout_mm=40, description=f"end mill {k}") for k in range(1, MANY + 1)]
    started = time.process_time()
    library = import_library(export_library(tools, name).data, Source("x"))
    assert len(library.tools) == MANY and library.tools[-1].diameter_mm == 7.0
    assert time.process_time() - started < 60.0


def test_more_entries_than_the_limit(monkeypatch):
    monkeypatch.setattr(entry, "MAX_ENTRIES", 2)
    assert refused(json.dumps({"data": fusion()["data"] * 3})).code == "too_many_entries"
    assert refused(b"x" * 10, source=Source("x")).code == "unknown_format"
