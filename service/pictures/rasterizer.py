"""A small z-buffer: shaded triangles, depth-tested lines and dots, on plain arrays.

Pictures are made in a child process on a machine without graphics library, with the same bytes every time. Therefore
this exists beside VTK. Screen: x to the right, y down, in pixels; depth grows towards the viewer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
from geometry.mesh import F64, I32

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Canvas:
    """The picture on which the kernels draw.

    colour : (h, w, 3) float32, 0..1
    depth  : (h, w) float64, pixels towards the viewer; -inf where nothing is drawn
    owner  : (h, w) int32, number of the visible face; 0 where nothing is drawn
    """

    colour: F32
    depth: F64
    owner: I32

    @classmethod
    def blank(cls, width: int, height: int, background: tuple[float, float, float]) -> Canvas:
        """A canvas of one colour."""
        colour = np.empty((height, width, 3), dtype=np.float32)
        colour[:] = background
        return cls(colour, np.full((height, width), -np.inf), np.zeros((height, width), dtype=np.int32))

    def triangles(self, corners: F64, colours: F32, owners: I32) -> None:
        """Fill triangles.

        corners : (m, 3, 3) float64, pixels, x, y and depth
        colours : (m, 3) float32, dimensionless, 0..1, red, green and blue of this colour
        owners  : (m,) int32, index, number of the face
        """
        _triangles(np.ascontiguousarray(corners), np.ascontiguousarray(colours, dtype=np.float32),
                   np.ascontiguousarray(owners, dtype=np.int32), self.colour, self.depth, self.owner)

    def strokes(self, segments: F64, colour: tuple[float, float, float], *, width: int = 1, alpha: float = 1.0,
                hidden: float = 0.0, bias: float = 0.0, dash: float = 0.0) -> None:
        """Draw segments (n, 2, 3) float64, in pixels and depth.

        alpha, hidden : opacity in front of and behind the picture;  bias : tolerance of depth, pixels
        dash          : length of dash and of gap in pixels, 0 for a full line
        """
        if len(segments):
            s = np.ascontiguousarray(segments, dtype=np.float64)
            length = np.hypot(s[:, 1, 0] - s[:, 0, 0], s[:, 1, 1] - s[:, 0, 1])
            start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
            _strokes(s, start, np.array(colour, dtype=np.float32), width, alpha, hidden, bias, dash,
                     self.colour, self.depth)

    def dots(self, points: F64, colour: tuple[float, float, float], *, width: int = 3, alpha: float = 1.0,
             hidden: float = 0.0, bias: float = 0.0) -> None:
        """Draw square dots.

        points : (n, 3) float64, pixels and depth
        alpha, hidden : opacity in front of and behind the picture;  bias : tolerance of depth, pixels
        """
        if len(points):
            _dots(np.ascontiguousarray(points, dtype=np.float64), np.array(colour, dtype=np.float32), width, alpha,
                  hidden, bias, self.colour, self.depth)

    def outline(self, colour: tuple[float, float, float], jump: float) -> None:
        """Darken pixels at the border of the part and where the depth jumps by more than ``jump`` pixels."""
        solid = self.owner > 0
        rim = np.zeros(solid.shape, dtype=bool)
        for axis in (0, 1):
            a = [slice(None), slice(None)]
            b = [slice(None), slice(None)]
            a[axis], b[axis] = slice(None, -1), slice(1, None)
            one, two = tuple(a), tuple(b)
            with np.errstate(invalid="ignore"):
                step = self.depth[one] - self.depth[two]
                rim[one] |= solid[one] & (~solid[two] | (step > jump))
                rim[two] |= solid[two] & (~solid[one] | (step < -jump))
        self.colour[rim] = colour

    def halved(self) -> NDArray[np.uint8]:
        """The picture at half the size, each pixel the mean of four: (h/2, w/2, 3) uint8, dimensionless, 0..255."""
        h, w = self.colour.shape[0] // 2, self.colour.shape[1] // 2
        mean = self.colour[:2 * h, :2 * w].reshape(h, 2, w, 2, 3).mean(axis=(1, 3))
        return np.asarray(np.rint(np.clip(mean, 0.0, 1.0) * 255.0), dtype=np.uint8)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _triangles(corners, colours, owners, image, depth, owner):  # type: ignore[no-untyped-def]
    # a, b, c: corners; w0, w1, w2: barycentric weights at the pixel centre
    h, w = depth.shape
    for t in range(corners.shape[0]):
        ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
        bx, by, bz = corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2]
        cx, cy, cz = corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0.0 or not math.isfinite(area):
            continue
        x0 = max(int(math.floor(min(ax, bx, cx) - 0.5)), 0)
        x1 = min(int(math.ceil(max(ax, bx, cx) + 0.5)), w - 1)
        y0 = max(int(math.floor(min(ay, by, cy) - 0.5)), 0)
        y1 = min(int(math.ceil(max(ay, by, cy) + 0.5)), h - 1)
        for y in range(y0, y1 + 1):
            py = y + 0.5
            for x in range(x0, x1 + 1):
                px = x + 0.5
                w0 = ((bx - px) * (cy - py) - (cx - px) * (by - py)) / area
                w1 = ((cx - px) * (ay - py) - (ax - px) * (cy - py)) / area
                w2 = 1.0 - w0 - w1
                if w0 < -1e-9 or w1 < -1e-9 or w2 < -1e-9:
                    continue
                z = w0 * az + w1 * bz + w2 * cz
                if z > depth[y, x]:
                    depth[y, x] = z
                    owner[y, x] = owners[t]
                    for k in range(3):
                        image[y, x, k] = colours[t, k]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _blend(image, depth, x, y, z, colour, alpha, hidden, bias):  # type: ignore[no-untyped-def]
    h, w = depth.shape
    if x < 0 or y < 0 or x >= w or y >= h:
        return
    a = alpha if z + bias >= depth[y, x] else hidden
    if a > 0.0:
        for k in range(3):
            image[y, x, k] += a * (colour[k] - image[y, x, k])


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _strokes(segments, start, colour, width, alpha, hidden, bias, dash, image, depth):  # type: ignore[no-untyped-def]
    # one pixel column across the line per step along its longer axis, so that no pixel is blended twice
    h, w = depth.shape
    low = -(width // 2)
    for s in range(segments.shape[0]):
        x0, y0, z0 = segments[s, 0, 0], segments[s, 0, 1], segments[s, 0, 2]
        dx, dy, dz = segments[s, 1, 0] - x0, segments[s, 1, 1] - y0, segments[s, 1, 2] - z0
        reach = max(abs(dx), abs(dy))
        if not math.isfinite(reach) or reach > 1e5:
            continue
        n = max(int(math.ceil(reach)), 1)
        length = math.hypot(dx, dy)
        flat = abs(dx) >= abs(dy)
        for i in range(n):
            f = (i + 0.5) / n
            if dash > 0.0 and (start[s] + f * length) % (2.0 * dash) >= dash:
                continue
            x, y = int(math.floor(x0 + f * dx)), int(math.floor(y0 + f * dy))
            if x < -width or y < -width or x > w + width or y > h + width:
                continue
            for k in range(low, low + width):
                if flat:
                    _blend(image, depth, x, y + k, z0 + f * dz, colour, alpha, hidden, bias)
                else:
                    _blend(image, depth, x + k, y, z0 + f * dz, colour, alpha, hidden, bias)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _dots(points, colour, width, alpha, hidden, bias, image, depth):  # type: ignore[no-untyped-def]
    low = -(width // 2)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (abs(x) < 1e6 and abs(y) < 1e6):
            continue
        for j in range(low, low + width):
            for k in range(low, low + width):
                _blend(image, depth, int(math.floor(x)) + k, int(math.floor(y)) + j, z, colour, alpha, hidden, bias)
