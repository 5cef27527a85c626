"""Text and symbols on pictures: Pillow's own font, axes, a scale bar, tables, colour swatches."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PIL import ImageDraw, ImageFont
from PIL.ImageFont import FreeTypeFont

from output.header_text import ascii_text, decimal
from service.pictures.camera import Camera

RGB = tuple[float, float, float]
WHITE: RGB = (1.0, 1.0, 1.0)
PAPER: RGB = (0.965, 0.972, 0.98)
INK: RGB = (0.10, 0.12, 0.15)
GREY: RGB = (0.35, 0.38, 0.43)
AXES: tuple[tuple[str, RGB], ...] = (("X", (0.80, 0.10, 0.10)), ("Y", (0.05, 0.55, 0.10)), ("Z", (0.10, 0.25, 0.80)))


def font(size: int) -> FreeTypeFont:
    """Pillow's own font: the same glyphs on every machine.

    Raises
    ------
    RuntimeError
        Pillow was built without FreeType.
    """
    found = ImageFont.load_default(size)
    if not isinstance(found, FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType")
    return found


def bytes_of(colour: RGB) -> tuple[int, int, int]:
    """A colour of 0..1 as bytes."""
    r, g, b = (int(round(255 * max(0.0, min(1.0, c)))) for c in colour)
    return (r, g, b)


def draw_triad(pen: ImageDraw.ImageDraw, camera: Camera, origin: tuple[float, float]) -> None:
    """The axes in the view of the camera, with their names."""
    for axis, (name, colour) in enumerate(AXES):
        dx, dy = 36.0 * camera.basis[0, axis], -36.0 * camera.basis[1, axis]
        pen.line([origin, (origin[0] + dx, origin[1] + dy)], fill=bytes_of(colour), width=3)
        pen.text((origin[0] + 1.32 * dx, origin[1] + 1.32 * dy), name, font=font(15), anchor="mm",
                 fill=bytes_of(colour))


def scale_length(scale: float, width: float = 200.0) -> float:
    """The longest of 1, 2, 5 x 10^k mm that is at most ``width`` pixels at ``scale`` pixels per mm."""
    longest = width / scale
    ten = 10.0 ** math.floor(math.log10(longest))
    return max(k * ten for k in (1.0, 2.0, 5.0) if k * ten <= longest * (1 + 1e-12))


def draw_scale(pen: ImageDraw.ImageDraw, camera: Camera, end: tuple[float, float]) -> None:
    """A bar of a round length in mm that ends at ``end``, in the halved picture of the camera."""
    pixels = 0.5 * camera.scale
    length = scale_length(pixels)
    x0, x1, y = end[0] - length * pixels, end[0], end[1]
    ink = bytes_of(INK)
    pen.line([(x0, y), (x1, y)], fill=ink, width=2)
    for x in (x0, x1):
        pen.line([(x, y - 5), (x, y + 5)], fill=ink, width=2)
    pen.text((0.5 * (x0 + x1), y - 6), f"{decimal(length)} mm", font=font(15), anchor="mb", fill=ink)


def draw_pairs(pen: ImageDraw.ImageDraw, pairs: Sequence[tuple[str, str]], x: int, y: int, *, wide: int = 285,
               indent: int = 150) -> None:
    """Up to ten label-value pairs in two columns; a column is ``wide`` pixels, values are indented by ``indent``
    pixels.
    """
    for i, (key, value) in enumerate(pairs[:10]):
        left, line = x + wide * (i // 5), y + 21 * (i % 5)
        pen.text((left, line), ascii_text(key), font=font(15), fill=bytes_of(GREY))
        pen.text((left + indent, line), ascii_text(value), font=font(15), fill=bytes_of(INK))


def draw_swatches(pen: ImageDraw.ImageDraw, entries: Sequence[tuple[str, RGB | None]], x: int, y: int, *, columns: int,
                  step: int) -> None:
    """Colours with their names, five to a column; None is text without a colour."""
    for i, (name, colour) in enumerate(entries[:5 * columns]):
        left, line = x + step * (i // 5), y + 21 * (i % 5)
        if colour is not None:
            pen.rectangle([left, line + 2, left + 22, line + 14], fill=bytes_of(colour),
                          outline=bytes_of((0.5, 0.5, 0.5)))
        pen.text((left + 30, line), ascii_text(name), font=font(15), fill=bytes_of(INK))
