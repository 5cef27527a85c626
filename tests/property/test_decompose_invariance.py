"""The decomposition does not depend on the frame about Z, the order of faces, or slivers beside it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from geometry.mesh import F64, TriangleMesh
from geometry.part import EdgeInfo, Part
from tests.decomposition_shapes import SHAPES, to_part
from zones.features.decomposition import decompose
from zones.model import Decomposition

pytest.importorskip("cadquery")

NAMES = ("round bar", "fork", "web on the floor", "ring with a strut", "fillets at a bar", "wavy walls in strips",
         "blades joined by struts")


@cache
def part_of(name: str) -> Part:
    return to_part(SHAPES[name][0]())


def turned(part: Part, angle: float, shift: tuple[float, float, float]) -> Part:
    """The part rotated about Z and moved."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0, shift[0]], [s, c, 0, shift[1]], [0, 0, 1, shift[2]], [0, 0, 0, 1.0]])

    def move(p: F64) -> F64:
        return np.asarray(p @ matrix[:3, :3].T + matrix[:3, 3])

    mesh = part.mesh.transformed(matrix)
    return replace(part, mesh=mesh, bounds=mesh.bounds, edges=tuple(replace(e, points=move(e.points))
                                                                    for e in part.edges))


def shuffled(part: Part, seed: int) -> tuple[Part, dict[int, int]]:
    """The part with faces, edges and triangles in another order, and new number -> old number."""
    rng = np.random.default_rng(seed)
    new_of_old = {old: new for new, old in enumerate((rng.permutation(len(part.faces)) + 1).tolist(), 1)}
    faces = sorted((replace(f, number=new_of_old[f.number]) for f in part.faces), key=lambda f: f.number)
    edges = [EdgeInfo((new_of_old[e.faces[1]], new_of_old[e.faces[0]]), e.kind, e.length, e.angle, e.points[::-1])
             for e in part.edges]
    order = rng.permutation(len(part.mesh.faces))
    ids = np.array([new_of_old[i] for i in part.mesh.face_ids.tolist()], np.int32)
    corners = part.mesh.corner_normals
    mesh = TriangleMesh(part.mesh.vertices, part.mesh.faces[order], ids[order],
                        None if corners is None else corners[order])
    uv = None if part.uv is None else part.uv[order]
    edges = [edges[i] for i in rng.permutation(len(edges))]
    other = replace(part, faces=tuple(faces), edges=tuple(edges), mesh=mesh, uv=uv)
    return other, {n: o for o, n in new_of_old.items()}


def parts_of(d: Decomposition, back: dict[int, int] | None = None) -> tuple[list[frozenset[int]], ...]:
    """Face sets of walls and connections, with the numbers translated back."""
    def name(f: int) -> int:
        return back[f] if back else f

    return ([frozenset(map(name, w.faces)) for w in d.walls], [frozenset(map(name, c.faces)) for c in d.connections])


@pytest.mark.parametrize("name", NAMES)
def test_order_of_faces_changes_nothing(name: str) -> None:
    part = part_of(name)
    before = decompose(part)
    other, back = shuffled(part, 5)
    after = decompose(other)
    assert parts_of(after, back) == parts_of(before)
    assert [c.walls for c in after.connections] == [c.walls for c in before.connections]
    assert [c.walls for c in after.channels] == [c.walls for c in before.channels]
    assert [c.gap_min for c in after.channels] == pytest.approx([c.gap_min for c in before.channels], rel=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_turning_about_z_keeps_the_parts(name: str) -> None:
    part = part_of(name)
    before = decompose(part)
    after = decompose(turned(part, 1.1, (12.0, -7.0, 30.0)))
    assert set(parts_of(after)[0]) == set(parts_of(before)[0])
    assert set(parts_of(after)[1]) == set(parts_of(before)[1])
    assert sorted(c.gap_min for c in after.channels) == pytest.approx(
        sorted(c.gap_min for c in before.channels), rel=0.01)


def test_slivers_take_no_part_and_are_named() -> None:
    part = part_of("round bar")
    top = next(f for f in part.faces if f.surface == "plane" and f.area == min(g.area for g in part.faces))
    dirty = replace(part, faces=tuple(replace(f, sliver=f.number == top.number) for f in part.faces))
    d = decompose(dirty)
    assert (len(d.walls), len(d.connections)) == (2, 1)
    assert any(f"F{top.number}" in w for w in d.warnings)


def test_same_part_twice_gives_the_same_bytes() -> None:
    part = part_of("round bar")
    assert decompose(part) == decompose(part)
