"""A part on a canvas: lit triangles, silhouette, edges of the B-rep."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.part import EdgeKind, Part
from service.pictures.annotation import INK, PAPER
from service.pictures.camera import Camera
from service.pictures.rasterizer import F32, Canvas


def lit(mesh: TriangleMesh, colours: F32, camera: Camera) -> Canvas:
    """Shaded triangles that face the viewer.

    colours : (n + 1, 3) float32, dimensionless, 0..1 in RGB coordinates, by face number; row 0 is for triangles without
              face
    """
    canvas = Canvas.blank(*camera.size, PAPER)
    front = np.flatnonzero(mesh.normals @ camera.basis[2] > 0.0)
    key = np.array([-0.35, 0.55, 0.75]) @ camera.basis  # over the viewer's left shoulder
    fill = np.array([0.9, 0.1, 0.4]) @ camera.basis
    n = mesh.normals[front]
    light = 0.56 + 0.40 * np.clip(n @ (key / np.linalg.norm(key)), 0, 1) + 0.16 * np.clip(n @ fill, 0, 1)
    ids = np.where(mesh.face_ids[front] < len(colours), mesh.face_ids[front], 0)
    canvas.triangles(camera.screen(mesh.triangles[front]), np.clip(colours[ids] * light[:, None], 0, 1).astype("f4"),
                     np.maximum(mesh.face_ids[front], 1))
    return canvas


def add_edges(canvas: Canvas, part: Part, camera: Camera) -> None:
    """The silhouette and the sharp edges of the B-rep."""
    canvas.outline(INK, jump=0.02 * min(camera.size))
    for edge in part.edges:
        if edge.kind is not EdgeKind.SMOOTH and len(edge.points) > 1:
            canvas.strokes(segments(camera, edge.points), INK, width=2, alpha=0.75, bias=3.0)


def shaded(part: Part, colours: F32, camera: Camera) -> Canvas:
    """The part with a colour for every face, and its edges.

    colours : (n + 1, 3) float32, dimensionless, 0..1 in RGB coordinates, by face number
    """
    canvas = lit(part.mesh, colours, camera)
    add_edges(canvas, part, camera)
    return canvas


def segments(camera: Camera, points: F64) -> F64:
    """Screen segments of a polyline.

    points : (n, 3) float64, mm, setup frame

    Returns (n - 1, 2, 3) float64, pixels.
    """
    p = camera.screen(points)
    return np.stack([p[:-1], p[1:]], axis=1)
