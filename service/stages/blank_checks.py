"""Blank and fixtures of a setup against the part they are meant for, once its place is known.

What the setup alone can say (a margin of 0, an allowance beyond the margin) is found before that, in
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
from verify.blank.blank import stock_on_normals
from verify.model import ProofSetup
from zones.machinable_area import SEEN, SEEN_SHARE

OVERHANG = 0.01  # mm the part may stand out of its blank or into a fixture: rounding of what people type
AWAY = 1e-6  # of a unit normal: what looks along a side does not look at it
FULL = 1e-6  # share of a box that must be free of the part to be called stock
APART, MOST_PLACES = 0.5, 50_000  # mm between places of part and blank that are held against each other; and of each
RAYS = np.array([[0.2672, 0.5345, 0.8018], [-0.7071, 0.1231, 0.6963], [0.4319, -0.8137, -0.3893]])


def check_against_part(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a blank that does not hold the part and what is to stay on it, and a fixture that stands inside it.

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
        raise SetupError("nothing stands on the part that could be cut: the part fills its box blank", code="no_stock",
                         subjects=("stock",), measured=max(room - part.volume, 0.0), limit=0.0,
                         remedy="give a larger stock.box_mm, or a stock.margin_mm above 0")


def _check_cylinder(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a cylinder that the part stands out of, or that it fills."""
    given = setup.stock.cylinder_mm
    if blank.bar is not None:
        volume = blank.bar.grown(blank.uncertainty).volume
        if volume - part.volume <= FULL * volume:
            raise SetupError("nothing stands on the part that could be cut: the part fills its cylinder blank",
                             code="no_stock", subjects=("stock",), measured=max(volume - part.volume, 0.0), limit=0.0,
                             remedy="give a larger stock.cylinder_mm, or a stock.margin_mm above 0")
    if given is None:
        return
    v = part.mesh.vertices
    beside = np.hypot(v[:, 0] - given.x, v[:, 1] - given.y) - 0.5 * given.diameter
    sides = {"side": beside, "top": v[:, 2] - (given.bottom + given.height), "underside": given.bottom - v[:, 2]}
    worst, out = max(sides.items(), key=lambda item: float(item[1].max()))
    if out.max() > OVERHANG:
        at = v[int(out.argmax())]
        raise SetupError(f"the part stands out of stock.cylinder_mm by {out.max():.3f} mm on its {worst}",
                         code="stock_misses_part", subjects=("stock.cylinder_mm", worst),
                         measured=round(float(out.max()), 6), limit=0.0,
                         remedy=f"in the setup frame the part reaches ({', '.join(f'{x:.3f}' for x in at + 0.0)}) mm; "
                                "the cylinder must hold that, or placement.origin_mm be another")


def _check_solid(part: Part, blank: Blank) -> None:
    """Refuse a solid blank that the part stands out of, or that it fills.

    Looked at are the corners of both meshes and places about ``APART`` mm apart on them: a part that stands out between
    these is not seen here, and no harm is done, for the proof takes what is part for stock.
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
        raise SetupError(f"the part stands out of its blank by {far:.3f} mm at {where}", code="stock_misses_part",
                         subjects=("stock.step_file", where), measured=round(far, 6), limit=0.0,
                         remedy="the place is in the setup frame; both files are read in the same coordinates, that of "
                                "the part: move the blank there, or give a larger one")
    volume = blank.solid.volume + float(shell.areas.sum()) * blank.uncertainty
    if volume - part.volume <= FULL * volume:
        raise SetupError("nothing stands on the part that could be cut: the part fills its blank", code="no_stock",
                         subjects=("stock.step_file",), measured=max(volume - part.volume, 0.0), limit=0.0,
                         remedy="give the file of the blank, not that of the part, or its uncertainty_mm")


def _check_room_for_allowance(setup: Setup, part: Part, blank: Blank) -> None:
    """Refuse a cylinder or a solid that ends nearer to what is to be machined than the allowance, as a box is refused.

    Looked at are the corners of the facets, along their normals. The underside does not count.
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
    at, least = int(room.argmin()), float(room.min())
    if least >= allowance - min(OVERHANG, setup.quality.gouge_tolerance_mm):
        return
    where = f"({', '.join(f'{x:.3f}' for x in points[at] + 0.0)})"
    raise SetupError(f"quality.stock_allowance_mm {allowance:g} is to stay on the part, but the blank with its "
                     f"uncertainty_mm {setup.stock.uncertainty_mm:g} holds only {least:.3f} mm at {where}",
                     code="allowance_beyond_stock", subjects=("quality.stock_allowance_mm", "stock", where),
                     measured=round(least, 6), limit=allowance,
                     remedy="leave less on the part, give a larger blank, or leave the faces there alone with "
                            "operations.exclude_faces")


def _spread(mesh: TriangleMesh) -> np.ndarray:
    """(n, 3) mm: places all over a mesh, ``APART`` mm apart or more where that would be over ``MOST_PLACES``."""
    return sample_surface(mesh, min(APART**-2, MOST_PLACES / float(mesh.areas.sum())), seed=0).points


def _off(tree: TriangleTree, points: np.ndarray, *, inside: bool) -> np.ndarray:
    """(n,) mm: how far from a closed mesh points (n, 3) are that lie in it, or that do not; 0 for the others.

    A point is in it where two of three rays first meet a facet from behind.
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
    """Refuse a box that the part stands out of; the sides are named, the worst first."""
    out = np.array([box[0] - part.bounds[0], part.bounds[1] - box[1]])
    if out.max() <= OVERHANG:
        return
    worst = sorted(((float(out[i, k]), f"{'-+'[i]}{'XYZ'[k]}") for i in range(2) for k in range(3)
                    if out[i, k] > OVERHANG), reverse=True)
    sides = ", ".join(f"{overhang:.3f} mm on the {side} side" for overhang, side in worst)
    ranges = ", ".join(f"{'XYZ'[k]} {part.bounds[0, k]:.3f} to {part.bounds[1, k]:.3f}" for k in range(3))
    raise SetupError(f"the part stands out of stock.box_mm by {sides}", code="stock_misses_part",
                     subjects=("stock.box_mm", *(side for _, side in worst)), measured=round(worst[0][0], 6), limit=0.0,
                     remedy=f"in the setup frame the part reaches over {ranges} mm; the box must hold that, or "
                            "placement.origin_mm be another")


def _check_holds_allowance(box: np.ndarray, setup: Setup, part: Part) -> None:
    """Refuse a box that ends nearer to what is to be machined than the allowance: no cut leaves what is not there.

    The underside does not count, for the part sits on it and nothing is cut there.
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
    least = allowance - min(OVERHANG, setup.quality.gouge_tolerance_mm)
    short = sorted((side for side, room in held.items() if room < least), key=lambda side: held[side])
    if not short:
        return
    sides = ", ".join(f"{held[side]:.3f} mm on the {side} side" for side in short)
    raise SetupError(f"quality.stock_allowance_mm {allowance:g} is to stay on the part, but stock.box_mm with its "
                     f"uncertainty_mm {setup.stock.uncertainty_mm:g} holds only {sides}", code="allowance_beyond_stock",
                     subjects=("quality.stock_allowance_mm", "stock.box_mm", *short),
                     measured={side: round(held[side], 6) for side in short}, limit=allowance,
                     remedy="leave less on the part, give the box as it really is, or leave the faces on those sides "
                            "alone with operations.exclude_faces")


def _faces_to_cut(setup: Setup, part: Part) -> np.ndarray:
    """Numbers of the faces asked for, else of those the access sees; which of them are in reach is not known yet."""
    ids, areas = part.mesh.face_ids, part.mesh.areas
    total = np.bincount(ids, weights=areas)
    seen = np.bincount(ids, weights=areas * (part.mesh.normals[:, 2] > SEEN), minlength=len(total))
    wanted = (np.flatnonzero((seen > 0) & (seen >= SEEN_SHARE * total)) if setup.operations.faces is None
              else np.array(face_numbers(setup.operations.faces), np.int64))
    return np.setdiff1d(wanted, face_numbers(setup.operations.exclude_faces))


def _check_fixtures(setup: Setup, part: Part) -> None:
    for number, fixture in enumerate(setup.fixtures):
        lower, upper = np.array(fixture.box_mm[0], dtype=np.float64), np.array(fixture.box_mm[1], dtype=np.float64)
        shrink = np.minimum(OVERHANG, 0.25 * (upper - lower))
        point = point_of_mesh_in_box(part.mesh, lower + shrink, upper - shrink)
        if point is not None:
            where = f"({', '.join(f'{x:.3f}' for x in point + 0.0)})"
            raise SetupError(f"fixtures[{number}] stands inside the part: the point {where} of the part is in its box",
                             code="fixture_in_part", subjects=(f"fixtures[{number}]", where),
                             measured=[round(float(x), 6) for x in point], limit=fixture.box_mm,
                             remedy="correct box_mm, which is in the setup frame, or placement.origin_mm; a fixture "
                                    "may touch the part, not enter it")
