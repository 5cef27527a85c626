"""The machined part as a mesh: the requested one, its figures and its STL file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.errors import InputError
from geometry.mesh import F64
from geometry.part import Part
from geometry.stl import stl_bytes
from geometry.tool_body import ToolBody
from verify.checks.program_sequence import Given
from verify.material.machined_part import check_step, machined_stock, surface_error
from verify.model import ProofSetup
from verify.progress import Report

MESH_NAME = "machined.stl"


@dataclass(frozen=True, eq=False)
class MeshWish:
    """The requested mesh of the machined part.

    step : mm between nodes
    box  : (2, 3) float64, mm, a window in the coordinates of the program; None: the whole part
    """

    step: float
    box: F64 | None = None

    @classmethod
    def of(cls, step: float, box: str | None) -> MeshWish:
        """From the text of a request: ``box`` as 'x0,y0,z0,x1,y1,z1'.

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
            raise InputError(f"the window of the machined part must be six numbers, not {box}", code="bad_mesh_box",
                             measured=box, remedy="give x0,y0,z0,x1,y1,z1 in mm, the lower corner first")
        return cls(step, np.array(numbers).reshape(2, 3))


def machined_part(wish: MeshWish, programs: Sequence[Given], part: Part, tools: Sequence[ToolBody],
                  setup: ProofSetup, progress: Report, *, spindle_tool: int = 0) -> tuple[dict[str, Any], bytes]:
    """Figures of the machined part for the report, without file and access, and its binary STL file.

    programs, part, tools, setup, spindle_tool : as ``verify.material.machined_part.machined_stock`` takes them

    Raises
    ------
    InputError
        Code 'nothing_stands': the window holds no stock; else as ``machined_stock``.
    """
    field = machined_stock(programs, part, tools, setup, wish.step, box=wish.box, spindle_tool=spindle_tool,
                           progress=progress)
    mesh = field.surface()
    if not len(mesh.faces):
        raise InputError("the window of the machined part holds no stock", code="nothing_stands",
                         measured=None if wish.box is None else wish.box.tolist(),
                         remedy="give a window that overlaps the part, or a finer step")
    figures = {"volume_mm3": round(field.volume, 4), "step_mm": round(field.step, 6),
               "error_mm": round(surface_error(field.step, setup.kinematics is not None), 6),
               "box_mm": np.round(mesh.bounds, 4).tolist(), "triangles": len(mesh.faces)}
    return figures, stl_bytes(mesh)
