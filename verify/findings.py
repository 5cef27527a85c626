"""Turns single contacts into findings that a person can act on.

Arrays are float64, lengths are mm, and points are in the setup frame unless a docstring says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.tool_body import ToolBody
from verify.kernels.stock import CUTTER, FIXTURE, HOLDER, NECK, PLUNGE, SHANK
from verify.model import Finding, FindingKind
from verify.moves import Moves

MAX_FINDINGS = 200
KEPT_OF_A_KIND = MAX_FINDINGS // len(FindingKind)
NEAR = 5.0
TIE = 1e-3  # mm, of depths: the first line counts
LINES_APART = 5
SAME_PLACE = 1e-6  # mm
SAME_WIDTH = 0.05  # mm: relief of less than half of it aside is no relief
BODY_NAMES = {CUTTER: "cutting part", NECK: "neck", SHANK: "shank", HOLDER: "holder"}


@dataclass(frozen=True, eq=False)
class Source:
    """Origin of each of m moves.

    names   : names of the programs
    program : (m,) int32, index, place of the program in ``names``
    line    : (m,) int32, index, 1-based line
    tool    : (m,) int32, index, T number
    """

    names: tuple[str, ...]
    program: I32
    line: I32
    tool: I32


def chains(program: I32, line: I32, points: F64, key: I32) -> NDArray[np.int64]:
    """Group neighbouring contacts: one key, one program, lines at most 5 and places at most 5 mm apart.

    program, line, key : (n,) int32, index
    points             : (n, 3) float64, mm, setup frame

    Returns (n,) int64, index: the group of each row.
    """
    if len(line) == 0:
        return np.zeros(0, np.int64)
    order = np.lexsort((points[:, 1], points[:, 0], line, program, key))
    k, p, n, x = key[order], program[order], line[order], points[order]
    new = (k[1:] != k[:-1]) | (p[1:] != p[:-1]) | (n[1:] - n[:-1] > LINES_APART)
    new |= (np.linalg.norm(x[1:] - x[:-1], axis=1) > NEAR) & (n[1:] != n[:-1])
    out = np.empty(len(line), np.int64)
    out[order] = np.concatenate([[0], np.cumsum(new)])
    return out


def worst_of(groups: NDArray[np.int64], depth: F64) -> list[NDArray[np.int64]]:
    """Rows of each group, the deepest first; of equal depths the first row first.

    groups : (n,) int64, index
    depth  : (n,) float64, mm

    Returns one (k,) int64 array of rows, index, for each group.
    """
    order = np.lexsort((np.arange(len(groups)), -depth, groups))
    cuts = np.flatnonzero(np.diff(groups[order])) + 1
    return [rows for rows in np.split(order, cuts) if len(rows)]


def contact_findings(events: F64, moves: Moves, source: Source, skins: F64, tools: Sequence[ToolBody],
                     holes: Mapping[int, float] | None = None) -> list[Finding]:
    """Findings of the events that a pass over the stock collected.

    events : (e, 7) float64, rows of ``verify.material.stock_pass.StockPass``, mm, setup frame
    skins  : (m,) float64, mm, depth that each move may plunge
    holes  : mm by T number, diameters of the holes that taps need

    The line of a finding is the first of those that are within a micrometre of the deepest.

    A neck or shank as wide as the cutting part runs along the walls of its own cut. Where it enters by no more than the
    skin, it rubs; deeper it collides.
    """
    if len(events) == 0:
        return []
    move, code, feed = events[:, 0].astype(np.int64), events[:, 1].astype(np.int32), moves.feed
    touching = events[:, 2] > events[:, 3] + 1e-9
    key = code + 16 * touching.astype(np.int32) * feed[move] + 32 * (~feed[move]).astype(np.int32)
    groups = chains(source.program[move], source.line[move], events[:, 4:7], key)
    out = []
    over = events[:, 2] - events[:, 3]
    for rows in worst_of(groups, over):
        deep = rows[over[rows] >= over[rows[0]] - TIE]  # a lift out of what a rapid ran into is no deeper
        r = deep[np.argmin(move[deep])]
        m = move[r]
        depth, clearance = float(events[r, 2]), float(events[r, 3])
        kind, text, limit = _contact(int(code[r]), bool(feed[m]), depth, clearance, float(skins[m]))
        if kind is FindingKind.PLUNGE and (wide := (holes or {}).get(int(source.tool[m]))) is not None:
            text += f"; before this tap the hole must be {wide:.2f} mm wide"
        beside = _runs_beside(int(code[r]), tools[moves.tool[m]])
        if kind is FindingKind.COLLISION and beside and depth - clearance <= skins[m]:
            kind = FindingKind.RUBBING
        if source.tool[m] == 0:
            text = text.replace(BODY_NAMES[CUTTER], "spindle nose")
            if depth > clearance:
                kind, limit = FindingKind.COLLISION, 0.0
        lines = source.line[move[rows]]
        out.append(Finding(kind, source.names[source.program[m]], int(source.line[m]), None, None,
                           _point(events[r, 4:7]), depth if kind == FindingKind.PLUNGE else max(depth - clearance, 0.0)
                           if depth > clearance else clearance - depth, limit,
                           f"T{source.tool[m]}: {text}{_span(lines)}", len(rows), near=depth <= clearance,
                           tip=_point(_nearest(moves.start[m], moves.end[m], events[r, 4:7]))))
    return out


def _runs_beside(code: int, tool: ToolBody) -> bool:
    """Whether a contact with stock or part is that of a neck or shank as wide as the cutting part."""
    wide = {NECK: tool.neck_diameter, SHANK: tool.shank_diameter}.get(code)
    return wide is not None and abs(2.0 * tool.widest_radius - wide) <= SAME_WIDTH


def _nearest(start: F64, end: F64, place: F64) -> F64:
    """(3,) float64, mm: the point of a straight move that is nearest to ``place``."""
    way = end - start
    size = float(way @ way)
    return np.asarray(start + (min(max(float((place - start) @ way) / size, 0.0), 1.0) if size > 0.0 else 1.0) * way)


def _contact(code: int, feed: bool, depth: float, clearance: float, skin: float) -> tuple[FindingKind, str, float]:
    if code == PLUNGE:
        return (FindingKind.PLUNGE, f"a descent steeper than the ramp angle takes {depth:.3f} mm of stock with the "
                f"end of the tool ({skin:.3f} mm allowed)", skin)
    body, obstacle = BODY_NAMES[code % FIXTURE], "a fixture" if code >= FIXTURE else "stock or part"
    gap = clearance - depth
    if not feed:
        text = f"a rapid takes the {body} into {obstacle}" if gap < 0 else \
            f"a rapid brings the {body} to {gap:.3f} mm of {obstacle} (clearance {clearance:g} mm)"
        return FindingKind.RAPID, text, clearance
    if gap < 0:
        return FindingKind.COLLISION, f"the {body} enters {obstacle} by {-gap:.3f} mm", 0.0
    text = f"the {body} comes to {gap:.3f} mm of {obstacle} (clearance {clearance:.3f} mm)"
    return FindingKind.RUBBING, text, clearance


def gouge_findings(points: F64, face: I32, depth: F64, area: F64, mover: I32, source: Source,
                   tolerance: float) -> list[Finding]:
    """Findings of gouges deeper than the tolerance, by face and neighbouring lines.

    points : (n, 3) float64, mm, setup frame
    face   : (n,) int32, index, face number
    depth  : (n,) float64, mm, how deep the cut goes under the surface
    area   : (n,) float64, mm²
    mover  : (n,) int32, index, the move that cut deepest
    """
    return _cut_findings(FindingKind.GOUGE, "cuts {:.4f} mm into the part", points, face, depth, area, mover, source,
                         tolerance)


def allowance_findings(points: F64, face: I32, depth: F64, area: F64, mover: I32, source: Source, allowance: float,
                       tolerance: float) -> list[Finding]:
    """Findings of cuts that go deeper into the stock allowance than the tolerance.

    points : (n, 3) float64, mm, setup frame
    face   : (n,) int32, index, face number
    depth  : (n,) float64, mm, how deep the cut goes under the allowance; allowance, tolerance : mm
    area   : (n,) float64, mm²
    mover  : (n,) int32, index, the move that cut deepest
    """
    text = f"cuts {{:.4f}} mm into the stock allowance of {allowance:g} mm"
    return _cut_findings(FindingKind.ALLOWANCE, text, points, face, depth, area, mover, source, tolerance)


def excluded_findings(points: F64, face: I32, taken: F64, area: F64, mover: I32, source: Source,
                      why: Mapping[int, str], tolerance: float) -> list[Finding]:
    """Findings of faces that are brought to size although the setup does not let machine them, by face and program.

    points : (n, 3) float64, mm, setup frame
    face   : (n,) int32, index, face number
    taken  : (n,) float64, mm of stock taken off each face; tolerance : mm
    area   : (n,) float64, mm²
    mover  : (n,) int32, index, the move that brought each place to size
    why    : words of the setup by face number
    """
    out = []
    _, groups = np.unique(np.column_stack([source.program[mover], face]), axis=0, return_inverse=True)
    for rows in worst_of(groups.reshape(-1), taken):
        r, m = rows[0], mover[rows[0]]
        total = float(area[rows].sum())
        out.append(Finding(
            FindingKind.EXCLUDED_FACE, source.names[source.program[m]], int(source.line[m]), None, f"F{face[r]}",
            _point(points[r]), float(taken[r]), tolerance,
            f"T{source.tool[m]} takes {taken[r]:.4f} mm of stock off F{face[r]}, down to the face; {why[int(face[r])]} "
            f"({total:.3g} mm²{_span(source.line[mover[rows]])})", len(rows), total))
    return out


def _cut_findings(kind: FindingKind, text: str, points: F64, face: I32, depth: F64, area: F64, mover: I32,
                  source: Source, tolerance: float) -> list[Finding]:
    out = []
    groups = chains(source.program[mover], source.line[mover], points, face)
    for rows in worst_of(groups, depth):
        r = rows[0]
        m = mover[r]
        out.append(Finding(kind, source.names[source.program[m]], int(source.line[m]), None, f"F{face[r]}",
                           _point(points[r]), float(depth[r]), tolerance,
                           f"T{source.tool[m]} {text.format(depth[r])}{_span(source.line[mover[rows]])}",
                           len(rows), float(area[rows].sum())))
    return out


def residual_findings(points: F64, zone: I32, face: I32, excess: F64, area: F64, zone_ids: Sequence[str],
                      scallop: float) -> list[Finding]:
    """Findings of samples outside the budget of their zone, by zone, face and 5 mm cell.

    points     : (n, 3) float64, mm, setup frame
    zone, face : (n,) int32, index, row of ``zone_ids`` from 1, and face number
    excess     : (n,) float64, mm left over the allowance, negative where the part is cut too deep
    area       : (n,) float64, mm²
    """
    if len(points) == 0:
        return []
    cell = np.floor(points / NEAR).astype(np.int64)
    _, groups = np.unique(np.column_stack([zone, face, cell]), axis=0, return_inverse=True)
    out = []
    for rows in worst_of(groups.reshape(-1), np.abs(excess)):
        r = rows[0]
        name = zone_ids[zone[r] - 1]
        total = float(area[rows].sum())
        text = f"{excess[r]:.4f} mm stays where {scallop:g} mm is allowed" if excess[r] > 0 else \
            f"the cut is {-excess[r]:.4f} mm too deep"
        out.append(Finding(FindingKind.RESIDUAL, "", 0, name, f"F{face[r]}", _point(points[r]), float(excess[r]),
                           scallop, f"{name}: {text} ({total:.3g} mm² in this place)", len(rows), total))
    return out


def ordered(findings: Sequence[Finding]) -> tuple[tuple[Finding, ...], dict[str, int]]:
    """200 findings, the gravest first, and the number of each kind.

    The gravest ``KEPT_OF_A_KIND`` of each kind are always among them. A program in the wrong unit collides a thousand
    times, and a single finding of another kind names the cause.
    """
    rank = {kind: i for i, kind in enumerate(FindingKind)}
    counts: dict[str, int] = {}
    for f in findings:
        counts[str(f.kind)] = counts.get(str(f.kind), 0) + 1
    by_grade = sorted(findings, key=lambda f: (rank[f.kind], f.near, f.depth if f.near else -abs(f.depth), f.program,
                                               f.line, f.face or ""))
    seen: dict[str, int] = {}
    sure: list[int] = []
    more: list[int] = []
    for k, f in enumerate(by_grade):
        seen[str(f.kind)] = seen.get(str(f.kind), 0) + 1
        (sure if seen[str(f.kind)] <= KEPT_OF_A_KIND else more).append(k)
    kept = sorted(sure + more[:MAX_FINDINGS - len(sure)])
    return tuple(by_grade[k] for k in kept), dict(sorted(counts.items()))


def _point(p: F64) -> tuple[float, float, float]:
    return round(float(p[0]), 6), round(float(p[1]), 6), round(float(p[2]), 6)


def _span(lines: I32) -> str:
    first, last = int(lines.min()), int(lines.max())
    return "" if first == last else f", lines {first} to {last}"
