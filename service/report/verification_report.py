"""The report of a program of any origin: state, findings, and the area that is neither proved nor a finding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from service.estimate.job_estimate import estimate_of
from service.report.report import (
    REMAINDER_FLOOR_MM2,
    counted,
    deviation,
    faces,
    inputs_of,
    of_job,
    part_of,
    r,
    support_of,
    time_of,
    too_little,
)
from service.stages.cautions import exceeded, unheld
from service.stages.job_part import JobPart
from service.version import VERSION
from verify.model import HARMLESS, FindingKind, Proof, WorkDone

I64 = NDArray[np.int64]


def verification_report(job: JobPart, proof: Proof, dense: SurfaceSamples) -> tuple[dict[str, Any], I64]:
    """The answer to ``zonemill verify``.

    proof : its places are in the setup frame
    dense : SurfaceSamples of the proof, n of them, setup frame

    Returns
    -------
    dict, (n,) int64, index
        The report; the entry of its remainder for each sample, -1 for none.
    """
    total = float(dense.area.sum())
    done = float(dense.area[np.asarray(proof.proved, dtype=np.bool_)].sum())
    coverage = done / total if total else 0.0
    unmet = too_little(coverage, job.inputs.quality.coverage_min)
    if proof.cutting_length <= 0.0 and FindingKind.NOTHING_CUT not in proof.counts:
        unmet.append(of_job("nothing_cut", "the program removes no stock"))
    findings, counts = [*(f.as_dict() for f in proof.findings), *unmet], counted(proof, unmet)
    remainder, entry = _remainder(dense, proof.work)
    return {"state": state_of(counts), "findings": findings, "finding_counts": counts, "inputs": inputs_of(job),
            "estimate": estimate_of(job, "verify").as_dict(),
            "asked": _asked(job, proof.work), "remainder": remainder,
            "coverage": r(coverage, 6), "gouge_max_mm": r(proof.gouge_max, 5),
            "machining_time_s": r(proof.spent.seconds, 1), "time": time_of(proof),
            "cutting_length_mm": r(proof.cutting_length, 1),
            "proof": {"samples": len(dense), "error_bound_mm": proof.error_bound,
                      "stock_line_spacing_mm": proof.line_spacing, "notes": list(proof.notes),
                      "support": support_of(proof), "assumed": [a.as_dict() for a in proof.assumed]},
            "warnings": [c.as_dict() for c in (*unheld(proof.support), *exceeded(job.inputs, proof.cautions))],
            "deviation": deviation(proof), "machined": None, "files": [],
            "part": part_of(job), "version": VERSION}, entry


def state_of(counts: Mapping[str, int]) -> str:
    """State of a verification: 'proved' without findings, 'clean' where all of them tell of work not done.

    counts : findings by kind

    >>> state_of({}), state_of({"stock_left": 2}), state_of({"stock_left": 2, "gouge": 1})
    ('proved', 'clean', 'unproved')
    """
    found = {kind for kind, number in counts.items() if number}
    return "proved" if not found else "clean" if found <= {str(kind) for kind in HARMLESS} else "unproved"


def _asked(job: JobPart, work: WorkDone | None) -> dict[str, Any]:
    """The faces that had to be within tolerance, and who named them."""
    ops = job.inputs.operations
    by = "nothing" if not ops.finishing else "program" if ops.faces is None else "setup"
    return {"by": by, "faces": [] if work is None else faces(work.faces)}


def _remainder(dense: SurfaceSamples, work: WorkDone | None) -> tuple[list[dict[str, Any]], I64]:
    """Area that stays and is no finding, by reason, the largest first; entry of each sample, (n,) int64, or -1."""
    entry = np.full(len(dense), -1, np.int64)
    if work is None:
        return [], entry
    found: list[tuple[float, str, I64]] = []
    for reason in sorted(set(work.reason.tolist()) - {""}):
        mine = np.flatnonzero(work.reason == reason)
        area = float(dense.area[mine].sum())
        if area >= REMAINDER_FLOOR_MM2:
            found.append((area, str(reason), mine))
    found.sort(key=lambda item: (-item[0], item[1]))
    out: list[dict[str, Any]] = []
    for k, (area, reason, mine) in enumerate(found):
        entry[mine] = k
        face = dense.face[mine]
        numbers = tuple(int(n) for n in np.unique(face))
        middle = dense.points[mine[len(mine) // 2]]
        out.append({"faces": faces(numbers), "area_mm2": r(area, 3), "reason": reason, "would_need": {},
                    "tool_at_hand": None, "why_left": None, "at_mm": [r(v) for v in middle.tolist()],
                    "patches": _patches(dense, mine, numbers)})
    return out, entry


def _patches(dense: SurfaceSamples, rows: I64, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Area on each face and its box in the setup frame."""
    out = []
    for n in numbers:
        own = rows[dense.face[rows] == n]
        p = dense.points[own]
        out.append({"face": f"F{n}", "area_mm2": r(float(dense.area[own].sum()), 3),
                    "box_mm": [[r(v) for v in corner] for corner in (p.min(axis=0).tolist(), p.max(axis=0).tolist())]})
    return out


__all__ = ["state_of", "verification_report"]
