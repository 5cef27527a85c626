"""What a person sees of a proof: the deviation map, and the machined part as a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.errors import InputError
from geometry.mesh import F64
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from geometry.stl import stl_bytes
from geometry.tool_body import ToolBody
from service.deviation import COLOURS, Mark, Measured, draw_deviation
from verify.checks.program_sequence import Given
from verify.material.machined_part import check_step, machined_stock, surface_error
from verify.model import Finding, FindingKind, Proof, ProofSetup
from verify.progress import Report

MESH_NAME, MAP_NAME = "machined.stl", "deviation.png"
MOST_GOUGES = 4


@dataclass(frozen=True, eq=False)
class MeshWish:
    """The mesh of the machined part that is asked for.

    step : mm between nodes; box : (2, 3) float64, mm, a window in the coordinates of the program, or None
    """

    step: float
    box: F64 | None = None

    @classmethod
    def of(cls, step: float, box: str | None) -> MeshWish:
        """From what was written: ``box`` as 'x0,y0,z0,x1,y1,z1'.

        Raises
        ------
        InputError
            ``bad_mesh_step``, ``bad_mesh_box``.
        """
        check_step(step)
        if box is None:
            return cls(step)
        try:
            numbers = [float(v) for v in box.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != 6:
            raise InputError(f"the window of the machined part is no six numbers: {box}", code="bad_mesh_box",
                             measured=box, remedy="give x0,y0,z0,x1,y1,z1 in mm, the lower corner first")
        return cls(step, np.array(numbers).reshape(2, 3))


def machined_part(wish: MeshWish, programs: Sequence[Given], part: Part, tools: Sequence[ToolBody],
                  setup: ProofSetup, progress: Report, *, spindle_tool: int = 0) -> tuple[dict[str, Any], bytes]:
    """The machined part as figures for the report, file and access left out, and as a binary STL file.

    programs, part, tools, setup, spindle_tool : as ``verify.material.machined_part.machined_stock`` takes them, and errors as it
        raises them; ``nothing_stands`` (InputError) where the window holds no stock
    """
    field = machined_stock(programs, part, tools, setup, wish.step, box=wish.box, spindle_tool=spindle_tool,
                           progress=progress)
    mesh = field.surface()
    if not len(mesh.faces):
        raise InputError("nothing stands in the window of the machined part", code="nothing_stands",
                         measured=None if wish.box is None else wish.box.tolist(),
                         remedy="give a window that holds some of the part, or a finer step")
    figures = {"volume_mm3": round(field.volume, 4), "step_mm": round(field.step, 6),
               "error_mm": round(surface_error(field.step, setup.kinematics is not None), 6),
               "box_mm": np.round(mesh.bounds, 4).tolist(), "triangles": len(mesh.faces)}
    return figures, stl_bytes(mesh)


def draw_proof(part: Part, samples: SurfaceSamples, proof: Proof, setup: ProofSetup, state: str, coverage: float,
               path: Path, title: str) -> None:
    """Draw the deviation map of a proof.

    part, samples : in the frame in which ``proof`` has the places of its findings; the samples of its residuals
    state, coverage : of the report
    """
    excess = proof.residual - setup.stock_allowance
    measured = Measured(samples, excess, proof.program >= 0, setup.scallop_height, setup.gouge_tolerance)
    gouges = sorted((f for f in proof.findings if f.kind == FindingKind.GOUGE and f.point is not None),
                    key=lambda f: -f.depth)
    marks = [Mark(np.array([f.point]), f"{f.depth:.3g} mm too deep{_at(f)}", COLOURS[1])
             for f in gouges[:MOST_GOUGES] if f.point is not None]
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
    """Where most is left, and in words; no mark where that is within the budget."""
    if not len(excess):
        return None, "nothing judged"
    row = int(np.argmax(excess))
    capped = "or more " if proof.residual[row] >= proof.reach - 1e-9 else ""
    text = f"{max(float(excess[row]), 0.0):.3g} mm {capped}left"
    if excess[row] <= setup.scallop_height + 1e-6:
        return None, f"{text}, F{samples.face[row]}"
    equal = np.flatnonzero((excess >= excess[row] - 1e-9) & (samples.face == samples.face[row]))
    return Mark(samples.points[equal], f"{text}, F{samples.face[row]}", COLOURS[5]), f"{text}, F{samples.face[row]}"
