"""Checks of blank and fixtures against the part, once its place is known.

Contradictions within the setup alone (a margin of 0, an allowance beyond the margin) are found earlier, by
``service.from_wire.check_blank``.
"""

from __future__ import annotations

import numpy as np

from geometry.errors import SetupError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.box_overlap import point_of_mesh_in_box
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from geometry.sampling import sample_surface
from schemas.setup import Setup
from service.from_wire import face_numbers
from service.stages.blank_model import Blank
from service.stages.job_inputs import fixtures_of
from verify.blank.blank import stock_on_normals
from verify.model import ProofSetup
from zones.machinable_area import SEEN, SEEN_SHARE

OVERHANG = 0.01  # mm the part may stand out of its blank or into a fixture: rounding of what people type
AWAY = 1e-6  # component of a unit normal towards a side, from which on a facet faces it
FULL = 1e-6  # share of a blank that must be free of the part, or there is no stock to cut
APART, MAX_PLACES = 0.5, 50_000  # mm between the compared places on part and blank, and their number on each
RAYS = np.array([[0.2672, 0.5345, 0.8018], [-0.7071, 0.1231, 0.6963], [0.4319, -0.8137, -0.3893]])


def check_against_part(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a blank that does not hold the part and its allowance, and a fixture that stands inside the part.

    part, blank : in the setup frame

    Raises
    ------
    SetupError
        Code 'stock_misses_part', 'allowance_beyond_stock', 'no_stock' or 'fixture_in_part'.
    """
    _check_box(setup, part)
    _check_cylinder(setup, part, blank)
    _check_solid(part, blank)
    _check_room_for_allowance(setup, part, blank)
    _check_fixtures(setup, part)


def _check_box(setup: Setup, part: Part) -> None:
    stock = setup.stock
    if stock.kind != "box":
        return
    if stock.box_mm is None:
        grown = np.array([-1.0, 1.0])[:, None] * (stock.margin_mm + stock.uncertainty_mm)
        box = part.bounds + grown
        box[0, 2] = part.bounds[0, 2]
    else:
        box = np.array(stock.box_mm, dtype=np.float64)
        _check_contains(box, part)
        box = box + np.array([-1.0, 1.0])[:, None] * stock.uncertainty_mm
        _check_holds_allowance(box, setup, part)
    room = float(np.prod(box[1] - box[0]))
    if room - part.volume <= FULL * room:
        raise SetupError("there is no stock to cut: the part fills its box blank", code="no_stock",
                         subjects=("stock",), measured=max(room - part.volume, 0.0), limit=0.0,
                         remedy="give a larger stock.box_mm, or a stock.margin_mm above 0")


def _check_cylinder(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a cylinder that the part protrudes from or fills."""
    given = setup.stock.cylinder_mm
    if blank.bar is not None:
        volume = blank.bar.grown(blank.uncertainty).volume
        if volume - part.volume <= FULL * volume:
            raise SetupError("there is no stock to cut: the part fills its cylinder blank",
                             code="no_stock", subjects=("stock",), measured=max(volume - part.volume, 0.0), limit=0.0,
                             remedy="give a larger stock.cylinder_mm, or a stock.margin_mm above 0")
    if given is None:
        return
    v = part.mesh.vertices
    at_side = np.hypot(v[:, 0] - given.x, v[:, 1] - given.y) - 0.5 * given.diameter
    sides = {"side": at_side, "top": v[:, 2] - (given.bottom + given.height), "underside": given.bottom - v[:, 2]}
    worst, out = max(sides.items(), key=lambda item: float(item[1].max()))
    if out.max() > OVERHANG:
        at = v[int(out.argmax())]
        raise SetupError(f"the part protrudes from stock.cylinder_mm by {out.max():.3f} mm on its {worst}",
                         code="stock_misses_part", subjects=("stock.cylinder_mm", worst),
                         measured=round(float(out.max()), 6), limit=0.0,
                         remedy=f"in the setup frame the part reaches ({', '.join(f'{x:.3f}' for x in at + 0.0)}) mm; "
                                "give a cylinder that holds this point, or change placement.origin_mm")


def _check_solid(part: Part, blank: Blank) -> None:
    """Refuse a solid blank that the part protrudes from or fills.

    The check covers the corners of both meshes and places about ``APART`` mm apart on them. It misses a part that
    protrudes between these places. That does no harm, because the proof counts the part's volume as stock.
    """
    if blank.solid is None:
        return
    stands, shell = part.mesh, blank.solid.mesh
    places = np.concatenate([stands.vertices, _spread(stands)])
    off = _off(TriangleTree(shell), places, inside=False)
    holes = np.concatenate([shell.vertices, _spread(shell)])
    deep = _off(TriangleTree(stands), holes, inside=True)
    far, at = max(((float(d.max(initial=0.0)), p[int(d.argmax())]) for d, p in ((off, places), (deep, holes))),
                  key=lambda found: found[0])
    if far > OVERHANG:
        where = f"({', '.join(f'{x:.3f}' for x in at + 0.0)})"
        raise SetupError(f"the part protrudes from its blank by {far:.3f} mm at {where}", code="stock_misses_part",
                         subjects=("stock.step_file", where), measured=round(far, 6), limit=0.0,
                         remedy="the place is in the setup frame; both files are read in the same coordinates: move "
                                "the blank to the part, or give a larger blank")
    volume = blank.solid.volume + float(shell.areas.sum()) * blank.uncertainty
    if volume - part.volume <= FULL * volume:
        raise SetupError("there is no stock to cut: the part fills its blank", code="no_stock",
                         subjects=("stock.step_file",), measured=max(volume - part.volume, 0.0), limit=0.0,
                         remedy="give the file of the blank, not that of the part, or set uncertainty_mm")


def _check_room_for_allowance(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a cylinder or a solid that holds less than the allowance on a face to be machined.

    The check covers the corners of the facets, along their normals. The underside does not count.
    """
    allowance = setup.quality.stock_allowance_mm
    if allowance <= 0 or (blank.bar is None and blank.solid is None):
        return
    mesh = part.mesh
    to_cut = np.isin(mesh.face_ids, _faces_to_cut(setup, part)) & (mesh.normals[:, 2] > SEEN)
    points, normals = mesh.triangles[to_cut].reshape(-1, 3), np.repeat(mesh.normals[to_cut], 3, axis=0)
    if not len(points):
        return
    cylinder, upwards = blank.proof_cylinder(np.eye(3))
    stands = ProofSetup(stock_kind=setup.stock.kind, uncertainty=blank.beyond, stock_cylinder=cylinder,
                        stock_axis=upwards, stock_mesh=blank.proof_mesh(np.eye(3)))
    room = stock_on_normals(points, normals, part.bounds, stands, allowance)
    at, least_room = int(room.argmin()), float(room.min())
    if least_room >= allowance - min(OVERHANG, setup.quality.gouge_tolerance_mm):
        return
    where = f"({', '.join(f'{x:.3f}' for x in points[at] + 0.0)})"
    raise SetupError(f"quality.stock_allowance_mm is {allowance:g}, but the blank with its "
                     f"uncertainty_mm {setup.stock.uncertainty_mm:g} holds only {least_room:.3f} mm at {where}",
                     code="allowance_beyond_stock", subjects=("quality.stock_allowance_mm", "stock", where),
                     measured=round(least_room, 6), limit=allowance,
                     remedy="lower the allowance, give a larger blank, or exclude the faces there with "
                            "operations.exclude_faces")


def _spread(mesh: TriangleMesh) -> np.ndarray:
    """(n, 3) float64, mm: places on a mesh, ``APART`` mm apart, or farther where they would exceed ``MAX_PLACES``."""
    return sample_surface(mesh, min(APART**-2, MAX_PLACES / float(mesh.areas.sum())), seed=0).points


def _off(tree: TriangleTree, points: np.ndarray, *, inside: bool) -> np.ndarray:
    """(n,) float64, mm: distance of points (n, 3) from a closed mesh where they lie inside, or outside; else 0.

    A point is inside where two of three rays first meet a facet from behind.
    """
    behind = np.zeros(len(points), np.int64)
    for ray in RAYS:
        _, row = first_hits(tree, points, ray)
        behind += (row >= 0) & (tree.mesh.normals[row] @ ray > 0.0)
    wanted = np.flatnonzero((behind >= 2) == inside)
    out = np.zeros(len(points))
    out[wanted] = nearest(tree, points[wanted])[0]
    return out


def _check_contains(box: np.ndarray, part: Part) -> None:
    """Refuse a box that the part protrudes from; the error names the sides, the worst first."""
    out = np.array([box[0] - part.bounds[0], part.bounds[1] - box[1]])
    if out.max() <= OVERHANG:
        return
    worst = sorted(((float(out[i, k]), f"{'-+'[i]}{'XYZ'[k]}") for i in range(2) for k in range(3)
                    if out[i, k] > OVERHANG), reverse=True)
    sides = ", ".join(f"{overhang:.3f} mm on the {side} side" for overhang, side in worst)
    ranges = ", ".join(f"{'XYZ'[k]} {part.bounds[0, k]:.3f} to {part.bounds[1, k]:.3f}" for k in range(3))
    raise SetupError(f"the part protrudes from stock.box_mm by {sides}", code="stock_misses_part",
                     subjects=("stock.box_mm", *(side for _, side in worst)), measured=round(worst[0][0], 6), limit=0.0,
                     remedy=f"in the setup frame the part spans {ranges} mm; give a box that holds this range, or "
                            "change placement.origin_mm")


def _check_holds_allowance(box: np.ndarray, setup: Setup, part: Part) -> None:
    """Refuse a box that holds less than the allowance on a face to be machined.

    The underside does not count: the part sits on it, and nothing is cut there.
    """
    allowance = setup.quality.stock_allowance_mm
    if allowance <= 0:
        return
    mesh = part.mesh
    to_cut = np.isin(mesh.face_ids, _faces_to_cut(setup, part)) & (mesh.normals[:, 2] > SEEN)
    points, normals = mesh.triangles[to_cut], mesh.normals[to_cut]
    held: dict[str, float] = {}
    for corner, axis in ((0, 0), (0, 1), (1, 0), (1, 1), (1, 2)):
        out = 2 * corner - 1
        faces_it = out * normals[:, axis] > AWAY
        room = (out * (box[corner, axis] - points[faces_it, :, axis])).min(axis=1)
        along = room / (out * normals[faces_it, axis])  # the normal, on which an allowance is measured
        held[f"{'-+'[corner]}{'XYZ'[axis]}"] = max(float(along.min(initial=np.inf)), 0.0)
    min_room = allowance - min(OVERHANG, setup.quality.gouge_tolerance_mm)
    short = sorted((side for side, room in held.items() if room < min_room), key=lambda side: held[side])
    if not short:
        return
    sides = ", ".join(f"{held[side]:.3f} mm on the {side} side" for side in short)
    raise SetupError(f"quality.stock_allowance_mm is {allowance:g}, but stock.box_mm with its "
                     f"uncertainty_mm {setup.stock.uncertainty_mm:g} holds only {sides}", code="allowance_beyond_stock",
                     subjects=("quality.stock_allowance_mm", "stock.box_mm", *short),
                     measured={side: round(held[side], 6) for side in short}, limit=allowance,
                     remedy="lower the allowance, give the real size of the box, or exclude the faces on those sides "
                            "with operations.exclude_faces")


def _faces_to_cut(setup: Setup, part: Part) -> np.ndarray:
    """Numbers of the faces that the setup names, else of those that face the access; reach is not known yet."""
    ids, areas = part.mesh.face_ids, part.mesh.areas
    total = np.bincount(ids, weights=areas)
    seen = np.bincount(ids, weights=areas * (part.mesh.normals[:, 2] > SEEN), minlength=len(total))
    wanted = (np.flatnonzero((seen > 0) & (seen >= SEEN_SHARE * total)) if setup.operations.faces is None
              else np.array(face_numbers(setup.operations.faces), np.int64))
    return np.setdiff1d(wanted, face_numbers(setup.operations.exclude_faces))


def _check_fixtures(setup: Setup, part: Part) -> None:
    other = [o for o in part.others for _ in o.held_by]
    for number, (lower, upper) in enumerate(fixtures_of(setup, part.others)):
        given = number < len(setup.fixtures)
        solid = None if given else other[number - len(setup.fixtures)]
        name = f"fixtures[{number}]" if solid is None else \
            f"{'the box' if len(solid.held_by) == 1 else 'a box'} of {solid}"
        shrink = np.minimum(OVERHANG, 0.25 * (upper - lower))
        point = point_of_mesh_in_box(part.mesh, lower + shrink, upper - shrink)
        if point is not None:
            where = f"({', '.join(f'{x:.3f}' for x in point + 0.0)})"
            raise SetupError(f"{name} stands inside the part: the point {where} of the part is in its box",
                             code="fixture_in_part", subjects=(name, where),
                             measured=[round(float(x), 6) for x in point], limit=[lower.tolist(), upper.tolist()],
                             remedy="correct box_mm, which is in the setup frame, or placement.origin_mm; a fixture "
                                    "may touch the part but not enter it" if given else
                                    "set part.others: absent, and give boxes for what stands there in fixtures")
