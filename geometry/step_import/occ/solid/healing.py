"""One valid, closed solid from the shapes of the file, or an error with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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

from geometry.connected_components import connected_components
from geometry.errors import PartError
from geometry.step_import.occ.solid.consistency import check_edges
from geometry.step_import.occ.solid.gaps import free_edge_gap, free_edges
from geometry.step_import.occ.solid.meetings import FUSE_TOLERANCE, Meeting, Share, box_groups, meetings, split_bodies
from geometry.step_import.occ.solid.products import Product
from geometry.step_import.occ.topology import Shape, box_of, edges_of, faces_of, shells_of, solids_of, volume_of

# Faces farther apart than this do not belong together. Sewing must stay below the size of machined features.
SEWING_TOLERANCE = 0.01
STRAY_VOLUME = 1e-5
STRAY_WIDTH = 0.2
# A clean-up after fusing that changes the volume by more than this share did more than merge faces.
UNIFY_VOLUME = 1e-6
# Bodies of different products with more faces than this are not searched for places where they touch.
MAX_SEARCHED_FACES = 400
SHOWN = 20  # lines of a list in an error
TOUCH = {Share.POINT: "only touches {} at the point", Share.LINE: "only touches {} along an edge at",
         Share.FACE: "only touches {} on a face at", Share.MATERIAL: "overlaps {} at"}


@dataclass(frozen=True)
class Body:
    """A solid of the file.

    shape    : kernel solid, mm
    products : that it comes from; several where they were fused
    """

    shape: Shape
    products: tuple[Product, ...]

    @property
    def name(self) -> str:
        """Names of its products."""
        return ", ".join(dict.fromkeys(p.name for p in self.products if p.name))

    @property
    def paths(self) -> set[tuple[int, ...]]:
        """Paths of its products."""
        return {p.path for p in self.products}


def one_solid(products: Sequence[Product], solid: int | None, warnings: list[str], *,
              fuse: bool = False, uncertainty: float = 0.0) -> tuple[Shape, list[tuple[int, Body]]]:
    """Reduce the products of a file to the one solid to machine.

    products : Product each
    solid    : 1-based number among the separate solids, None when there must be only one
    warnings : sentences are appended for every change made
    fuse     : all products are one part: bodies that overlap or share a face are united, also those of two products
    uncertainty : mm, that the file states of its lengths

    Returns a closed kernel solid with its normals outward, and the other bodies with their numbers.

    Raises
    ------
    PartError
        ``open_shell``, ``several_solids``, ``no_such_solid``, ``inconsistent_faces``.

    Notes
    -----
    Bodies of one product that overlap are one solid. So are overlapping bodies of a product and of one that it places
    beside its own, since some programs write groups of bodies like that. Without ``fuse``, bodies of other products
    stay separate, and so does a body that only touches another one.
    """
    bodies = _bodies(products, warnings)
    met: list[Meeting] = []
    if len(bodies) > 1:
        bodies = _without_strays(bodies, warnings)
    if len(bodies) > 1:
        bodies, met = _united(bodies, solid, fuse, warnings)
    if solid is not None and len(bodies) > 1:
        warnings.append(f"solid {solid} of {len(bodies)} is the part; the others count only where the setup has "
                        "part.others: fixtures")
    chosen = _chosen(bodies, solid, met, fuse)
    others = [(n, b) for n, b in enumerate(bodies, 1) if b.shape is not chosen]
    check_edges(chosen, uncertainty, warnings)
    return _outward(_valid(chosen, warnings), warnings), others


def _bodies(products: Sequence[Product], warnings: list[str]) -> list[Body]:
    """The solids of all products; without any, one sewn from all faces."""
    out, loose = [], 0
    for product in products:
        own = solids_of(product.shape)
        loose += max(len(faces_of(product.shape)) - sum(len(faces_of(s)) for s in own), 0)
        out += [Body(s, (product,)) for s in own]
    if not out:
        faces = [f for product in products for f in faces_of(product.shape)]
        return [Body(_sewn(faces, warnings), tuple(products))]
    if loose:
        warnings.append(f"{loose} loose faces outside the solids were left out")
    return out


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


def _sewn(faces: list[Shape], warnings: list[str]) -> Shape:
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


def _without_strays(bodies: list[Body], warnings: list[str]) -> list[Body]:
    volumes = [abs(volume_of(b.shape)) for b in bodies]
    largest = max(volumes)
    kept = []
    for number, (body, volume) in enumerate(zip(bodies, volumes, strict=True), 1):
        box = box_of(body.shape)
        size = box[1] - box[0]
        if volume < STRAY_VOLUME * largest and size.min() < STRAY_WIDTH:
            warnings.append(f"solid {number} of the file was dropped as a stray sliver: {_size(size)} mm, "
                            f"{volume:.2g} mm³, at {_point(box.mean(axis=0))}")
        else:
            kept.append(body)
    return kept


def _united(bodies: list[Body], solid: int | None, fuse: bool,
            warnings: list[str]) -> tuple[list[Body], list[Meeting]]:
    """Bodies after uniting those that are one solid, in order of their first member; how the others meet."""
    met: list[Meeting] = []
    splits: dict[int, Shape] = {}
    for group in box_groups([box_of(b.shape) for b in bodies]):
        some = any(_one_part(bodies[i], bodies[j]) for i in group for j in group if i < j)
        few = solid is None and sum(len(faces_of(bodies[i].shape)) for i in group) <= MAX_SEARCHED_FACES
        if len(group) > 1 and (fuse or some or few):
            shapes = [bodies[i].shape for i in group]
            split = split_bodies(shapes)
            met += [Meeting(group[m.first], group[m.second], m.share, m.place) for m in meetings(shapes, split)]
            splits |= dict.fromkeys(group, split)
    pairs = [(m.first, m.second) for m in met if _belong(bodies[m.first], bodies[m.second], m.share, fuse)]
    label = connected_components(np.array(pairs, np.int64), len(bodies))
    out: list[Body] = []
    place = np.full(len(bodies), -1, np.int64)
    for k in dict.fromkeys(label.tolist()):
        members = np.flatnonzero(label == k).tolist()
        place[members] = len(out)
        out += _joined([bodies[i] for i in members], splits.get(members[0]), warnings)
    apart = {(int(place[m.first]), int(place[m.second])): m for m in reversed(met) if label[m.first] != label[m.second]}
    return out, [Meeting(*pair, m.share, m.place) for pair, m in sorted(apart.items(), key=lambda item: item[0])]


def _belong(one: Body, other: Body, share: Share, fuse: bool) -> bool:
    """Whether two bodies are one solid."""
    return share >= Share.FACE if fuse else share is Share.MATERIAL and _one_part(one, other)


def _one_part(one: Body, other: Body) -> bool:
    """Whether the products of two bodies are one part, so that the bodies are united where they overlap."""
    a, b = one.products[0], other.products[0]
    return a.path == b.path or a.holds(b) or b.holds(a)


def _joined(members: list[Body], split: Shape, warnings: list[str]) -> list[Body]:
    """One body of several; split : of ``split_bodies``."""
    if len(members) == 1:
        return members
    products = tuple({p.path: p for b in members for p in b.products}.values())
    name = Body(members[0].shape, products).name
    return [Body(s, products) for s in _fuse([b.shape for b in members], split, name, warnings)]


def _fuse(bodies: list[Shape], split: Shape, name: str, warnings: list[str]) -> list[Shape]:
    """Union of bodies that overlap or share a face.

    split : of ``split_bodies``, of these and others; name : of their products, for messages
    """
    first, rest = TopTools_ListOfShape(), TopTools_ListOfShape()
    first.Append(bodies[0])
    for body in bodies[1:]:
        rest.Append(body)
    tool = BRepAlgoAPI_Fuse(split)
    tool.SetArguments(first)
    tool.SetTools(rest)
    tool.SetFuzzyValue(FUSE_TOLERANCE)
    tool.SetNonDestructive(True)
    tool.Build()
    fused = solids_of(tool.Shape()) if tool.IsDone() else []
    total, kept = sum(abs(volume_of(b)) for b in bodies), sum(abs(volume_of(f)) for f in fused)
    if not fused or kept > total * (1 + 1e-6) or kept < max(abs(volume_of(b)) for b in bodies) * (1 - 1e-6):
        raise PartError(f"{len(bodies)} solids{_of(name)} touch or overlap and could not be fused into one",
                        code="several_solids", measured=len(bodies), limit=1,
                        remedy="unite the bodies in the CAD system and export one solid")
    if len(fused) < len(bodies):
        warnings.append(f"{len(bodies)} solids{_of(name)} that touch or overlap were fused into {len(fused)}")
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


def _chosen(bodies: list[Body], solid: int | None, met: Sequence[Meeting], fuse: bool) -> Shape:
    if solid is not None:
        if not 1 <= solid <= len(bodies):
            raise PartError(f"solid {solid} does not exist; the file holds {len(bodies)} solids", code="no_such_solid",
                            subjects=(f"solid {solid}",), measured=solid, limit=len(bodies),
                            remedy=f"name a solid from 1 to {len(bodies)}:\n" + "\n".join(_listing(bodies)))
        return bodies[solid - 1].shape
    if len(bodies) > 1:
        products = len({path for b in bodies for path in b.paths})
        of = f" of {products} products" if products > 1 else _of(bodies[0].name)
        more = "" if fuse else "set part.fuse: true if they are one part, "
        raise PartError(f"the file holds {len(bodies)} separate solids{of}; a job needs one:\n"
                        + "\n".join([*_listing(bodies), *_touching(met)]),
                        code="several_solids", subjects=tuple(f"solid {i + 1}" for i in range(len(bodies))),
                        measured=len(bodies), limit=1,
                        remedy=f"name one with part.solid: N (1 to {len(bodies)}) in the setup, {more}or export it "
                               "alone")
    return bodies[0].shape


def _listing(bodies: Sequence[Body]) -> list[str]:
    lines = []
    for number, body in enumerate(bodies[:SHOWN], 1):
        box = box_of(body.shape)
        lines.append(f"solid {number}{_of(body.name)}: {_size(box[1] - box[0])} mm at {_point(box.mean(axis=0))}, "
                     f"{abs(volume_of(body.shape)):.4g} mm³")
    return _cut_off(lines, len(bodies))


def _touching(met: Sequence[Meeting]) -> list[str]:
    lines = [f"solid {m.second + 1} {TOUCH[m.share].format(f'solid {m.first + 1}')} {_point(m.place)}" for m in met]
    return _cut_off(lines[:SHOWN], len(lines))


def _cut_off(lines: list[str], count: int) -> list[str]:
    return [*lines, f"and {count - len(lines)} more"] if count > len(lines) else lines


def _of(name: str) -> str:
    """The product behind the number of a solid, in words."""
    return f" ({name})" if name else ""


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
    """Coordinates in mm, to a micrometre where four digits are finer."""
    return "(" + ", ".join(f"{round(float(x), 3) + 0.0:.4g}" for x in point) + ")"
