"""Chooses the views of a part that show the important places."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.sampling import SurfaceSamples
from service.pictures.annotation import PAPER
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas

TRIAL = (480, 360)  # pixels of the trial pictures
MAX_TRIED_SAMPLES = 20_000  # samples
STRESSED_WEIGHT = 20.0  # weight of stressed samples
DEPTH_SLACK = 2.0  # pixels that a visible place may lie behind the drawn surface


def choose_views(mesh: TriangleMesh, samples: SurfaceSamples, stressed: NDArray[np.bool_],
                 size: tuple[int, int]) -> tuple[Camera, Camera]:
    """The two cameras, out of eight, that together show most of the samples: the best one, and the best in addition.

    mesh     : of the part; samples : n of them, on it
    stressed : (n,) bool mask, samples that count twenty times
    size     : of the pictures, pixels

    The first one wins a tie; it is the usual isometric view.
    """
    tried = np.unique(np.concatenate([_some(np.arange(len(samples))), _some(np.flatnonzero(stressed))]))
    weight = np.where(stressed[tried], STRESSED_WEIGHT, 1.0)
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
    """Whether points are visible.

    points : (n, 3) float64, mm, frame of the part

    Returns (n,) bool.
    """
    at = camera.screen(points)
    h, w = canvas.depth.shape
    x = np.clip(np.floor(at[:, 0]).astype(np.int64), 0, w - 1)
    y = np.clip(np.floor(at[:, 1]).astype(np.int64), 0, h - 1)
    return np.asarray(at[:, 2] >= canvas.depth[y, x] - DEPTH_SLACK)


def _some(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """At most ``MAX_TRIED_SAMPLES`` of these rows, evenly spaced."""
    return rows[::max(1, -(-len(rows) // MAX_TRIED_SAMPLES))]
