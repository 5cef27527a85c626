"""Setup sheet of a job, as a web page and as a PDF: what planner and machinist need before the spindle turns.

Both are made of one ``service.setup_sheet.model.SetupSheet``, so their contents agree. The sheet holds no line of a
program, and an unproved job is marked first of all. It has no clock and no random number: the same input gives the
same bytes.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from geometry.mesh import F64, TriangleMesh
from geometry.setup_frame import SetupFrame
from geometry.tool_body import ToolBody
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_header import lowest_tip
from output.gcode.program_writer import label_number
from output.workplan import Workplan
from service.delivery.result_files import Files, listed
from service.delivery.written_program import WrittenProgram
from service.pictures.clamping_picture import Clamped, bar_mesh, box_mesh, clamp_picture, corners_of
from service.pictures.tool_drawing import draw_tool, svg_of
from service.setup_sheet.model import Block, Facts, Lines, Picture, SetupSheet, SheetSection, Table, ToolCard
from service.setup_sheet.pdf import pdf_of
from service.setup_sheet.tables import (
    NONE,
    cautions_section,
    files_table,
    findings_section,
    job_section,
    kind_words,
    number,
    place,
    proof_section,
    remainder_table,
    steps_table,
    tools_table,
    zones_table,
)
from service.stages.access_plan import ProofFrame
from service.stages.job_inputs import JobInputs
from service.stages.preparation import Prepared
from service.stages.programs import access_of, proof_frame
from toolpath.workingsteps import Workingstep

ZONE_WORDS = (
    "A zone is the area that one tool finishes along one tool axis. SCZI: on, over or under a connection of walls; "
    "SCZ: elsewhere.",
    "Scallop: height of the material that stays between two passes, mm; as requested, the value that 99 % of the "
    "samples keep, and the largest.",
    "Covered: share of the zone that the proof measured within tolerance.")
HTML_NAME, PDF_NAME = "sheet.html", "sheet.pdf"


def sheet_files(ready: Prepared, written: Sequence[WrittenProgram], report: Mapping[str, Any], files: Files,
                clampings: Sequence[bytes]) -> Files:
    """Both forms of the sheet of a job.

    written   : the programs; of an unproved job the sheet gives only their heights
    files     : the other files of the job; the sheet shows its deviation map
    clampings : of ``clamp_pictures`` for the same programs

    Raises
    ------
    OutputError
        Code 'bad_epoch': SOURCE_DATE_EPOCH is no number.
    """
    sheet = sheet_of(ready, written, {**report, "files": listed(files)}, _bytes_of(files, "deviation"),
                     clampings)
    return {HTML_NAME: ("sheet", "", None, html_of(sheet)), PDF_NAME: ("sheet", "", None, pdf_of(sheet))}


def _bytes_of(files: Files, kind: str) -> bytes | None:
    return next((data for of, _, _, data in files.values() if of == kind and isinstance(data, bytes)), None)


def sheet_of(ready: Prepared, written: Sequence[WrittenProgram], report: Mapping[str, Any],
             deviation: bytes | None, clampings: Sequence[bytes]) -> SetupSheet:
    """The sheet of a job.

    deviation : PNG of the deviation map, or None
    clampings : of ``clamp_pictures``
    """
    inputs = ready.inputs
    proved = report["state"] == "proved"
    count = sum(report["finding_counts"].values())
    verdict = ("The programs were simulated, and the proof has no finding." if proved else
               f"Nothing may be run: the proof has {count} finding{'' if count == 1 else 's'}, and no program was "
               "written. The sheet describes the plan.")
    title = inputs.labels.get("order") or "zonemill job"
    findings = findings_section(report)
    sections = [job_section(report, inputs), *([] if proved else [findings]),
                cautions_section(report), *_clampings(ready, written, report, clampings),
                _tools(inputs, report), _steps(inputs, written, report),
                SheetSection("zones", "Zones", (zones_table(report), Lines("How to read it", ZONE_WORDS))),
                SheetSection("remainder", "Remainder", (remainder_table(report),)), *([findings] if proved else []),
                proof_section(report), SheetSection("files", "Files", (files_table(report),))]
    if deviation is not None:
        sections.append(SheetSection("deviation", "Deviation from the part", (Picture(
            deviation, "The part coloured by the measured deviation: red where it is cut too deep, green within "
            "tolerance, blue where stock is left, hatched where no tool reached."),)))
    sha = report["inputs"]
    foot = f"{report['state']}; part {sha['part_sha256'][:16]}, setup {sha['setup_sha256'][:16]}; {title}"
    return SetupSheet(f"Setup sheet: {title}", proved, verdict, foot, tuple(sections))


def clamp_pictures(ready: Prepared, written: Sequence[WrittenProgram]) -> list[bytes]:
    """Pictures of the clampings of a job, as PNG, in the order of the sheet; ``written`` : the programs."""
    frames = _frames(ready, written)
    return [clamp_picture(_clamped(ready, f), f"{f.id if len(frames) > 1 else 'Clamping'}: seen from the front right")
            for f in frames]


def _frames(ready: Prepared, written: Sequence[WrittenProgram]) -> list[ProofFrame]:
    """The frame of each clamping of the part, or of the first access where nothing is cut."""
    names = list(dict.fromkeys(p.access for p in written)) or [ready.views[0].id]
    return [proof_frame(ready)] if ready.inputs.turns else [ProofFrame.of(ready.view(n)) for n in names]


def _clamped(ready: Prepared, frame: ProofFrame) -> Clamped:
    inputs, turns = ready.inputs, ready.inputs.turns
    return Clamped(frame.part, _blank_mesh(ready, frame.rotation), not ready.blank.stands_alone,
                   tuple(corners_of(box) @ frame.rotation.T for box in inputs.fixtures),
                   access_of(ready, frame).work_offset,
                   tuple((v.id, frame.rotation @ v.direction) for v in ready.views if turns or v.id == frame.id))


def _clampings(ready: Prepared, written: Sequence[WrittenProgram], report: Mapping[str, Any],
               pictures: Sequence[bytes]) -> list[SheetSection]:
    """One section for each clamping of the part, or for the first access where nothing is cut."""
    frames = _frames(ready, written)
    return [_clamping(ready, frame, [p for p in written if len(frames) == 1 or p.access == frame.id], report,
                      len(frames) > 1, picture) for frame, picture in zip(frames, pictures, strict=True)]


def _clamping(ready: Prepared, frame: ProofFrame, programs: Sequence[WrittenProgram], report: Mapping[str, Any],
              several: bool, picture: bytes) -> SheetSection:
    inputs, turns = ready.inputs, ready.inputs.turns
    held, offset = _clamped(ready, frame), access_of(ready, frame).work_offset
    names, listed_names = [n for p in programs for _, n, _ in p.files()], {f["name"] for f in report["files"]}
    blank = ready.blank.corners(frame.rotation)
    axes = frame.rotation @ _setup_axes(inputs.placement)
    frame_name = "the frame of the setup" if turns else f"the frame of access {frame.id}"
    pairs = [
        ("Programs", ", ".join(n for n in names if n in listed_names) or "none written"),
        ("Work offset", offset),
        ("Program zero", f"{place(inputs.placement.origin)} in the coordinates of the part's file, in which X of the "
                         f"program is {_direction(axes[0].tolist())} and Z is {_direction(axes[2].tolist())}"),
        *([] if turns else [("Tool axis", f"{frame.id}: {_direction(frame.rotation[2].tolist())} of the setup is Z of "
                                          "the program")]),
        ("Part", f"{_box(frame.part.bounds)} in {frame_name}"),
        (f"Blank, {inputs.stock.kind.replace('_', ' ')}", _box(blank) + _round(ready, frame.rotation) + (
            "" if ready.blank.stands_alone else f": the part grown by {number(ready.blank.margin)}") + (
            f"; the real one may stand {number(ready.blank.uncertainty)} beyond" if ready.blank.uncertainty else "")),
        *_heights([p.work for p in programs])]
    blocks: list[Block] = [Picture(picture, _seen(held, blank)), Facts(tuple(pairs))]
    if turns:
        blocks.append(_turned(report, (inputs.machine.kinematics or "")[-2:]))
    fixtures = tuple((f"fixture {k}", *(f"{number(a)} to {number(b)}" for a, b in zip(*box.tolist(), strict=True)))
                     for k, box in enumerate((np.array([c.min(axis=0), c.max(axis=0)]) for c in held.fixtures), 1))
    blocks.append(Table("Fixtures: boxes in the frame of the program that nothing may touch, mm",
                        ("fixture", "X", "Y", "Z"), fixtures, (1.0, 1.5, 1.5, 1.5),
                        none="The setup names no fixture, so the programs keep clear of none."))
    title = f"Clamping and program zero, {frame.id}" if several else "Clamping and program zero"
    return SheetSection(f"clamping-{frame.id}", title, tuple(blocks))


def _setup_axes(placement: SetupFrame) -> F64:
    """(3, 3) float64, dimensionless: unit axes of the setup frame as rows, in coordinates of the part's file."""
    x, z = (np.array(v) / np.linalg.norm(v) for v in (placement.x_axis, placement.z_axis))
    return np.array([x, np.cross(z, x), z])


def _round(ready: Prepared, rotation: F64) -> str:
    """Diameter of a round blank and the middles of its ends in a frame; '' for other blanks."""
    bar = ready.blank.bar
    if bar is None:
        return ""
    low, high = (place(end) for end in bar.ends(rotation).tolist())
    return f": Ø{number(2.0 * bar.radius)} from {low} to {high}"


def _seen(held: Clamped, blank: F64) -> str:
    fixtures = f", {len(held.fixtures)} fixtures" if held.fixtures else ""
    return (f"Part in its blank{fixtures}, program zero {held.zero} with its axes, and tool axes "
            f"{', '.join(name for name, _ in held.comings)}; oblique view and top view. The blank spans {_box(blank)}.")


def _heights(works: Sequence[Workplan]) -> list[tuple[str, str]]:
    """Heights of one clamping from the headers of its programs: where rapids are free, and how deep the tip goes."""
    if not works:
        return []
    low, work = min(map(lowest_tip, works)), works[0]
    below = float(work.stock.lower[2]) - low
    deep = f"Z{number(low)}" + (f", {number(below)} below the blank: keep this room free" if below > 1e-3 else "")
    if work.clamping is None:
        return [("Clearance plane", f"Z{number(work.clearance_plane)}: above it rapids in X and Y are free"),
                ("Lowest Z of the tip", deep)]
    c = work.clamping
    ball = f"the ball round {place(c.centre.tolist())} of radius {number(c.radius)}"
    return [("Room to turn", f"part, blank and fixtures lie in {ball}; the tool turns outside it"),
            ("Lowest Z of the tip", deep)]


def _turned(report: Mapping[str, Any], letters: str) -> Table:
    rows = tuple((a["id"], _direction(a["axis"]), " ".join(
        letter + number(v) for letter, v in zip(letters, a["rotary_deg"] or (), strict=False)) or NONE,
                  "found, for the area that the others leave" if a["found"] else "setup") for a in report["accesses"])
    return Table("Accesses: tool axes in the frame of the setup, and the rotary axes for each",
                 ("access", "tool axis", "rotary axes, deg", "origin"), rows,
                 (1.0, 2.5, 2.5, 2.0))


def _direction(axis: Sequence[float]) -> str:
    """'+Z', or three components."""
    for k, letter in enumerate("XYZ"):
        if all(abs(v) < 1e-9 for j, v in enumerate(axis) if j != k):
            return ("+" if axis[k] > 0.0 else "-") + letter
    return " ".join(number(v, 6) for v in axis)


def _box(box: F64) -> str:
    return ", ".join(f"{axis} {number(a)} to {number(b)}" for axis, a, b in zip("XYZ", *box.tolist(), strict=True))


def _blank_mesh(ready: Prepared, rotation: F64) -> TriangleMesh:
    """The nominal blank in a frame; for a blank grown from the part the box around it."""
    blank = ready.blank
    solid = blank.proof_mesh(rotation)
    if solid is not None:
        return solid
    if blank.bar is not None:
        low, high = blank.bar.ends(rotation)
        return bar_mesh(low, high, blank.bar.radius)
    return box_mesh(corners_of(blank.bounds) @ rotation.T)


def _tools(inputs: JobInputs, report: Mapping[str, Any]) -> SheetSection:
    used = list(dict.fromkeys(s["tool"] for s in report["steps"]))
    bodies, gauges = {b.id: b for b in inputs.bodies}, inputs.gauge_lengths
    cards = [_card(inputs, bodies[name], gauges[bodies[name].number], report) for name in used]
    return SheetSection("tools", "Tools", (tools_table(report, inputs, used), *cards))


def _card(inputs: JobInputs, body: ToolBody, gauge: float, report: Mapping[str, Any]) -> ToolCard:
    tool = next(t for t in inputs.tools if t.id == body.id)
    fact = next(t for t in report["tools"] if t["id"] == body.id)
    segments = tuple((f"Holder {k}", f"Ø{number(h.diameter)}" + (
        f" to {number(h.diameter_top)}" if h.diameter_top != h.diameter else "") + f", {number(h.length)} long")
        for k, h in enumerate(body.holder, 1)) or (("Holder", "not given in the setup, so not kept clear of"),)
    bends = fact["deflection_mm"]
    pairs = (
        ("Teeth", f"{tool.flutes}, {'cuts' if tool.center_cutting else 'does not cut'} to the centre"), *segments,
        ("Gauge length", number(gauge) + ("" if tool.gauge_given else ": stickout and holder, none is given")),
        ("Slenderness", number(fact["slenderness"], 1)),
        ("Deflection", "not estimated" if bends is None else f"{number(bends)} mm at most, estimated"),
        ("In cut", f"{number(fact['minutes_in_cut'], 2)} min, {number(fact['metres_in_cut'], 2)} m"),
        ("Cutters", f"{fact['cutters']}" + (f", each lasts {number(fact['life_min'])} min in cut" if fact["life_min"]
                                            else ", tool life not given")))
    mind = tuple(f"{c['message']}; {c['remedy']}" for c in report["warnings"] if body.id in c["subjects"])
    own = "" if body.id == f"T{body.number}" else f" {body.id}"
    heading = f"T{body.number}{own}: {kind_words(tool.kind, tool.taper_angle_deg)} Ø{number(tool.diameter_mm)}"
    return ToolCard(heading, draw_tool(body, gauge), Facts(pairs), mind)


def _steps(inputs: JobInputs, written: Sequence[WrittenProgram], report: Mapping[str, Any]) -> SheetSection:
    planned, labels, programs = {}, {}, {}
    for p in written:
        for s in p.work.steps:
            if len(written) > 1 and report["state"] == "proved":
                programs[s.id] = f"program{p.end}"
            planned[s.id] = (s.access or p.access, s.top, s.bottom)
            if p.work.restart and report["state"] == "proved":
                labels[s.id] = _label(p, s)
    table = steps_table(report, planned, labels, programs, {b.id: b.number for b in inputs.bodies})
    note = "Heights are in the frame of the program, or along the tool axis where it is tilted."
    words = "A program can start at the label of any step when all steps before it have been cut."
    begun = (words,) if labels else ()
    return SheetSection("steps", "Steps", (table, Lines("How to read it", (note, *begun))))


def _label(program: WrittenProgram, step: Workingstep) -> str:
    """The label of a step on each control; equal labels once."""
    labels = (DIALECTS[d](Switches()).label(step.id, label_number(program.work, step))[0].rstrip(":")
            for d, _, _ in program.files())
    return ", ".join(dict.fromkeys(labels))


@cache
def _template() -> Template:
    env = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined,
                      trim_blocks=True, lstrip_blocks=True)
    env.filters["svg"] = svg_of
    env.filters["data"] = lambda png: "data:image/png;base64," + base64.b64encode(png).decode()
    return env.get_template("template.html")


def html_of(sheet: SetupSheet) -> bytes:
    """The sheet as one page that loads nothing else; every text of the user is escaped."""
    return (_template().render(sheet=sheet).rstrip() + "\n").encode()


__all__ = ["HTML_NAME", "PDF_NAME", "clamp_pictures", "html_of", "sheet_files", "sheet_of"]
