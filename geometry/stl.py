"""Meshes as STL files, through trimesh; the same mesh gives the same bytes.

Binary STL (the default) holds corners in single precision, text STL as printed decimals. STL has no unit (here mm) and
no connection between facets: reading joins corners that are equal, bit for bit.
"""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path

import numpy as np

from geometry.errors import GeometryError, InputError
from geometry.mesh import TriangleMesh


class StlForm(StrEnum):
    """Form of an STL file."""

    BINARY = "binary"
    """50 bytes a facet; corners to about 1e-7 of their distance from the origin."""
    TEXT = "text"
    """The form of the thesis [Jain2016]; corners to 1e-8 mm."""


def stl_bytes(mesh: TriangleMesh, form: StlForm | str = StlForm.BINARY) -> bytes:
    """The STL file of a mesh.

    mesh : TriangleMesh, mm
    form : StlForm or its value

    Returns
    -------
    bytes
        Facets in the order of the mesh, outward by the right-hand rule, with their normals.

    Raises
    ------
    GeometryError
        ``mesh_not_finite``: a vertex is not finite.
    ValueError
        ``form`` is none of ``StlForm``.
    """
    finite = np.isfinite(mesh.vertices).all(axis=1)
    if not finite.all():
        bad = int(np.flatnonzero(~finite)[0])
        raise GeometryError(f"vertex {bad} of the mesh is not finite", code="mesh_not_finite",
                            subjects=(f"vertex {bad}",), remedy="mesh the shape again")
    import trimesh  # here: it takes a third of a second, and few jobs write a mesh

    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, face_normals=mesh.normals, process=False, validate=False)
    if StlForm(form) is StlForm.TEXT:
        return trimesh.exchange.stl.export_stl_ascii(plain).encode("ascii")
    return trimesh.exchange.stl.export_stl(plain)


def write_stl(mesh: TriangleMesh, path: str | os.PathLike[str], form: StlForm | str = StlForm.BINARY) -> None:
    """Write a mesh to an STL file; parameters and errors are those of ``stl_bytes``."""
    Path(path).write_bytes(stl_bytes(mesh, form))


def read_stl(path: str | os.PathLike[str]) -> TriangleMesh:
    """Read an STL file of either form.

    path : STL file, mm

    Returns
    -------
    TriangleMesh
        Facets in the order of the file, corners that are equal joined.

    Raises
    ------
    InputError
        ``not_stl``: the file is missing or is not STL.
    """
    import trimesh

    try:
        with Path(path).open("rb") as file:
            read = trimesh.load_mesh(file, file_type="stl", process=False)
        corners = np.asarray(read.triangles, dtype=np.float64).reshape(-1, 3)
    except Exception as problem:
        # the parsers of trimesh raise errors of any class; no code of the project runs in here
        raise _not_stl(path, str(problem)) from problem
    if not len(corners):
        raise _not_stl(path, "it holds no facet")
    vertices, first, place = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return TriangleMesh(vertices[order], rank[place.reshape(-1)].reshape(-1, 3).astype(np.int32))


def _not_stl(path: str | os.PathLike[str], why: str) -> InputError:
    name = Path(path).name
    return InputError(f"{name} is not an STL file: {why}", code="not_stl", subjects=(name,),
                      remedy="export it again, as binary STL")
