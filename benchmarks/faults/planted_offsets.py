"""Offsets planted into correct programs: is each found, as high or deep as it is, and is none proved?

Run from the root of the checkout: ``python benchmarks/faults/planted_offsets.py [--sizes 0.3,5] [--ways +X,-Z]
[--programs A,B] [--rows FILE]``. The programs are plans of small parts in five dialects, whole and of one operation
each, one by hand on five axes, and, where the collection of cases lies beside the checkout, one of its programs. The
operation on the dome and the one on five axes also take stock off a plane beside their face, so their setups name the
face; the other setups name none. One more program by hand drills holes, blind and right through. Offsets go along X, Y
and Z, both ways, into one tool length, and into the work offset. The smallest is twice the larger of scallop and gouge
tolerance.

Whether an offset changes anything is judged without the code under test: some samples of a face that is asked, which
the right program leaves within tolerance, must be out of it by their residuals alone, or some sample of any face is
gouged. Depth and height that must be found are the largest part of the offset along the normals of such samples of one
face, if so much stock stands there, or the offset goes into it. What a drill leaves is as high as the offset along its
axis. What one of two tools leaves is that high where the face is level; elsewhere the other may have taken some of it.
Right means within 10 % or 5 µm.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

from schemas.machine import DIALECT_ENDINGS  # noqa: E402
from schemas.setup import Setup  # noqa: E402
from service.from_wire import parse_setup  # noqa: E402
from service.pipeline import plan  # noqa: E402
from service.stages.job_part import ReadPart, read_job_part  # noqa: E402
from service.verification.program_first import read_first  # noqa: E402
from service.verification.program_proof import ProgramProof, proved_program  # noqa: E402
from tests.step_files import write_step  # noqa: E402
from verify.blank.blank import stock_on_normals  # noqa: E402
from verify.surface.sample_scores import proved_samples  # noqa: E402

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
SIZES = (0.1, 0.3, 1.0, 2.0, 5.0)  # mm, beside the smallest
GRAZES = 1e-6  # mm of stock: a tool that comes no deeper takes nothing off a face
LEVEL = 0.98  # cosine of the slope of a face that counts as level
CHANGED = 5  # samples out of tolerance, from which on an offset has changed something
FIXED = re.compile(r"G53|G28|G30|M91|SUPA|G10|CYCL DEF|TOOL CALL|^\s*[(;]")
WORD = re.compile(r"(?<![A-Z_])([XYZ])=?([+-]?(?:\d+\.?\d*|\.\d+))")
FLAT = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 4, "flute_length_mm": 12, "stickout_mm": 25}
DRILL = {"id": "T3", "number": 3, "kind": "drill", "diameter_mm": 3, "point_angle_deg": 118, "flute_length_mm": 20,
         "stickout_mm": 30}
POINT = 1.5 / math.tan(math.radians(59.0))  # mm, height of its point
# X, Y and depth of the full diameter; the last hole goes right through
HOLES = ((5.0, 5.0, 5.0), (12.0, 10.0, 6.5), (19.0, 5.0, 14.0))
BALL = {"id": "T2", "number": 2, "kind": "ball", "diameter_mm": 3, "flute_length_mm": 8, "stickout_mm": 25}


@dataclass(frozen=True, eq=False)
class Case:
    """A correct program of a part: its name, the part as it was read, setup, text, and ending of its file.

    drills : whether all that it cuts is drilled down along Z
    """

    name: str
    job: ReadPart
    setup: Setup
    text: str
    ending: str
    drills: bool = False

    @property
    def smallest(self) -> float:
        """Twice the larger of scallop and gouge tolerance, mm."""
        q = self.setup.quality
        return 2.0 * max(q.scallop_height_mm, q.gouge_tolerance_mm)

    def proof(self, text: str) -> ProgramProof:
        """The proof of a text."""
        return proved_program(self.job, read_first(self.setup, text, ending=self.ending), lambda _share: None)


@dataclass(frozen=True)
class Row:
    """One planted offset: whether it changes what is cut, what it makes on an asked face (None where that is nothing,
    or more than the stock), the state, and the finding that is nearest to that, mm."""

    program: str
    where: str
    size: float
    changes: bool
    expected: float | None
    state: str
    nearest: float | None
    kind: str
    right: bool
    seconds: float


def shapes() -> dict[str, tuple[Any, list[dict[str, Any]]]]:
    """Small parts with their tools."""
    def box(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> cq.Workplane:
        return cq.Workplane().box(x, y, z, centered=False).translate(at)

    step = box(16, 12, 6).cut(box(8, 12, 3, (0, 0, 3)))
    pocket = box(24, 20, 8).cut(box(14, 10, 4, (5, 5, 4)).edges("|Z").fillet(2.5))
    boss = box(20, 16, 4).union(cq.Workplane().cylinder(4, 4, centered=(True, True, False)).translate((10, 8, 4)))
    slope = box(16, 12, 7).cut(cq.Workplane("XZ").polyline([(6, 7), (16, 7), (16, 4)]).close().extrude(-12))
    dome = box(14, 14, 3).union(cq.Workplane().sphere(5).intersect(box(20, 20, 6, (-10, -10, 1.5)))
                                .translate((7, 7, 1.2)))
    return {"step": (step, [FLAT]), "pocket": (pocket, [FLAT]), "boss": (boss, [FLAT]), "slope": (slope, [FLAT, BALL]),
            "dome": (dome, [FLAT, BALL])}


def cases(folder: Path, wanted: set[str]) -> Iterator[Case]:
    """The correct programs."""
    for (name, (shape, tools)), dialect in zip(shapes().items(), DIALECT_ENDINGS, strict=True):
        step = write_step(shape, folder / f"{name}.step")
        for what in ("whole", "one"):
            if wanted and f"{name}-{what}" not in wanted:
                continue
            raw = {"tools": tools, "machine": {"dialects": [dialect]}, "quality": {"scallop_height_mm": 0.02},
                   "stock": {"margin_mm": 1.0, "uncertainty_mm": 0.0}}
            one = {"operations": {"roughing": False, "faces": _top_faces(step, raw)}} if what == "one" else {}
            report = plan(step, parse_setup(json.dumps({**raw, **one})), folder / f"{name}-{what}", _quiet)
            if report["state"] != "proved":
                raise SystemExit(f"{name}-{what} is not proved: {report['findings'][:2]}")
            ending = DIALECT_ENDINGS[dialect]
            text = (folder / f"{name}-{what}" / f"program.{dialect}.{ending}").read_text()
            named = {"operations": {"faces": one["operations"]["faces"]}} if one and name == "dome" else {}
            setup = parse_setup(json.dumps({**raw, **named}))
            yield Case(f"{name}-{what}", read_job_part(step, setup, _quiet), setup, text, f".{ending}")
    if not wanted or "slope-five" in wanted:
        step = write_step(shapes()["slope"][0], folder / "slope-five.step")
        setup = parse_setup(json.dumps({
            "tools": [FLAT], "operations": {"faces": ["F7"]}, "quality": {"scallop_height_mm": 0.02},
            "stock": {"margin_mm": 1.0, "uncertainty_mm": 0.0},
            "machine": {"kind": "5-axis", "kinematics": "table-table-AC", "tcp": True, "dialects": ["siemens"]}}))
        yield Case("slope-five", read_job_part(step, setup, _quiet), setup, five_axis_text(), ".mpf")
    if not wanted or "drilled" in wanted:
        holes = cq.Workplane().box(24, 16, 14, centered=False)
        for x, y, deep in HOLES:
            holes = holes.cut(cq.Workplane().circle(1.5).extrude(-deep).translate((x, y, 14)))
            holes = holes.cut(cq.Workplane(cq.Solid.makeCone(1.5, 0.0, POINT, pnt=cq.Vector(x, y, 14 - deep),
                                                             dir=cq.Vector(0, 0, -1))))
        step = write_step(holes, folder / "drilled.step")
        setup = parse_setup(json.dumps({"tools": [DRILL], "quality": {"scallop_height_mm": 0.02},
                                        "stock": {"kind": "box", "box_mm": [[0, 0, 0], [24, 16, 14]],
                                                  "uncertainty_mm": 0.0}}))
        yield Case("drilled", read_job_part(step, setup, _quiet), setup, drilled_text(), ".ngc", drills=True)
    if (CASES / "nc" / "pocket_ok.ngc").is_file() and (not wanted or "pocket_ok" in wanted):
        setup = parse_setup((CASES / "nc" / "pocket_setup.json").read_bytes())
        yield Case("pocket_ok", read_job_part(CASES / "parts" / "pocket_plate.step", setup, _quiet), setup,
                   (CASES / "nc" / "pocket_ok.ngc").read_text(), ".ngc")


def five_axis_text() -> str:
    """The slope from (6, 7) to (16, 4) in XZ in four passes along Y, with the end of the tool in its plane."""
    along, normal = np.array([10.0, 0.0, -3.0]) / 109.0**0.5, np.array([3.0, 0.0, 10.0]) / 109.0**0.5

    def words(s: float, y: float, over: float) -> str:
        x, _, z = np.array([6.0, 0.0, 7.0]) + s * along + over * normal
        return f"X{x:.6f} Y{y:.6f} Z{z:.6f}"

    axis = " ".join(f"{k}3={v:.9f}" for k, v in zip("ABC", normal, strict=True))
    lines = ["G710 G17 G90 G94 G54", "T1 M6", "D1", "S6000 M3 M8", "SUPA G0 Z0 D0", "G54 D1", "G0 A0 C0", "TRAORI",
             "G54", "ORIWKS", "G0 X11 Y-5 Z60", f"G0 {words(0.5, -5.0, 30.0)} {axis}"]
    for s in (0.5, 3.5, 6.5, 9.5):
        lines += [f"G0 {words(s, -5.0, 5.0)}", f"G1 {words(s, -5.0, 0.0)} F300", f"G1 {words(s, 17.0, 0.0)}",
                  f"G0 {words(s, 17.0, 5.0)}"]
    return "\n".join([*lines, f"G0 {words(9.5, 17.0, 30.0)}", "G0 Z60 A3=0 B3=0 C3=1", "TRAFOOF", "SUPA G0 Z0 D0",
                      "M30", ""])


def drilled_text() -> str:
    """The holes of the plate, each in pecks down to its full diameter and the point of the drill."""
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001", "G54", "T3 M6", "S3000 M3", "G0 X5 Y5", "G43 H3 Z30"]
    lines += [f"G98 G83 X{x:g} Y{y:g} Z{14.0 - deep - POINT:.4f} R16 Q2 F150" for x, y, deep in HOLES]
    return "\n".join([*lines, "G80", "G0 Z30", "M5", "G53 G0 Z0", "M2", ""])


def _quiet(_stage: str, _share: float) -> None:
    """No progress."""


def _top_faces(step: Path, raw: dict[str, Any]) -> list[str]:
    """The highest level face of a part, or the highest face where none is level: the one operation works on it."""
    part = read_job_part(step, parse_setup(json.dumps(raw)), _quiet).part
    mesh = part.mesh
    middle = {f.number: mesh.triangles[mesh.face_ids == f.number][:, :, 2].mean() for f in part.faces}
    up = {f.number: float(mesh.normals[mesh.face_ids == f.number][:, 2].mean()) for f in part.faces}
    level = [n for n in middle if up[n] > 0.5]
    return [f"F{max(level, key=lambda n: middle[n])}"]


def shifted(text: str, by: np.ndarray, lines: Callable[[int], bool] = lambda _line: True) -> str:
    """A text with its X, Y and Z words moved by ``by``, (3,) mm, on some of its lines; lines that name fixed places of
    the machine stay."""
    def moved(m: re.Match[str]) -> str:
        value = float(m[2]) + float(by["XYZ".index(m[1])])
        sign = "+" if m[2].startswith("+") and value >= 0 else ""
        return f"{m[1]}{'=' if '=' in m[0] else ''}{sign}{value:.4f}"

    out = []
    for k, line in enumerate(text.split("\n"), 1):
        out.append(line if FIXED.search(line) or not lines(k) else WORD.sub(moved, line))
    return "\n".join(out)


def tool_lines(case: Case) -> dict[int, Callable[[int], bool]]:
    """Lines of each tool, by T number, of a program with several tools."""
    read = read_first(case.setup, case.text, ending=case.ending).read
    tools = np.unique(read.tool[read.tool > 0]).tolist()
    return {} if len(tools) < 2 else {t: set(read.line[read.tool == t].tolist()).__contains__ for t in tools}


def planted(case: Case, sizes: tuple[float, ...]) -> Iterator[tuple[str, np.ndarray, str]]:
    """Name, offset (3,) mm and text of every offset."""
    for size in (case.smallest, *(s for s in sizes if s > case.smallest)):
        for axis, letter in enumerate("XYZ"):
            for way in (1.0, -1.0):
                by = np.zeros(3)
                by[axis] = way * size
                yield f"{'+' if way > 0 else '-'}{letter}", by, shifted(case.text, by)
        for tool, lines in tool_lines(case).items():
            for way in (1.0, -1.0):
                by = np.array([0.0, 0.0, way * size])
                yield f"length of T{tool} {'+' if way > 0 else '-'}", by, shifted(case.text, by, lines)
    if "G54" in case.text:
        yield "G55", np.zeros(3), case.text.replace("G54", "G55")


def good_there(right: ProgramProof, made: ProgramProof) -> np.ndarray:
    """Whether the right program leaves the samples of ``made`` within tolerance, (n,) bool, by its nearest on the face.

    Large planes have close samples only where a program needs them, so two programs may have different ones.
    """
    good, out = np.asarray(right.proof.proved, np.bool_), np.zeros(len(made.samples), np.bool_)
    for face in np.unique(made.samples.face).tolist():
        here, there = np.flatnonzero(made.samples.face == face), np.flatnonzero(right.samples.face == face)
        if len(there):
            out[here] = good[there[cKDTree(right.samples.points[there]).query(made.samples.points[here])[1]]]
    return out


def shown(right: ProgramProof, made: ProgramProof, out: np.ndarray, by: np.ndarray, drills: bool,
          one_tool: bool) -> list[tuple[float, bool]]:
    """What an offset (3,) mm makes on the faces that are asked: for each, the largest part of it along the normals of
    those samples of ``made`` that went out of tolerance (n,); faces where it is more than the stock are left out. A
    drill leaves the whole of an offset up, on walls too; one tool of two (``one_tool``) counts on level faces.

    Returns with each whether all of the stock stays there.
    """
    asked = {int(f[1:]) for f in right.report["asked"]["faces"]}
    faces = {}
    for face in np.unique(made.samples.face[out]).tolist():
        rows = np.flatnonzero(out & (made.samples.face == face))
        s = made.samples.subset(rows)
        gouged, along = made.proof.residual[rows] < 0.0, s.normals @ by
        if drills and by[2] > 0.0:
            if face in asked and (~gouged).sum() > CHANGED:
                faces[face] = float(by[2]), False
            continue
        most = float(np.abs(along).max())
        stock = stock_on_normals(s.points, s.normals, right.frame.part.mesh.bounds, right.conditions, 100.0)
        near = (np.abs(along) > 0.98 * most) & np.where(along > 0.0, (stock >= most) & ~gouged, gouged)
        if one_tool:
            near &= (along < 0.0) | (most > LEVEL * float(np.linalg.norm(by)))
        if face in asked and near.sum() > CHANGED:
            faces[face] = most, bool(((along > 0.0) & (stock <= most + GRAZES))[near].all())
    return list(faces.values())


def judge(case: Case, right: ProgramProof, where: str, by: np.ndarray, text: str) -> Row:
    """Prove a text with an offset and look for the finding that is nearest to what it makes."""
    begin, size = time.monotonic(), float(np.linalg.norm(by))
    made = case.proof(text)
    out = good_there(right, made) & ~proved_samples(made.proof.residual, made.conditions)
    heights = shown(right, made, out, by, case.drills, where.startswith("length"))
    if all(whole for _, whole in heights) and any(str(f.kind) == "nothing_cut" for f in made.proof.findings):
        heights = []  # a program that takes nothing off works on no face, so no height is asked of it
    wanted = [height for height, _ in heights]
    harm = bool((out & (made.proof.residual < 0.0)).sum() > CHANGED)
    depths = [(abs(f.depth), str(f.kind)) for f in made.proof.findings if str(f.kind) in ("gouge", "stock_left")]
    pairs = [(abs(d - w) / max(0.1 * w, 0.005), w, d, kind) for w in wanted for d, kind in depths]
    off, expected, nearest, kind = min(pairs, default=(math.inf, max(wanted, default=None), None, ""))
    asked = np.isin(made.samples.face, [int(f[1:]) for f in right.report["asked"]["faces"]])
    changes = int((out & asked).sum()) > CHANGED or harm or where == "G55"
    return Row(case.name, where, size, changes, expected, made.report["state"], nearest, kind, off <= 1.0,
               round(time.monotonic() - begin, 2))


def main() -> None:
    """Run the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--sizes", default=",".join(map(str, SIZES)))
    options.add_argument("--ways", default="", help="only these, as +X,-Z,G55")
    options.add_argument("--programs", default="")
    options.add_argument("--rows", default="")
    given = options.parse_args()
    sizes = tuple(float(s) for s in given.sizes.split(",") if s)
    ways = set(filter(None, given.ways.split(",")))
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(Path(folder), set(filter(None, given.programs.split(",")))):
            begin = time.monotonic()
            right = case.proof(case.text)
            report, seconds = right.report, time.monotonic() - begin
            rest = [(e["reason"], e["area_mm2"]) for e in report["remainder"]]
            print(f"{case.name}: {report['state']}, coverage {report['coverage']:.3f}, {seconds:.1f} s, asked "
                  f"{report['asked']['faces']}, remainder {rest}", [f["message"] for f in report["findings"]][:4],
                  flush=True)
            for where, by, text in planted(case, sizes):
                if ways and where not in ways:
                    continue
                row = judge(case, right, where, by, text)
                rows.append(row)
                wrong = row.changes and (row.state == "proved" or row.expected is not None and not row.right)
                if wrong or not row.changes:
                    print("  ", "WRONG" if wrong else "nothing changes", row, flush=True)
    if given.rows:
        Path(given.rows).write_text("".join(json.dumps(asdict(r)) + "\n" for r in rows))
    table(rows)


def table(rows: list[Row]) -> None:
    """Print one row for each program."""
    print("| program | offsets | change something | proved of these | with a depth to find | of these right |")
    print("|---|---|---|---|---|---|")
    for name in dict.fromkeys(r.program for r in rows):
        own = [r for r in rows if r.program == name]
        change = [r for r in own if r.changes]
        square = [r for r in change if r.expected is not None]
        print(f"| {name} | {len(own)} | {len(change)} | {sum(r.state == 'proved' for r in change)} | {len(square)} | "
              f"{sum(r.right for r in square)} |")


if __name__ == "__main__":
    main()
