"""Small libraries of each format: what becomes of their entries."""

from __future__ import annotations

import io
import json
import zipfile

import openpyxl
import pytest

from geometry.errors import LibraryError
from service.libraries.entry import Source, Unit
from service.libraries.exchange import ImportedLibrary, import_library

MM = Source("library", Unit.MM)


def read(data: bytes | str | dict, source: Source | None = None, wanted: str | None = None) -> ImportedLibrary:
    if isinstance(data, dict):
        data = json.dumps(data)
    return import_library(data.encode() if isinstance(data, str) else data, source or Source("library"), wanted)


def only(library: ImportedLibrary):
    assert len(library.entries) == 1
    return library.entries[0]


def fusion(**more) -> dict:
    item = {"guid": "{a-1}", "type": "ball end mill", "unit": "millimeters", "description": "ball", "product-id": "X 1",
            "geometry": {"DC": 6, "NOF": 2, "LCF": 12, "SFDM": 6, "LB": 40, "OAL": 80, "shoulder-length": 12,
                         "HAND": True},
            "post-process": {"number": 4, "length-offset": 4, "diameter-offset": 4}, **more}
    return {"data": [item], "version": 36}


HSM = """<?xml version="1.0" encoding="{encoding}"?>
<tool-library xmlns="http://www.hsmworks.com/xml/2004/cnc/tool-library" version="14">
 <tool guid="g-1" type="{kind}" unit="{unit}" id="1">
  <description>Planfräser</description><product-id>P-7</product-id>
  <nc number="5" length-offset="15" diameter-offset="5"/><coolant mode="flood"/>
  <body diameter="0.25" corner-radius="0" flute-length="0.75" shoulder-length="1" shaft-diameter="0.25"
        body-length="1.5" overall-length="2.5" number-of-flutes="3" taper-angle="{taper}" tip-diameter="0"/>
  <holder><section diameter="1" length="0"/><section diameter="1.2" length="0.5"/><section diameter="1.2" length="1"/>
   <section diameter="1.5" length="0"/><section diameter="1.5" length="0.25"/></holder>
  <motion spindle-rpm="8000" cutting-feedrate="40" plunge-feedrate="10" feed-mode="per-minute" clockwise="yes"/>
  <presets><preset name="steel"><parameter key="tool_spindleSpeed" value="6000"/>
   <parameter key="tool_feedCutting" value="1016"/></preset></presets>
 </tool>
</tool-library>"""


def hsm(kind: str = "flat end mill", unit: str = "inches", taper: float = 0, encoding: str = "UTF-16") -> bytes:
    return HSM.format(kind=kind, unit=unit, taper=taper, encoding=encoding).encode(encoding)


class TestFusion:
    def test_an_entry_that_states_all_is_taken(self):
        found = only(read(fusion()))
        assert (found.verdict, found.notes) == ("taken", ())
        tool = found.tool
        assert tool.id.startswith("La-1-") and (tool.library_id, tool.number, tool.order_code) == ("{a-1}", 4, "X 1")
        assert (tool.kind, tool.diameter_mm, tool.corner_radius_mm, tool.stickout_mm) == ("ball", 6, 3, 40)

    def test_tapered_mills_state_the_tip_of_their_cone(self):
        geometry = {"DC": 1.872, "RE": 1, "TA": 3.8, "NOF": 2, "LCF": 15, "SFDM": 6, "LB": 40}
        tool = only(read(fusion(type="tapered mill", geometry=geometry))).tool
        assert (tool.kind, tool.diameter_mm, tool.taper_angle_deg) == ("tapered_ball", 2, 3.8)
        geometry = {"DC": 1.0, "RE": 0.2, "TA": 10, "NOF": 2, "LCF": 8, "SFDM": 6, "LB": 40}
        tool = only(read(fusion(type="tapered mill", geometry=geometry))).tool
        assert tool.kind == "tapered_bull" and tool.diameter_mm == pytest.approx(1.0643599, abs=1e-6)

    def test_a_holder_keeps_its_own_unit_and_order(self):
        holder = {"unit": "inches", "segments": [{"height": 0.5, "lower-diameter": 1, "upper-diameter": 1.25},
                                                 {"height": 0, "lower-diameter": 1.25, "upper-diameter": 2},
                                                 {"height": 1, "lower-diameter": 2, "upper-diameter": 2}]}
        tool = only(read(fusion(holder=holder))).tool
        assert [(s.diameter_mm, s.diameter_top_mm, s.length_mm) for s in tool.holder] == [
            (25.4, 31.75, 12.7), (50.8, 50.8, 25.4)]

    def test_a_holder_without_a_stickout_is_left_out(self):
        found = fusion(holder={"segments": [{"height": 5, "lower-diameter": 20, "upper-diameter": 20}]})
        del found["data"][0]["geometry"]["LB"]
        assert "how far the tool stands out" in only(read(found)).reason

    def test_speeds_and_feeds_come_by_material(self):
        presets = [{"name": "A", "material": {"category": "all", "query": "Ti-6Al-4V"}, "n": 3000, "v_f": 240,
                    "v_f_plunge": 80, "tool-coolant": "flood"},
                   {"name": "B", "material": {"category": "all", "query": ""}, "v_c": 100, "f_z": 0.02},
                   {"name": "C", "material": {"category": "all", "query": "Ti-6Al-4V"}, "n": 2000}]
        found = only(read(fusion(**{"start-values": {"presets": presets}})))
        data = found.tool.cutting_data
        assert [(d.material, d.spindle_rpm, d.feed_mm_min) for d in data] == [
            ("Ti-6Al-4V", 3000, 240), (None, pytest.approx(5305.165), pytest.approx(212.207))]
        assert any("'C' are left out" in n for n in found.notes) and found.tool.coolant == "flood"
        assert found.tool.in_material("ti6al4v").feed_mm_min == 240
        assert found.tool.in_material("C45").spindle_rpm == pytest.approx(5305.165)

    def test_a_feed_per_revolution_alone_gets_a_note(self):
        found = only(read(fusion(**{"start-values": {"presets": [{"name": "A", "n": 3000, "f_n": 0.1}]}})))
        assert found.tool.cutting_data[0].feed_mm_min is None
        assert found.notes == ("the feed per revolution of 'A' is left out",)

    def test_inches_and_numbers_that_differ(self):
        found = fusion(unit="inches")
        found["data"][0]["post-process"] |= {"length-offset": 14}
        found["data"][0]["start-values"] = {"presets": [{"n": 1000, "v_f": 10, "v_c": 100}]}
        entry = only(read(found))
        assert entry.tool.diameter_mm == 152.4 and entry.tool.cutting_data[0].feed_mm_min == 254
        assert "the library states H 14 for T 4; programs use 4 for both" in entry.notes

    @pytest.mark.parametrize("kind", ["lollipop mill", "dovetail mill", "slot mill", "probe", "tap left hand", "reamer",
                                      "holder"])
    def test_other_kinds_are_left_out_by_name(self, kind):
        assert only(read(fusion(type=kind))).reason == f"kind '{kind}' is not available"

    def test_a_barrel_of_fusion_is_left_out_for_its_upper_radius(self):
        reason = only(read(fusion(type="circle segment barrel"))).reason
        assert reason == "kind 'circle segment barrel' has an upper radius, which is not available"

    def test_a_profile_of_the_shaft_becomes_a_shank_of_its_widest_diameter(self):
        shaft = {"segments": [{"height": 5, "lower-diameter": 4, "upper-diameter": 8}]}
        found = only(read(fusion(shaft=shaft)))
        assert found.tool.shank_diameter_mm == 8 and found.tool.neck_length_mm == found.tool.flute_length_mm
        assert any("profile of the shaft" in n for n in found.notes)

    def test_a_tools_file_is_a_zip_of_json(self):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            archive.writestr("tools.json", json.dumps(fusion()))
        assert read(out.getvalue()).format.name == "fusion"


class TestHsm:
    def test_lengths_feeds_and_holder_of_a_library_in_inches(self):
        found = only(read(hsm()))
        tool = found.tool
        assert (tool.diameter_mm, tool.flute_length_mm) == (6.35, 19.05)
        assert (tool.neck_length_mm, tool.stickout_mm) == (25.4, 38.1)
        assert [(s.diameter_mm, s.diameter_top_mm, s.length_mm) for s in tool.holder] == [
            (25.4, 30.48, 12.7), (30.48, 30.48, 25.4), (38.1, 38.1, 6.35)]
        assert (tool.cutting_data[0].spindle_rpm, tool.cutting_data[0].feed_mm_min) == (8000, 1016)
        assert tool.description == "Planfräser" and tool.coolant == "flood"
        assert "the library states H 15 for T 5; programs use 5 for both" in found.notes
        assert any("unit is not stated" in n for n in found.notes)

    def test_the_angle_means_another_thing_for_a_drill(self):
        assert only(read(hsm("drill", taper=118))).tool.point_angle_deg == 118
        assert only(read(hsm("chamfer mill", taper=45, encoding="UTF-8"))).tool.point_angle_deg == 90


class TestFreeCad:
    BIT = {"version": 2, "name": "6 mm", "shape": "endmill.fcstd", "attribute": {},
           "parameter": {"Diameter": "6,00 mm", "CuttingEdgeHeight": "20 mm", "Length": "60 mm",
                         "ShankDiameter": "0.25 in", "Flutes": 3}}
    TABLE = {"tools": [{"nr": 7, "path": "Sub/6mm.fctb"}, {"nr": 8, "path": "../../etc/passwd"}], "version": 1}

    def test_a_bit_states_the_unit_of_each_length(self):
        found = only(read(self.BIT, Source("6mm.fctb")))
        assert (found.tool.diameter_mm, found.tool.shank_diameter_mm) == (6, 6.35)
        assert found.tool.library_id == "6mm" and found.tool.number is None

    def test_a_number_without_a_unit_needs_the_unit_of_the_caller(self):
        bit = {**self.BIT, "parameter": {"Diameter": 6}}
        with pytest.raises(LibraryError, match="mm or inches") as error:
            read(bit)
        assert (error.value.code, error.value.subjects) == ("unit_missing", ("entry 1 'library'",))
        assert only(read(bit, MM)).tool.diameter_mm == 6

    def test_a_library_finds_its_bits_beside_it_or_in_its_zip(self):
        asked = []

        def beside(name: str) -> bytes | None:
            asked.append(name)
            return json.dumps(self.BIT).encode() if name == "6mm.fctb" else None

        library = read(self.TABLE, Source("x.fctl", beside=beside))
        assert asked == ["6mm.fctb", "passwd"]
        assert [e.verdict for e in library.entries] == ["noted", "left_out"]
        assert library.tools[0].number == 7 and "send a zip file with both" in library.entries[1].reason
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            archive.writestr("Library/x.fctl", json.dumps(self.TABLE))
            archive.writestr("Bit/6mm.fctb", json.dumps(self.BIT))
        assert read(out.getvalue()).tools == library.tools

    def test_the_taper_angle_is_that_of_the_whole_cone(self):
        bit = {**self.BIT, "shape-type": "TaperedBallNose", "parameter": {
            "Diameter": "2 mm", "TaperAngle": "7.6 °", "CuttingEdgeHeight": "20 mm", "ShankDiameter": "6 mm"}}
        tool = only(read(bit)).tool
        assert (tool.kind, tool.diameter_mm, tool.taper_angle_deg) == ("tapered_ball", 2, 3.8)

    def test_other_shapes_are_left_out(self):
        assert "'SlittingSaw'" in only(read({**self.BIT, "shape-type": "SlittingSaw"})).reason


class TestLinuxCnc:
    TABLE = ("T1 P3 D0.25 Z+1.5 ;1/4 end mill\nT2 P2 D.125;ball nose\n\nT3 D0.2 ;#7 tap drill\nT4 P4 D0.5 ;\n"
             "T5 P5 D0.5 ;lollipop\nT6 P6 D3,5 ;drill\n")

    def test_the_unit_is_asked_for(self):
        with pytest.raises(LibraryError) as error:
            read(self.TABLE)
        assert (error.value.code, error.value.subjects) == ("unit_missing", ("line 1 'T1'",))

    def test_kinds_come_from_the_remarks_with_a_note(self):
        library = read(self.TABLE, Source("tool.tbl", Unit.INCH))
        assert library.format.name == "linuxcnc"
        assert [e.verdict for e in library.entries] == ["noted"] * 3 + ["left_out"] * 3
        assert [(t.id, t.kind, t.diameter_mm, t.number) for t in library.tools] == [
            ("T1", "flat", 6.35, 1), ("T2", "ball", 3.175, 2), ("T3", "drill", 5.08, 3)]
        assert library.entries[0].entry.pocket == 3 and library.tools[0].number == 1
        assert "kind flat is read from the remark '1/4 end mill'" in library.entries[0].notes
        assert any("offsets" in n for n in library.entries[0].notes)
        assert "states no kind" in library.entries[3].reason and "word of a tool table" in library.entries[5].reason


class TestDin4000:
    ROW = "J21;NSM;BLD;A1;G1;B2;B5;C3;F21\n"

    @pytest.mark.parametrize("figure,corner,kind", [("1", "", "flat"), ("1", "0,5", "bull"), ("6", "", "ball")])
    def test_figures_of_list_82(self, figure, corner, kind):
        found = only(read(self.ROW + f"77;DIN4000-82;{figure};6,0;{corner};13;57;6;4\n"))
        assert (found.tool.kind, found.tool.library_id, found.tool.flute_length_mm) == (kind, "77", 13)

    @pytest.mark.parametrize("figure,word", [("5", "T-slot"), ("4", "dovetail"), ("99", "is not read")])
    def test_other_figures_are_left_out(self, figure, word):
        assert word in only(read(self.ROW + f"77;DIN4000-82;{figure};6,0;;13;57;6;4\n")).reason

    def test_a_row_that_is_cut_off_is_left_out(self):
        library = read(self.ROW + "77;DIN4000-82;1;6;0;13;57;6;4\n78;DIN4000-82;1;8\n")
        assert [e.verdict for e in library.entries] == ["noted", "left_out"]
        assert library.entries[1].reason == "the row has 4 of 9 cells; the table is cut off there"

    def test_drills_and_taps(self):
        head = "J21;NSM;BLD;A11;A21;A3;B2;B4;B5;C3;D1;E1\n"
        assert only(read(head + "9;DIN4000-81;1;5;;;;30;80;6;2;140\n")).tool.point_angle_deg == 140
        assert only(read(head + "9;DIN4000-80;2;;6;1;14;;80;6;3;\n")).tool.pitch_mm == 1


class TestNamedParameters:
    HYPER = """<omtdx version="25"><tools folder="a"><tools folder="b"><tool name="R" type="radiusMill">
      <param name="lengthOfUnit" value="mm"/><param name="toolDiameter" value="8"/>{more}
      <param name="cuttingLength" value="10"/><param name="cuttingEdges" value="4"/>
      <param name="toolShaftDiameter" value="8"/><param name="toolTotalLength" value="60"/>
      <tecsets><tecset><param name="lengthOfUnit" value="mm"/><param name="cuttingSpeed" value="100"/>
       <param name="feedratePerEdge" value="0.05"/><param name="material" value="C45"/></tecset></tecsets>
      </tool></tools></tools></omtdx>"""

    def test_hypermill(self):
        corner = '<param name="cornerRadius" value="1"/>'
        neck = ('<param name="collar" value="1"/><param name="tipDiameter" value="7.4"/>'
                '<param name="taperHeight" value="24"/>')
        tool = only(read(self.HYPER.format(more=corner + neck))).tool
        assert (tool.kind, tool.corner_radius_mm, tool.neck_diameter_mm, tool.neck_length_mm) == ("bull", 1, 7.4, 24)
        assert tool.cutting_data[0].material == "C45"
        assert tool.cutting_data[0].feed_mm_min == pytest.approx(795.775, abs=1e-3)
        assert "corner radius" in only(read(self.HYPER.format(more=""))).reason
        tapered = corner + '<param name="tapered" value="1"/>'
        assert "tapered" in only(read(self.HYPER.format(more=tapered))).reason

    def test_solidcam(self):
        text = """<Results><Tools><Tool Type="Milling" SubType="BallNoseMill" UserType="B6">
          <param name="unit" value="{unit}"/><param name="diameter" value="6"/>
          <param name="cutting edge length" value="9"/>
          <param name="shoulder length" value="20"/><param name="shoulder diameter" value="5.8"/>
          <param name="arbor diameter" value="6"/><param name="outside holder length" value="30"/>
          <param name="number of teeth" value="2"/><Spin/><Feed/></Tool></Tools></Results>"""
        found = only(read(text.format(unit="metric")))
        assert (found.verdict, found.tool.id, found.tool.neck_diameter_mm) == ("taken", "B6", 5.8)
        with pytest.raises(LibraryError, match="parsec") as error:
            read(text.format(unit="parsec"))
        assert (error.value.code, error.value.subjects) == ("unknown_unit", ("entry 1 'B6'",))


class TestIso13399:
    TEXT = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('x'),'2;1');FILE_NAME('x','',(''),(''),'','','');
FILE_SCHEMA(('CUTTING_TOOL_SCHEMA_ARM'));
ENDSEC;
DATA;
#1=LANGUAGE($,'eng');
#2=STRING_WITH_LANGUAGE('{name}',#1);
#3=MULTI_LANGUAGE_STRING((),#2);
#4=ITEM(#3,'4711',$);
#5=UNIT('{unit}');
#6=NUMERICAL_VALUE('DC',$,#5,'0.25');
#7=NUMERICAL_VALUE('APMX',$,#5,'0.75');
#8=NUMERICAL_VALUE('DCONMS',$,#5,'0.25');
#9=NUMERICAL_VALUE('RE',$,#5,'0.03');
#10=NUMERICAL_VALUE('ZEFF',$,$,'4');
ENDSEC;
END-ISO-10303-21;
"""

    def test_the_kind_is_read_from_the_description_with_a_note(self):
        found = only(read(self.TEXT.format(name="SOLID END MILL", unit="inch")))
        assert (found.tool.kind, found.tool.diameter_mm, found.tool.corner_radius_mm) == ("bull", 6.35, 0.762)
        assert found.tool.library_id == "4711" and "description" in found.notes[0]
        assert "name no kind" in only(read(self.TEXT.format(name="X 12", unit="mm"))).reason

    def test_a_step_part_is_no_library(self):
        with pytest.raises(LibraryError) as error:
            read(self.TEXT.replace("CUTTING_TOOL_SCHEMA_ARM", "AP214"))
        assert error.value.code == "unknown_format"

    def test_several_items_in_one_file(self):
        with pytest.raises(LibraryError, match="2 items"):
            read(self.TEXT.format(name="END MILL", unit="mm").replace("#5=", "#44=ITEM(#3,'4712',$);\n#5="))


class TestTables:
    def test_heads_in_words_and_units_in_heads(self):
        text = ("Nr;Werkzeugtyp;Durchmesser [mm];Zähne;Schneidenlänge [mm];Schaftdurchmesser [mm];Auskraglänge [mm];"
                "Preis\n")
        library = read(text + '3;Kugelfräser;6,0;2;12;6;40;"12,50"\n')
        tool = only(library).tool
        assert (library.format.name, tool.kind, tool.number, tool.stickout_mm) == ("csv", "ball", 3, 40)
        assert "columns that are not read: Preis" in library.entries[0].notes

    def test_the_unit_of_a_table_is_asked_for(self):
        text = "id,type,diameter,flutes\nA1,flat end mill,6,2\n"
        with pytest.raises(LibraryError) as error:
            read(text)
        assert (error.value.code, error.value.subjects) == ("unit_missing", ("row 2 'A1'",))
        assert only(read(text, MM)).tool.kind == "flat"
        assert only(read(text.replace("flutes", "unit").replace(",2\n", ",inch\n"))).tool.diameter_mm == 152.4

    def test_speeds_of_a_row_with_a_material(self):
        text = "id,kind,diameter_mm,material,rpm,feed_mm_min\nA1,flat,6,C45,5000,900\n"
        data = only(read(text)).tool.cutting_data
        assert [(d.material, d.spindle_rpm, d.feed_mm_min) for d in data] == [("C45", 5000, 900)]

    def test_a_workbook_has_numbers_and_a_title_above_its_heads(self):
        book = openpyxl.Workbook()
        for row in (["Tools of the shop"], [], ["id", "kind", "diameter_mm", "order code"], [4711, "flat", 6.5, 88.0]):
            book.active.append(row)
        out = io.BytesIO()
        book.save(out)
        tool = only(read(out.getvalue())).tool
        assert (tool.library_id, tool.diameter_mm, tool.order_code) == ("4711", 6.5, "88")

    def test_cells_that_look_like_formulas_come_back(self):
        from schemas.tools import Tool
        from service.libraries.exchange import export_library

        tool = Tool(id="T1", kind="flat", diameter_mm=6, description="=1+1")
        for name in ("csv", "xlsx"):
            data = export_library([tool], name).data
            assert b",=1+1" not in data
            assert only(read(data)).tool.description == "=1+1"


def test_camotics():
    library = read({"1": {"units": "imperial", "shape": "Ballnose", "length": 1, "diameter": 0.25},
                    "2": {"units": "metric", "shape": "Snubnose", "length": 1, "diameter": 2}})
    assert (library.format.name, library.tools[0].diameter_mm) == ("camotics", 6.35)
    assert library.entries[1].reason == "shape 'Snubnose' is not available"
