"""One valid, closed solid from the shapes of the file, or an error with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepLib import BRepLib
from OCP.ShapeCustom import ShapeCustom
from OCP.ShapeFix import ShapeFix_Shape
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_ListOfShape

from geometry.errors import PartError
from geometry.step_import.occ.gaps import free_edge_gap, free_edges
from geometry.step_import.occ.topology import Shape, box_of, edges_of, faces_of, shells_of, solids_of, volume_of

# Faces farther apart than this do not belong together. Sewing must stay below the size of machined features.
SEWING_TOLERANCE = 0.01
# Bodies nearer than this count as one; well above the kernel's 1e-7, well below any cutting tolerance.
FUSE_TOLERANCE = 1e-4
STRAY_VOLUME = 1e-5
STRAY_WIDTH = 0.2
# A clean-up after fusing that changes the volume by more than this share did more than merge faces.
UNIFY_VOLUME = 1e-6


def one_solid(shape: Shape, solid: int | None, warnings: list[str]) -> Shape:
    """Reduce a shape to the one solid to machine.

    shape    : kernel shape, mm
    solid    : 1-based number among the separate solids, None when there must be only one
    warnings : sentences are appended for every change made

    Returns a closed kernel solid with its normals outward.
    Raises PartError (``open_shell``, ``several_solids``, ``no_such_solid``).
    """
    solids = solids_of(shape)
    if solids:
        loose = len(faces_of(shape)) - sum(len(faces_of(s)) for s in solids)
        if loose > 0:
            warnings.append(f"{loose} loose faces outside the solids were left out")
    else:
        solids = [_sewn(shape, warnings)]
    if len(solids) > 1:
        solids = _fused(_without_strays(solids, warnings), warnings)
    return _outward(_valid(_chosen(solids, solid), warnings), warnings)


def swept_as_splines(solid: Shape) -> Shape:
    """The same solid with extruded and revolved surfaces written as splines, which is exact.

    The kernel's mesher ignores the chord inside swept surfaces and fills them with needless points. A wall meshed for
    0.005 mm was 0.057 mm off with 7962 triangles as a swept surface, and 0.0023 mm off with 236 as a spline. Faces keep
    their numbers. Where the rewriting fails, the solid comes back unchanged.
    """
    out = ShapeCustom.ConvertToBSpline_s(solid, True, True, False, False)
    if len(solids_of(out)) != 1 or len(faces_of(out)) != len(faces_of(solid)):
        return solid
    # the kernel integrates swept surfaces coarsely (0.05 % off on the wall above), so this catches gross errors only
    before = volume_of(solid)
    if abs(volume_of(out) - before) > 5e-3 * abs(before) or free_edges(out):
        return solid
    return solids_of(out)[0]


def _sewn(shape: Shape, warnings: list[str]) -> Shape:
    faces = faces_of(shape)
    tolerance, sewn, free = 0.0, None, 0
    for tolerance in (SEWING_TOLERANCE / 100, SEWING_TOLERANCE / 10, SEWING_TOLERANCE):
        tool = BRepBuilderAPI_Sewing(tolerance)
        for face in faces:
            tool.Add(face)
        tool.Perform()
        sewn, free = tool.SewedShape(), tool.NbFreeEdges()
        if free == 0:
            break
    shells = shells_of(sewn)
    if free or len(shells) == 0:
        gap = free_edge_gap([tool.FreeEdge(i + 1) for i in range(free)])
        raise PartError(
            f"the file holds {len(faces)} faces that do not close to a solid: {free} edges stay free after sewing "
            f"within {SEWING_TOLERANCE:g} mm, the largest gap between neighbours is {gap:.4g} mm",
            code="open_shell", measured={"free_edges": free, "largest_gap_mm": gap}, limit=SEWING_TOLERANCE,
            remedy="close the body in the CAD system (knit or stitch the surfaces) and export a solid")
    maker = BRepBuilderAPI_MakeSolid()
    for shell in shells:
        maker.Add(shell)
    warnings.append(f"{len(faces)} loose faces were sewn into a solid within {tolerance:g} mm")
    return maker.Solid()


def _without_strays(solids: list[Shape], warnings: list[str]) -> list[Shape]:
    volumes = [abs(volume_of(s)) for s in solids]
    largest = max(volumes)
    kept = []
    for number, (body, volume) in enumerate(zip(solids, volumes, strict=True), 1):
        box = box_of(body)
        size = box[1] - box[0]
        if volume < STRAY_VOLUME * largest and size.min() < STRAY_WIDTH:
            warnings.append(f"solid {number} of the file was dropped as a stray sliver: {_size(size)} mm, "
                            f"{volume:.2g} mm³, at {_point(box.mean(axis=0))}")
        else:
            kept.append(body)
    return kept


def _fused(solids: list[Shape], warnings: list[str]) -> list[Shape]:
    out = []
    for group in _groups([box_of(s) for s in solids]):
        bodies = [solids[i] for i in group]
        out += bodies if len(bodies) == 1 else _fuse(bodies, warnings)
    return out


def _groups(boxes: Sequence[np.ndarray]) -> list[list[int]]:
    """Indices of solids whose boxes overlap in groups, in order of their first member."""
    left, groups = list(range(len(boxes))), []
    while left:
        group, todo = [left[0]], [left.pop(0)]
        while todo:
            here = boxes[todo.pop()]
            near = [i for i in left if (boxes[i][0] <= here[1] + FUSE_TOLERANCE).all()
                    and (here[0] <= boxes[i][1] + FUSE_TOLERANCE).all()]
            left = [i for i in left if i not in near]
            group += near
            todo += near
        groups.append(sorted(group))
    return groups


def _fuse(bodies: list[Shape], warnings: list[str]) -> list[Shape]:
    """Union of bodies; bodies that share no volume and no face area stay separate."""
    first, rest = TopTools_ListOfShape(), TopTools_ListOfShape()
    first.Append(bodies[0])
    for body in bodies[1:]:
        rest.Append(body)
    tool = BRepAlgoAPI_Fuse()
    tool.SetArguments(first)
    tool.SetTools(rest)
    tool.SetFuzzyValue(FUSE_TOLERANCE)
    tool.SetNonDestructive(True)
    tool.Build()
    fused = solids_of(tool.Shape()) if tool.IsDone() else []
    total, kept = sum(abs(volume_of(b)) for b in bodies), sum(abs(volume_of(f)) for f in fused)
    if not fused or kept > total * (1 + 1e-6) or kept < max(abs(volume_of(b)) for b in bodies) * (1 - 1e-6):
        raise PartError(f"{len(bodies)} solids touch or overlap and could not be fused into one",
                        code="several_solids", measured=len(bodies), limit=1,
                        remedy="unite the bodies in the CAD system and export one solid")
    if len(fused) < len(bodies):
        warnings.append(f"{len(bodies)} solids that touch or overlap were fused into {len(fused)}")
        fused = [_unified(f) for f in fused]
    return fused


def _unified(solid: Shape) -> Shape:
    """The solid with faces of one surface merged again after the fuse, where nothing else changes."""
    tool = ShapeUpgrade_UnifySameDomain(BRepBuilderAPI_Copy(solid).Shape(), True, True, False)
    tool.Build()
    merged = solids_of(tool.Shape())
    before = volume_of(solid)
    if len(merged) != 1 or abs(volume_of(merged[0]) - before) > UNIFY_VOLUME * abs(before):
        return solid
    if BRepCheck_Analyzer(solid).IsValid() and not BRepCheck_Analyzer(merged[0]).IsValid():
        return solid
    return merged[0]


def _chosen(solids: list[Shape], solid: int | None) -> Shape:
    if solid is not None:
        if not 1 <= solid <= len(solids):
            raise PartError(f"solid {solid} does not exist; the file holds {len(solids)} solids", code="no_such_solid",
                            subjects=(f"solid {solid}",), measured=solid, limit=len(solids),
                            remedy=f"name a solid from 1 to {len(solids)}:\n" + _listing(solids))
        return solids[solid - 1]
    if len(solids) > 1:
        raise PartError(f"the file holds {len(solids)} separate solids; a job needs one:\n" + _listing(solids),
                        code="several_solids", subjects=tuple(f"solid {i + 1}" for i in range(len(solids))),
                        measured=len(solids), limit=1,
                        remedy="name one with part.solid in the setup, or export it alone")
    return solids[0]


def _listing(solids: list[Shape]) -> str:
    lines = []
    for number, body in enumerate(solids, 1):
        box = box_of(body)
        lines.append(f"solid {number}: {_size(box[1] - box[0])} mm at {_point(box.mean(axis=0))}, "
                     f"{abs(volume_of(body)):.4g} mm³")
    return "\n".join(lines[:20] + ([f"and {len(lines) - 20} more"] if len(lines) > 20 else []))


def _valid(solid: Shape, warnings: list[str]) -> Shape:
    if BRepCheck_Analyzer(solid).IsValid():
        return solid
    # the fixer widens tolerances in place, so it works on a copy
    fixer = ShapeFix_Shape(BRepBuilderAPI_Copy(solid).Shape())
    fixer.Perform()
    fixed = solids_of(fixer.Shape())
    if len(fixed) == 1 and _is_better(fixed[0], solid):
        warnings.append("the solid had faults in its topology, which were repaired")
        return fixed[0]
    warnings.append(f"the CAD kernel finds faults in the solid that it could not repair (edges up to "
                    f"{_tolerance(solid):.3g} mm off their faces); look at the deviation of the mesh")
    return solid


def _is_better(fixed: Shape, solid: Shape) -> bool:
    """Whether a repair neither changes the volume nor only widens tolerances."""
    before = volume_of(solid)
    return (BRepCheck_Analyzer(fixed).IsValid() and abs(volume_of(fixed) - before) <= 1e-4 * abs(before)
            and _tolerance(fixed) <= max(1.5 * _tolerance(solid), SEWING_TOLERANCE))


def _tolerance(solid: Shape) -> float:
    return max((BRep_Tool.Tolerance_s(e) for e in edges_of(solid)), default=0.0)


def _outward(solid: Shape, warnings: list[str]) -> Shape:
    edges = [e for s in shells_of(solid) for e in free_edges(s)]
    if edges:
        gap = free_edge_gap(edges)
        raise PartError(f"the solid is open: {len(edges)} free edges, the largest gap between neighbours is "
                        f"{gap:.4g} mm", code="open_shell",
                        measured={"free_edges": len(edges), "largest_gap_mm": gap}, limit=SEWING_TOLERANCE,
                        remedy="close the body in the CAD system and export it again")
    if volume_of(solid) < 0:
        warnings.append("the solid was inside out; its orientation was reversed")
        turned = TopoDS.Solid_s(solid)
        BRepLib.OrientClosedSolid_s(turned)
        return turned
    return solid


def _size(size: np.ndarray) -> str:
    return " x ".join(f"{x:.4g}" for x in size)


def _point(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
