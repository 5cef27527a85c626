"""Necks, shanks and holders as rows for the kernels: float64, mm, in the tool frame (tip at the origin, axis Z)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.stock import HOLDER, NECK, SHANK
from verify.kernels.tables import ToolArrays
from verify.model import ProofSetup

NO_HOLDER = 200.0  # mm, length of shank above the stickout where the setup names no holder
NOSE_LENGTH = 200.0  # mm, height of the spindle nose


@dataclass(frozen=True, eq=False)
class Bodies:
    """Neck, shank and holder rows of all tools (see ``verify.kernels.stock``).

    rows  : (r, 6) float64, mm: z0, z1, r0, r1, clearance, and the part code
    first : (k + 1,) int64, index: rows first[k]:first[k + 1] belong to tool k
    """

    rows: F64
    first: NDArray[np.int64]

    @classmethod
    def of(cls, tools: Sequence[ToolBody], setup: ProofSetup) -> Bodies:
        """Rows (z0, z1, r0, r1, clearance, part) of tools; the radii include the clearance."""
        rows: list[tuple[float, ...]] = []
        first = [0]
        for tool in tools:
            for z0, z1, r0, r1, clearance, part in _frusta(tool, setup):
                if z1 <= z0:
                    continue
                if max(r0, r1) <= tool.widest_radius + 1e-6:
                    clearance = min(clearance, max(tool.widest_radius - max(r0, r1), 0.0))
                rows.append((z0, z1, r0 + clearance, r1 + clearance, clearance, part))
            first.append(len(rows))
        return cls(np.array(rows, dtype=np.float64).reshape(-1, 6), np.array(first, dtype=np.int64))

    @classmethod
    def none(cls, tools: Sequence[ToolBody]) -> Bodies:
        """No rows: only the cutting parts of the tools are there."""
        return cls(np.zeros((0, 6)), np.zeros(len(tools) + 1, np.int64))

    def arrays(self, cutters: F64, ends: F64) -> ToolArrays:
        """The tools for kernels.

        cutters : (k, 9) float64, mm, tool frame, as ``cutter_table``
        ends    : (k,) float64, mm, as ``end_radii``
        """
        return ToolArrays(cutters, ends, self.reach(cutters), self.rows, self.first)

    def reach(self, cutters: F64) -> F64:
        """Largest distance of each assembly from its tip.

        cutters : (k, 9) float64, mm, tool frame, as ``cutter_table``

        Returns (k,) float64, mm.
        """
        out = np.hypot(cutters[:, 0], cutters[:, 2])
        for k in range(len(out)):
            own = self.rows[self.first[k]:self.first[k + 1]]
            out[k] = max(out[k], np.hypot(np.maximum(own[:, 2], own[:, 3]), own[:, 1]).max(initial=0.0))
        return np.asarray(out)

    def width(self, cutters: F64) -> float:
        """Largest radius of all assemblies, mm.

        cutters : (k, 9) float64, mm, tool frame, as ``cutter_table``
        """
        return float(max(cutters[:, 0].max(initial=0.0), self.rows[:, 2:4].max(initial=0.0)))


def nose_placed(tool: ToolBody, setup: ProofSetup) -> bool:
    """Whether holder or gauge length say how high over the tip the spindle nose is."""
    return bool(tool.holder) or tool.number in setup.gauge_given


def _frusta(tool: ToolBody, setup: ProofSetup) -> list[tuple[float, float, float, float, float, int]]:
    neck, shank = 0.5 * tool.neck_diameter, 0.5 * tool.shank_diameter
    top = max(tool.neck_length, tool.flute_length)
    out = [(tool.flute_length, top, neck, neck, tool.neck_clearance(setup.clearance_neck), NECK),
           (top, max(tool.stickout, top), shank, shank, setup.clearance_shank, SHANK)]
    z = tool.stickout
    for part in tool.holder:
        out.append((z, z + part.length, 0.5 * part.diameter, 0.5 * part.diameter_top, setup.clearance_holder, HOLDER))
        z += part.length
    if setup.nose_diameter is not None and nose_placed(tool, setup):
        face, nose = max(z, setup.gauge_length.get(tool.number, z)), 0.5 * setup.nose_diameter
        out.append((face, face + NOSE_LENGTH, nose, nose, setup.clearance_holder, HOLDER))
    if not tool.holder:
        # the holder is unknown: at least the shank goes on
        out.append((max(z, top), max(z, top) + NO_HOLDER, shank, shank, setup.clearance_shank, SHANK))
    return out
