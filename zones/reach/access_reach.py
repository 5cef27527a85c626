"""Samples that every tool reaches along one access direction, and the order of the tools."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from zones.features.connection_faces import connection_faces
from zones.machinable_area import LEVEL, AreaForm, forms_of
from zones.model import Decomposition
from zones.reach.access_view import View
from zones.reach.tip_field import touchable


@dataclass(frozen=True, eq=False)
class Reach:
    """Reach of one tool in one view: samples that its cutting part or the whole tool touches, and the tips."""

    by_cutter: NDArray[np.bool_]
    by_tool: NDArray[np.bool_]
    tips: F64



PREFERRED = {"flat": 0.0, "bull": 1.0, "lens": 2.0, "barrel": 3.0, "ball": 3.0}
"""Order of the ends on level planes: flats, and then those that leave lower scallops."""

def able(tool: ToolBody, normals: F64, scallop: float) -> NDArray[np.bool_]:
    """(n,) bool: a strategy exists for this tool on samples with these normals.

    normals : (n, 3) float64, dimensionless, access frame

    A tool with a corner radius cuts everything. A sharp-cornered flat end cuts level planes, and walls so upright that
    steps of at least 0.1 mm keep the scallop. Where the rim of a circle segment mill would touch, it is as sharp.
    """
    nz = normals[:, 2]
    upright = np.abs(nz) <= 0.5 * scallop / 0.1
    if tool.arcs is not None:
        steepest = tool.arcs.end_sine if tool.arcs.bow > 0.0 else tool.arcs.join_sine
        return np.asarray((np.sqrt(np.maximum(1.0 - nz * nz, 0.0)) <= steepest + 1e-9) | upright)
    if tool.corner_radius > 0:
        return np.ones(len(normals), np.bool_)
    return np.asarray((nz > LEVEL) | upright)


def preference(tool: ToolBody, form: AreaForm) -> tuple[float, float, float, float]:
    """Sort key of the tools for a form, best first: flat ends on level planes, then stout and short ones.

    Of two ends of one diameter that of the wider cone is the stouter tool.
    """
    kind = PREFERRED[tool.end] if form is AreaForm.LEVEL else 0.0
    return (kind, -tool.diameter, -tool.taper, tool.stickout)


def connection_bands(view: View, decomposition: Decomposition) -> dict[str, list[tuple[float, float]]]:
    """Least and greatest height of each connection in a view, mm, by the channels and walls it bridges."""
    out: dict[str, list[tuple[float, float]]] = {}
    mesh, spans = view.part.mesh, connection_faces(view.part, decomposition)
    for c in decomposition.connections:
        z = mesh.triangles[np.isin(mesh.face_ids, spans[c.id])][:, :, 2]
        if not z.size:
            continue
        for h in decomposition.channels:
            if set(h.walls) <= set(c.walls):
                out.setdefault(h.id, []).append((float(z.min()), float(z.max())))
    return out


class Sight:
    """One view with the reach of its tools.

    known : Reach by tool id from an earlier computation with the same samples
    """

    def __init__(self, view: View, decomposition: Decomposition, scallop: float, lift: float,
                 known: Mapping[str, Reach] | None = None) -> None:
        self.view, self.samples = view, view.samples
        self.form = forms_of(self.samples.normals)
        self.can = {t: able(f.tool, self.samples.normals, scallop) for t, f in view.fields.items()}
        self.reach = dict(known or {})
        for t, f in view.fields.items():
            if t not in self.reach:
                self.reach[t] = Reach(*touchable(f, self.samples.points, self.samples.normals, lift))
        self.bands = connection_bands(view, decomposition)

    def gets(self, tool: str) -> NDArray[np.bool_]:
        """(n,) bool: samples that this tool can finish along this view."""
        return np.asarray(self.can[tool] & self.reach[tool].by_tool)

    def order(self, form: AreaForm) -> list[str]:
        """Ids of the tools, best first."""
        return sorted(self.view.fields, key=lambda t: (*preference(self.view.fields[t].tool, form), t))

    def groups(self, rows: NDArray[np.bool_]) -> list[tuple[str, AreaForm, NDArray[np.int64]]]:
        """Groups of samples to share out, in a fixed order: base region with its place, form, (k,) int64 index.

        rows : (n,) bool, samples to share out
        """
        labels = self.view.labels
        names, ground = np.unique([r.ground for r in labels.regions], return_inverse=True)
        selected = np.flatnonzero(rows)
        base = ground[labels.code[selected]]
        out = []
        for k in np.unique(base):
            mine = selected[base == k]
            for form in AreaForm:
                members = mine[self.form[mine] == form]
                if len(members):
                    out.append((str(names[k]), form, members))
        return out
