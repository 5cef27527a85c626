"""STL out and in again."""

from __future__ import annotations

import numpy as np
import pytest

from examples.family.thesis import ThesisSurface, surface
from geometry.errors import GeometryError, InputError
from geometry.mesh import TriangleMesh
from geometry.stl import StlForm, read_stl, stl_bytes, write_stl

MESH = surface(ThesisSurface.CONVEX).discretised(0.1, 0.1)


@pytest.mark.parametrize(("form", "off"), [(StlForm.BINARY, 4e-6), (StlForm.TEXT, 5.1e-9)])
def test_what_is_written_is_read(tmp_path, form, off):
    write_stl(MESH, tmp_path / "convex.stl", form)
    back = read_stl(tmp_path / "convex.stl")
    assert len(back.faces) == 800 and len(back.vertices) == len(MESH.vertices)
    assert np.abs(back.triangles - MESH.triangles).max() <= off
    assert (np.einsum("ij,ij->i", back.normals, MESH.normals) > 0.999999).all()


@pytest.mark.parametrize("form", StlForm)
def test_a_second_round_changes_nothing_more(tmp_path, form):
    write_stl(MESH, tmp_path / "once.stl", form)
    once = read_stl(tmp_path / "once.stl")
    write_stl(once, tmp_path / "twice.stl", form)
    twice = read_stl(tmp_path / "twice.stl")
    assert np.array_equal(once.triangles, twice.triangles) and np.array_equal(once.faces, twice.faces)


@pytest.mark.parametrize("form", StlForm)
def test_the_same_mesh_gives_the_same_bytes(form):
    again = TriangleMesh(MESH.vertices.copy(), MESH.faces.copy())
    data = stl_bytes(MESH, form)
    assert data == stl_bytes(again, form)
    assert data.startswith(b"solid") == (form is StlForm.TEXT)


def test_binary_is_a_header_a_count_and_fifty_bytes_a_facet():
    data = stl_bytes(MESH)
    assert len(data) == 84 + 50 * 800 and int.from_bytes(data[80:84], "little") == 800


def test_what_is_no_stl_says_so(tmp_path):
    (tmp_path / "note.stl").write_bytes(b"not a mesh")
    for name in ("note.stl", "absent.stl"):
        with pytest.raises(InputError) as caught:
            read_stl(tmp_path / name)
        assert caught.value.code == "not_stl" and caught.value.subjects == (name,)


def test_a_mesh_that_is_not_finite_is_not_written():
    with pytest.raises(GeometryError, match="vertex 1 of the mesh is not finite"):
        stl_bytes(TriangleMesh(np.array([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]]), np.array([[0, 1, 2]])))
