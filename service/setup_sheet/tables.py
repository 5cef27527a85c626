"""The tables of a setup sheet; every figure is one of the report."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from output.header_text import decimal
from service.setup_sheet.model import Facts, Lines, SheetSection, Table
from service.stages.job_inputs import JobInputs

NONE = "-"
SHORT_LABEL = 8  # characters of a label that fit into a narrow column
SHORT_SHA = 16  # hex digits, as in the header of a program
ZONE = re.compile(r"Z\d+\w*")
OTHERS = {"other access": "another tool axis", "other process": "another process"}  # than milling along the accesses
KINDS = {
    "program": "program", "stepnc": "STEP-NC, AP238", "stepnc-arm": "STEP-NC, ISO 14649", "zones": "zones as data",
    "preview": "picture of part and paths", "deviation": "deviation map", "machined": "machined part as a mesh"}


def number(value: float | None, digits: int = 3) -> str:
    """A figure for people; a dash where there is none."""
    return NONE if value is None else decimal(value, digits)


def kind_words(kind: str, taper: float, profile: float | None = None) -> str:
    """'ball', 'tapered ball 3°' or 'lens R40'.

    taper : deg, between side and axis; profile : mm, radius of the large arc of a lens or barrel
    """
    words = kind.replace("_", " ") + (f" R{number(profile)}" if profile else "")
    return words + (f" {number(taper)}°" if taper else "")


def minutes(seconds: float | None) -> str:
    """Seconds as minutes."""
    return NONE if seconds is None else decimal(seconds / 60.0, 2)


def share(value: float | None) -> str:
    """A share, 0 to 1, in percent, rounded down, so that 100 % means all."""
    return NONE if value is None else f"{decimal(int(value * 10_000.0 + 1e-9) / 100.0, 2)} %"


def place(at: Sequence[float | None] | None) -> str:
    """'X1 Y2 Z3' of a point, mm."""
    if at is None:
        return NONE
    return " ".join(f"{axis}{number(v, 2)}" for axis, v in zip("XYZ", at, strict=False))


def ranged(values: Sequence[float | None], digits: int = 0) -> str:
    """'600' or '180 to 600'."""
    known = sorted({v for v in values if v is not None})
    words = [decimal(v, digits) for v in known]
    return NONE if not words else words[0] if words[0] == words[-1] else f"{words[0]} to {words[-1]}"


def job_section(report: Mapping[str, Any], inputs: JobInputs) -> SheetSection:
    """Labels, machine, time and coverage of the job."""
    labels = [(f"Label {key}", value) for key, value in sorted(report["labels"].items())]
    part, time, machine = report["part"], report["time"], inputs.machine
    size = [b - a for a, b in zip(*part["bbox_mm"], strict=True)]
    programs = [f["name"] for f in report["files"] if f["kind"] == "program"]
    axes = machine.kind if machine.kinematics is None else f"{machine.kind}, {machine.kinematics}"
    return SheetSection("job", "Job", (Facts((
        *labels,
        ("Material", inputs.material_name),
        ("Machine", f"{axes}; {', '.join(machine.dialects)}"),
        ("Units", "mm, mm/min, 1/min, degrees"),
        ("Coolant", machine.coolant),
        ("Size of the part", " x ".join(number(v) for v in size)),
        ("Programs", f"{len(programs)}, for {', '.join(machine.dialects)}" if programs else "none written"),
        ("Time", f"{minutes(report['machining_time_s'])} min as simulated, of them {minutes(time['in_cut_s'])} in cut; "
                 f"{time['tool_changes']} tool changes within programs"),
        ("Coverage", f"{share(report['coverage'])} of the machinable area is proved, "
                     f"{share(report['reach_coverage'])} of the area that the tools reach"),
        ("Part sha256", report["inputs"]["part_sha256"][:SHORT_SHA]),
        ("Setup sha256", report["inputs"]["setup_sha256"][:SHORT_SHA]),
        *(("Blank sha256", sha[:SHORT_SHA]) for sha in [report["inputs"].get("stock_sha256")] if sha),
        ("Made by", f"zonemill {report['version']}"))),))


def files_table(report: Mapping[str, Any]) -> Table:
    """The files beside the sheet; an unproved job has no program and no STEP-NC among them."""
    rows = [(f["name"], KINDS.get(f["kind"], f["kind"]), f["access"] or NONE, f["sha256"][:SHORT_SHA])
            for f in report["files"]]
    return Table("Files", ("file", "what it is", "access", "sha256 begins"), tuple(rows), (3.0, 3.0, 1.0, 2.2))


def cautions_section(report: Mapping[str, Any]) -> SheetSection:
    """Cautions, what is taken for granted, warnings and notes."""
    rows = [(c["kind"].replace("_", " "), ", ".join(c["subjects"]) or NONE, c["message"], c["remedy"])
            for c in report["warnings"]]
    known = {f"{c['message']}; {c['remedy']}" for c in report["warnings"]}
    others = tuple(w for w in report["part"]["warnings"] if w not in known)
    notes = tuple(report["proof"]["notes"])
    table = Table("Cautions", ("kind", "of", "what", "remedy"), tuple(rows), (1.2, 1.6, 4.0, 3.6),
                  none="No caution.")
    lists = (("Of the part and the plan", others), ("Notes of the proof", notes))
    more = [Lines(title, lines) for title, lines in lists if lines]
    return SheetSection("mind", "Cautions and notes", (table, assumed_table(report), *more))


def assumed_table(report: Mapping[str, Any]) -> Table:
    """What the proof takes for granted because neither setup nor program states it."""
    rows = [(a["what"].replace("_", " "), a["value"] if isinstance(a["value"], str) else number(a["value"]),
             a["effect"], a["remedy"]) for a in report["proof"]["assumed"]]
    return Table("Taken for granted: check it on your machine, or state it",
                 ("what", "taken to be", "if it is otherwise", "how to state it"), tuple(rows), (1.4, 1.8, 3.6, 3.6),
                 none="The proof takes nothing for granted.")


def findings_section(report: Mapping[str, Any]) -> SheetSection:
    """The findings of the proof."""
    counts = report["finding_counts"]
    rows = tuple((f["kind"], f["message"], _where(f), place(f.get("point")), _many(f)) for f in report["findings"])
    more = sum(counts.values()) - len(rows)
    by_kind = tuple(f"{n} of kind {kind}" for kind, n in counts.items())
    blocks: list[Table | Lines] = [Table(
        "Findings of the proof", ("kind", "what", "where", "worst at, mm", "places"), rows, (1.3, 4.6, 2.2, 2.2, 0.8),
        frozenset({4}), none="The proof has no finding.")]
    if more > 0:
        blocks.append(Lines("More", (f"{more} more are counted only: {', '.join(by_kind)}",)))
    return SheetSection("findings", "Findings of the proof", tuple(blocks))


def _where(f: Mapping[str, Any]) -> str:
    words = [f["zone"], f["face"], f"line {f['line']}" if f["line"] else None,
             f["program"] if f["program"] and f["line"] else None]
    return " ".join(w for w in words if w) or NONE


def _many(f: Mapping[str, Any]) -> str:
    return str(f.get("count", 1))


def tools_table(report: Mapping[str, Any], inputs: JobInputs, used: Sequence[str]) -> Table:
    """All tools of the setup: those in use in the order of the programs, then the others."""
    facts, tools = {t["id"]: t for t in report["tools"]}, {t.id: t for t in inputs.tools}
    rows = []
    for name in [*used, *(t for t in tools if t not in used)]:
        tool, fact = tools[name], facts[name]
        mine = [s for s in report["steps"] if s["tool"] == name]
        neck = NONE if tool.neck_length_mm == tool.flute_length_mm else \
            f"Ø{number(tool.neck_diameter_mm)} to {number(tool.neck_length_mm)}"
        rows.append((
            f"T{tool.number}" + ("" if name == f"T{tool.number}" else f" {name}"),
            kind_words(tool.kind, tool.taper_angle_deg, tool.profile_radius_mm), number(tool.diameter_mm),
            number(tool.corner_radius_mm),
            str(tool.flutes), number(tool.flute_length_mm), neck,
            number(tool.shank_diameter_mm), number(tool.stickout_mm), number(tool.gauge_length_mm),
            ranged([s["spindle_rpm"] for s in mine]), ranged([s["feed_mm_min"] for s in mine]),
            number(fact["minutes_in_cut"], 2), str(fact["cutters"]) if mine else "not used"))
    return Table("Tools in order of use, lengths from the tip in mm",
                 ("tool", "kind", "Ø", "corner R", "teeth", "flutes", "neck", "shank Ø", "stickout", "gauge length",
                  "S 1/min", "F mm/min", "min in cut", "cutters"), tuple(rows),
                 (1.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.7, 1.0, 1.4, 1.2, 1.3, 1.3, 1.1, 1.2), frozenset(range(2, 13)) - {6})


def steps_table(report: Mapping[str, Any], planned: Mapping[str, tuple[str, float, float]],
                labels: Mapping[str, str], programs: Mapping[str, str], numbers: Mapping[str, int]) -> Table:
    """The steps in the order of the programs.

    planned  : by id, access of the step, and its upper and lower end in the frame of that access, mm
    labels   : by id, label that a program can start at
    programs : by id, beginning of the names of its programs, where a control has several
    numbers  : T numbers by id of the tool
    """
    rows = []
    for s in report["steps"]:
        access, top, bottom = planned.get(s["id"], ("", None, None))
        zones = s["zone"] or " ".join(w for w in s["name"].split() if ZONE.fullmatch(w)) or NONE
        change = ", fresh cutter" if s["fresh_cutter"] else ""
        rows.append((s["id"], *(texts.get(s["id"], NONE) for texts in (programs, labels) if texts), zones,
                     access or NONE, f"{s['operation']}, {s['strategy']}", f"T{numbers[s['tool']]}{change}",
                     number(s["spindle_rpm"], 0), number(s["feed_mm_min"], 0), number(top), number(bottom),
                     minutes(s["machining_time_s"])))
    more = [name for name, texts in (("program", programs), ("label", labels)) if texts]
    heads = ("step", *more, "zones", "access", "what", "tool", "S 1/min", "F mm/min", "top Z", "bottom Z", "min")
    longest = max(map(len, labels.values()), default=0)
    wide = {"program": 2.6, "label": 1.0 if longest <= SHORT_LABEL else 2.0}
    widths = (1.0, *(wide[name] for name in more), 1.8, 1.1, 2.6, 1.2, 1.1, 1.1, 1.1, 1.2, 0.9)
    return Table("Steps in the order they are run", heads, tuple(rows), widths,
                 frozenset(range(len(heads) - 5, len(heads))), none="No step: nothing could be cut.")


def zones_table(report: Mapping[str, Any]) -> Table:
    """Each zone and the figures that the proof measured on it."""
    rows = tuple((
        z["id"], z["kind"], " ".join(w for w in (z["profile"], z["level"]) if w) or NONE, z["access"], z["tool"],
        f"{z['form']}, {z['strategy']}", " ".join(z["faces"]), number(z["area_mm2"], 1),
        number(z["scallop_mm"]["requested"], 4), number(z["scallop_mm"]["p99"], 4), number(z["scallop_mm"]["max"], 4),
        share(z.get("coverage")), " ".join(z["steps"]) or NONE, minutes(z["machining_time_s"]))
        for z in report["zones"])
    return Table("Zones, with the figures measured by the proof",
                 ("zone", "kind", "profile, level", "access", "tool", "what", "faces", "mm²", "scallop set", "p99",
                  "max", "covered", "steps", "min"), rows,
                 (1.0, 1.0, 1.3, 1.1, 0.9, 1.9, 1.9, 1.1, 1.2, 1.0, 1.0, 1.3, 1.1, 0.9),
                 frozenset({7, 8, 9, 10, 11, 13}), none="No zone: no tool reaches any of the requested area.")


def remainder_table(report: Mapping[str, Any]) -> Table:
    """The remainder: where material stays, why, and what would reach it."""
    rows = tuple((x["reason"], number(x["area_mm2"], 2), " ".join(x["faces"]), place(x["at_mm"]), needed(x))
                 for x in report["remainder"])
    heads = ("reason", "mm²", "faces", "near, mm", "what would reach it")
    return Table("Remainder: area that stays uncut", heads, rows,
                 (1.9, 0.8, 2.2, 1.9, 4.2), frozenset({1}), none="No remainder: all of the requested area is machined.")


def needed(item: Mapping[str, Any]) -> str:
    """The tool, access or process that would reach an entry of the remainder, in words."""
    need = item["would_need"]
    words = [item["why_left"] or ""]
    if item["tool_at_hand"]:
        words.append(f"{item['tool_at_hand']} would reach it")
    if "diameter_mm" in need:
        round_end = f" R{number(need['corner_radius_mm'])}" if need["kind"].endswith("bull") else ""
        kind = kind_words(need["kind"], need.get("taper_angle_deg", 0.0))
        words.append(f"{kind} Ø{number(need['diameter_mm'])}{round_end}, neck {number(need['neck_length_mm'])}, "
                     f"shank Ø{number(need['shank_diameter_mm'])}, stickout {number(need['stickout_mm'])}")
        if need.get("share", 1.0) < 1.0:
            words.append(f"for {share(need['share'])} of it")
    elif "kind" in need:
        words.append(OTHERS.get(need["kind"], str(need["kind"])))
        if "slenderness" in need:
            words.append(f"as a tool would be {number(need['slenderness'], 1)} times as long as thick")
    if "access" in need:
        words.append(f"along {need['access']}")
    return ", ".join(w for w in words if w) or "no tool would reach it"


def proof_section(report: Mapping[str, Any]) -> SheetSection:
    """Number of samples, error and lengths of the proof."""
    proof, time = report["proof"], report["time"]
    facts = Facts((
        ("Samples measured", str(proof["samples"])),
        ("Error of the measurement", f"{number(proof['error_bound_mm'], 4)} mm at most"),
        ("Deepest cut into the part", f"{number(report['gouge_max_mm'], 4)} mm"),
        ("Cutting length", f"{number(proof['cutting_length_mm'], 0)} mm"),
        ("Time in air", f"{minutes(time['in_air_s'])} min, of them {minutes(time['rapid_s'])} in rapids; "
                        f"{time['retracts']} retracts")))
    return SheetSection("proof", "The proof", (facts,))


__all__ = ["NONE", "SHORT_SHA", "assumed_table", "cautions_section", "files_table", "findings_section", "job_section",
           "kind_words", "minutes", "needed", "number", "place", "proof_section", "ranged", "remainder_table", "share",
           "steps_table", "tools_table", "zones_table"]
