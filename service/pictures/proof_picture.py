"""Pictures of a proof: the deviation map, and the machined part as a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.mesh import F64
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from service.pictures.deviation_map import COLOURS, Mark, Measured, draw_deviation
from verify.model import Finding, FindingKind, Proof, ProofSetup

MAP_NAME = "deviation.png"
MAX_GOUGE_MARKS = 4


def draw_proof(part: Part, samples: SurfaceSamples, proof: Proof, setup: ProofSetup, state: str, coverage: float,
               path: Path, title: str) -> None:
    """Draw the deviation map of a proof.

    part, samples : in the frame of the places of the findings; ``samples`` are those of the residuals
    state, coverage : of the report
    """
    excess = proof.residual - setup.stock_allowance
    measured = Measured(samples, excess, proof.program >= 0, setup.scallop_height, setup.gouge_tolerance)
    gouges = sorted((f for f in proof.findings if f.kind == FindingKind.GOUGE and f.point is not None),
                    key=lambda f: -f.depth)
    marks = [Mark(np.array([f.point]), f"{f.depth:.3g} mm too deep{_at(f)}", COLOURS[1])
             for f in gouges[:MAX_GOUGE_MARKS] if f.point is not None]
    most, left = _most_left(samples, excess, proof, setup)
    if most is not None:
        marks.append(most)
    uncut = sum(f.uncut for f in proof.faces.values())
    deepest = f"{gouges[0].depth:.3g} mm{_at(gouges[0])}" if gouges else \
        f"none; {proof.gouge_max:.2g} mm is within tolerance"
    facts = {"state": f"{state}, {sum(proof.counts.values())} findings of the proof",
             "coverage": f"{100 * coverage:.2f} % within the budget",
             "deepest gouge": deepest, "most left": left, "never reached": f"{uncut:.1f} mm2 above the budget"}
    draw_deviation(part, measured, marks, path, title, facts)


def _at(f: Finding) -> str:
    return (f", {f.face}" if f.face else "") + (f", line {f.line}" if f.line else "")


def _most_left(samples: SurfaceSamples, excess: F64, proof: Proof, setup: ProofSetup) -> tuple[Mark | None, str]:
    """The place with most stock left, and its text; no mark where that is within the budget."""
    if not len(excess):
        return None, "nothing judged"
    row = int(np.argmax(excess))
    capped = "or more " if proof.residual[row] >= proof.reach - 1e-9 else ""
    text = f"{max(float(excess[row]), 0.0):.3g} mm {capped}left"
    if excess[row] <= setup.scallop_height + 1e-6:
        return None, f"{text}, F{samples.face[row]}"
    equal = np.flatnonzero((excess >= excess[row] - 1e-9) & (samples.face == samples.face[row]))
    return Mark(samples.points[equal], f"{text}, F{samples.face[row]}", COLOURS[5]), f"{text}, F{samples.face[row]}"
