"""Part -> walls, connections, channels, and the role of every face.

    measured faces (face_graph) -> thin bodies (walls) -> bridges among the bodies (connections)
    -> the remaining thin bodies that stand on something are walls -> facing walls (channels)

The result does not depend on the origin of the part or on the order of its faces.
"""

from __future__ import annotations

import numpy as np

from geometry.part import EdgeKind, Part
from zones.features.channels import find_facings
from zones.features.connections import Bridges, find_bridges
from zones.features.face_graph import STEEP_NZ, FaceGraph
from zones.features.walls import SEAT, Sheets, find_sheets
from zones.machinable_area import STEEP
from zones.model import Channel, Connection, Decomposition, Wall

# Least share of steep area among the sides of a wall. The blades of an inducer twist from upright at the hub to flat at
# the tip, so most of their area may be less steep.
STEEP_SHARE = 0.25


def decompose(part: Part) -> Decomposition:
    """Find walls, connections and channels of a part [Arivazhagan2020].

    part : Part in the setup frame, mm, access along +Z

    Returns
    -------
    Decomposition
        Ids W1.., C1.., H1.. follow the centroids (x, then y, then z). Gaps are measured between patches through the
        mesh nodes. They are within 0.1 % of exact surfaces meshed with 20 or more columns (tests/oracle/test_gaps.py).
        Without surface parameters they are the gaps of the mesh, with at most twice ``part.deviation`` of further
        error.
    """
    graph = FaceGraph(part)
    sheets = find_sheets(graph)
    bridges = find_bridges(graph, sheets)
    bridging = {x for group in bridges.connections for x in group}
    standing = [x for x in sheets.labels if x not in bridging and _stands(graph, bridges, x)]
    wall_labels = [x for x in standing if _is_upright(graph, sheets, x)]
    wall_labels.sort(key=lambda x: _place(graph, np.flatnonzero(bridges.body == x)))
    walls = tuple(_wall(graph, sheets, bridges.body, x, f"W{i}") for i, x in enumerate(wall_labels, 1))
    name = {x: w.id for x, w in zip(wall_labels, walls, strict=True)}
    connections = _connections(graph, bridges, name)
    spanned = [int(f) - 1 for c in connections for f in c.faces]
    left_out = graph.fillet | graph.sliver
    left_out[spanned] = True
    sides = [_channel_sides(graph, sheets, x) for x in wall_labels]
    channels = tuple(
        Channel(f"H{i}", (walls[f.walls[0]].id, walls[f.walls[1]].id), f.gap_min, f.at)
        for i, f in enumerate(find_facings(graph, sides, left_out), 1))
    roles = _roles(graph, bridges, set(wall_labels), set(spanned))
    seat = tuple(int(f) + 1 for f in np.flatnonzero(graph.seat))
    lying = np.flatnonzero(np.isin(bridges.body, [x for x in standing if x not in wall_labels]))
    return Decomposition(walls, connections, channels, roles, seat, _warnings(graph, walls, lying))


def _is_upright(graph: FaceGraph, sheets: Sheets, label: int) -> bool:
    """Whether a thin body holds enough steep area to be a wall."""
    sides = sheets.sides(label)
    # sides lean up to 45 degrees, the limit between waterlines and projected passes
    steep = graph.share(np.abs(graph.mesh.normals[:, 2]) <= STEEP)[sides]
    return bool((graph.area[sides] * steep).sum() >= STEEP_SHARE * graph.area[sides].sum())


def _stands(graph: FaceGraph, bridges: Bridges, label: int) -> bool:
    """Whether a thin body stands on the base, the seat, or a floor."""
    for link in graph.links:
        for f, g in ((link.a, link.b), (link.b, link.a)):
            if bridges.body[f] == label and (graph.seat[g] or int(bridges.body[g]) in bridges.base):
                return True
    return any(label in (b.a, b.b) and {b.a, b.b} & bridges.base for b in bridges.borders)


def _place(graph: FaceGraph, faces: np.ndarray) -> tuple[float, ...]:
    """Area centroid of faces, rounded to a millionth of the part size so that noise cannot change an order."""
    weight = graph.area[faces]
    centre = (graph.centroid[faces] * weight[:, None]).sum(axis=0) / max(float(weight.sum()), 1e-30)
    pitch = 10.0 ** np.floor(np.log10(1e-5 * max(graph.size, 1e-9)))
    return tuple(float(c) for c in np.round(centre / pitch))


def _wall(graph: FaceGraph, sheets: Sheets, body: np.ndarray, label: int, name: str) -> Wall:
    faces = np.flatnonzero(body == label)
    thin = sheets.sides(label)
    rows = graph.face_rows(np.isin(np.arange(graph.n), thin))
    low, high = graph.z_range[faces, 0].min(), graph.z_range[faces, 1].max()
    sides = faces[graph.steep[faces] | sheets.thin[faces]]
    return Wall(name, tuple(int(f) + 1 for f in faces), tuple(int(f) + 1 for f in sides),
                float(np.median(graph.inward[rows])), float(low), float(high))


def _channel_sides(graph: FaceGraph, sheets: Sheets, label: int) -> np.ndarray:
    """Sides of a wall that bound channels: its thin faces without end faces.

    Rays into the end of a bent wall, or oblique ones into the reveal of an opening, leave by a side, so these faces may
    count as thin. An upright face is an end face when two upright convex edges lead from it to other thin faces of the
    wall, and one of two conditions holds: the material behind it is deeper than the face is wide; or those two faces
    are the two sides of the wall there, and the face is no wider than twice the wall's thickness.
    """
    thin = sheets.sides(label)
    thickness = float(np.median(graph.inward[graph.face_rows(np.isin(np.arange(graph.n), thin))]))
    ends = []
    for f in thin.tolist():
        tall = float(graph.z_range[f, 1] - graph.z_range[f, 0])
        turns = {k.other(f) for k in graph.at[f] if k.kind == EdgeKind.CONVEX and k.length >= 0.5 * tall
                 and sheets.thin[k.other(f)] and sheets.body[k.other(f)] == label}
        depth = graph.inward[graph.face_rows(np.arange(graph.n) == f)]
        if len(turns) < 2 or len(depth) == 0:
            continue
        wide = graph.area[f] / max(tall, 1e-9)
        if wide < float(np.median(depth)) or (wide <= 2.0 * thickness and _back_each_other(graph, turns)):
            ends.append(f)
    return thin if len(ends) == len(thin) else np.setdiff1d(thin, ends)


def _back_each_other(graph: FaceGraph, faces: set[int]) -> bool:
    """Whether inward rays from one of the faces end on another of them, half of them or more."""
    for f in sorted(faces):
        back = graph.back[graph.face_rows(np.arange(graph.n) == f)]
        if len(back) and np.isin(back, sorted(faces - {f})).mean() >= 0.5:
            return True
    return False


def _connections(graph: FaceGraph, bridges: Bridges, name: dict[int, str]) -> tuple[Connection, ...]:
    found = []
    for group, ends in zip(bridges.connections, bridges.ends, strict=True):
        at = [name[e.at] for e in ends if e.at in name]
        if len(at) < 2:
            continue
        walls = sorted(set(at), key=lambda w: int(w[1:]))
        if len(walls) == 1:
            walls = walls * 2
        faces = np.flatnonzero(np.isin(bridges.body, group))
        found.append((_place(graph, faces), faces, tuple(walls)))
    found.sort(key=lambda f: f[0])
    return tuple(
        Connection(f"C{i}", tuple(int(f) + 1 for f in faces), walls,
                   float(graph.z_range[faces, 0].min()), float(graph.z_range[faces, 1].max()))
        for i, (_, faces, walls) in enumerate(found, 1))


def _roles(graph: FaceGraph, bridges: Bridges, walls: set[int], connections: set[int]) -> dict[int, str]:
    """Role of every face number; a face of the base that points up is floor."""
    out = {}
    for face in range(graph.n):
        body = int(bridges.body[face])
        if graph.fillet[face]:
            role = "fillet"
        elif face in connections:
            role = "connection"
        elif body in walls:
            role = "wall"
        elif body == SEAT or body in bridges.base:
            role = "floor" if graph.normal[face, 2] > STEEP_NZ else "base"
        else:
            role = "free"
        out[face + 1] = role
    return out


def _warnings(graph: FaceGraph, walls: tuple[Wall, ...], lying: np.ndarray) -> tuple[str, ...]:
    """Sentences for the report; lying: (k,) int, 0-based faces of thin bodies that lean too far to be walls."""
    out = []
    if len(lying):
        names = ", ".join(f"F{f + 1}" for f in lying[:10])
        out.append(f"thin material that leans more than 45 degrees counts as free surface, not as a wall: {names}")
    slivers = [f"F{f + 1}" for f in np.flatnonzero(graph.sliver)]
    if slivers:
        out.append(f"the search for walls ignores {len(slivers)} sliver faces: {', '.join(slivers[:10])}")
    if not graph.seat.any():
        out.append("no plane faces away from the access, so the part has no seat")
    if not walls:
        out.append("no wall was found: the part is one free surface")
    return tuple(out)


