"""From where a part is looked at, so that what matters is seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.sampling import SurfaceSamples
from service.pictures.annotation import PAPER
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas

TRIAL = (480, 360)  # pixels of the pictures that views are chosen with
MOST_TRIED = 20_000  # samples
STRESS = 20.0  # times what others count, for the samples that matter
FORGIVEN = 2.0  # pixels by which a place may lie behind what is drawn and still be seen


def choose_views(mesh: TriangleMesh, samples: SurfaceSamples, stressed: NDArray[np.bool_],
                 size: tuple[int, int]) -> tuple[Camera, Camera]:
    """Two cameras that together see as much of the samples as any of eight views do: the best, and the best beside it.

    mesh     : of the part; samples : n of them, on it
    stressed : (n,) bool mask, samples that count twenty times
    size     : of the pictures, pixels

    Ties go to the first, the usual isometric view.
    """
    tried = np.unique(np.concatenate([_some(np.arange(len(samples))), _some(np.flatnonzero(stressed))]))
    weight = np.where(stressed[tried], STRESS, 1.0)
    views = [(turn, up) for up in (38.0, 58.0) for turn in (-58.0, 122.0, 32.0, 212.0)]
    found = []
    for turn, up in views:
        camera = Camera.fit(mesh.vertices, TRIAL, azimuth=math.radians(turn), elevation=math.radians(up))
        canvas = Canvas.blank(*TRIAL, PAPER)
        front = np.flatnonzero(mesh.normals @ camera.basis[2] > 0.0)
        canvas.triangles(camera.screen(mesh.triangles[front]), np.zeros((len(front), 3), np.float32),
                         np.ones(len(front), np.int32))
        facing = samples.normals[tried] @ camera.basis[2] > 0.05
        found.append(facing & seen(canvas, camera, samples.points[tried]))
    sight = np.array(found).reshape(len(views), -1)
    first = int(np.argmax(sight @ weight))
    gain = (sight & ~sight[first]) @ weight
    gain[first] = -1.0
    second = int(np.argmax(gain))
    one, two = (Camera.fit(mesh.vertices, size, azimuth=math.radians(turn), elevation=math.radians(up))
                for turn, up in (views[first], views[second]))
    return one, two


def seen(canvas: Canvas, camera: Camera, points: F64) -> NDArray[np.bool_]:
    """(n,) bool: which of (n, 3) points, mm, nothing that is drawn hides."""
    at = camera.screen(points)
    h, w = canvas.depth.shape
    x = np.clip(np.floor(at[:, 0]).astype(np.int64), 0, w - 1)
    y = np.clip(np.floor(at[:, 1]).astype(np.int64), 0, h - 1)
    return np.asarray(at[:, 2] >= canvas.depth[y, x] - FORGIVEN)


def _some(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """At most ``MOST_TRIED`` of these rows, evenly."""
    return rows[::max(1, -(-len(rows) // MOST_TRIED))]
