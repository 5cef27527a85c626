"""Draw docs/images/profile-c1.svg .. profile-c10.svg: one example of every profile type.

Run from the root of the repository: python docs/figures/profile_types.py. The control points stand below; the type is
asked of the classifier, and a picture that is not of the type it is named for stops the script.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.mesh import F64
from geometry.surfaces.bspline import SplineCurve, arc_length
from zones.plan_view.curve_bends import BendSide
from zones.plan_view.profile_types import CurveProfile, classify

IMAGES = Path(__file__).resolve().parents[1] / "images"
WIDTH, HEIGHT, MARGIN = 150.0, 70.0, 9.0
COLOURS = {BendSide.UP: "#c2410c", BendSide.DOWN: "#1d4ed8", None: "#111111"}
VOID = "#e8f1e4"


def humps(*heights: float, valley: float = 0.0) -> F64:
    """Control points of humps: two on every peak, one in every valley; (n, 2) float64, unitless."""
    y = [0.0]
    for h in heights:
        y += [h, h, valley]
    y[-1] = 0.0
    return np.column_stack([np.linspace(0, 1, len(y)), y])


def arcs(slope: float, radii: tuple[float, ...]) -> F64:
    """Arcs that turn right and left, tangent to each other, from heading ``slope`` (rad); (n, 2) float64, unitless."""
    at, heading, out = np.zeros(2), slope, [np.zeros(2)]
    for k, radius in enumerate(radii):
        turn = -2 * slope if k % 2 == 0 else 2 * slope
        for i in range(120):
            a = heading + turn * (i + 0.5) / 120
            at = at + radius * abs(turn) / 120 * np.array([np.cos(a), np.sin(a)])
            out.append(at)
        heading += turn
    p = np.array(out)
    return p / (p[-1] - p[0])[0]


def lobes(count: int, depth: float, one_end: float = 0.0) -> F64:
    """Control points of a ring with lobes, walked with the void outside; (n, 2) float64, unitless."""
    t = -np.arange(4 * count if count > 2 else 16) * 2 * np.pi / (4 * count if count > 2 else 16)
    r = (1 + depth * np.cos(count * t)) * (1 + one_end * np.cos(t))
    return np.column_stack([r * np.cos(t), r * np.sin(t)])


def open_curve(control: F64) -> F64:
    """Points of the open B-spline; control : (n, 2) float64, unitless."""
    return SplineCurve(control).at(np.linspace(0, 1, 500))


def ring(control: F64) -> F64:
    """Points of the closed B-spline; control : (n, 2) float64, unitless."""
    return SplineCurve(control, closed=True).at(np.linspace(0, 1, 500, endpoint=False))


ARCH = np.column_stack([np.linspace(0, 1, 10), 0.42 * np.sin(np.pi * np.linspace(0, 1, 10))])
EXAMPLES: dict[str, tuple[F64, bool]] = {
    "C1": (open_curve(ARCH), False),
    "C2": (open_curve(humps(0.3, 0.3)), False),
    "C3": (open_curve(humps(0.25, 0.25, 0.25)), False),
    "C4": (open_curve(ARCH * [1, -1]), False),
    "C5": (ring(lobes(5, 0.35)), True),
    "C6": (ring(lobes(2, 0.7, 0.2)), True),
    "C7": (open_curve(humps(0.36, 0.21, 0.13)), False),
    "C8": (open_curve(humps(0.13, 0.21, 0.36)), False),
    "C9": (arcs(1.1, (1.0, 0.35, 1.0, 0.35, 1.0)), False),
    "C10": (open_curve(humps(0.14, 0.17, 0.14, 0.17, 0.14)), False),
}


def path(p: F64, close: bool = False) -> str:
    """SVG path data; p : (n, 2) float64, pixels."""
    return "M" + " L".join(f"{x:.1f} {y:.1f}" for x, y in p) + ("Z" if close else "")


def placed(p: F64) -> F64:
    """Points in picture coordinates, y down; p : (n, 2) float64, unitless."""
    low, high = p.min(axis=0), p.max(axis=0)
    scale = min((WIDTH - 2 * MARGIN) / (high - low)[0], (HEIGHT - 2 * MARGIN) / max((high - low)[1], 1e-9))
    q = (p - 0.5 * (low + high)) * scale * [1, -1]
    return np.asarray(q + [0.5 * WIDTH, 0.5 * HEIGHT])


def picture(p: F64, closed: bool, found: CurveProfile) -> str:
    """SVG text: void tinted, up bends orange, down bends blue, chord dashed; p : (n, 2) float64, unitless."""
    q = placed(p)
    box = f'width="{WIDTH:.0f}" height="{HEIGHT:.0f}"'
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" {box} viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}">',
           f'<title>{found.type}</title>']
    if closed:
        out.append(f'<rect {box} fill="{VOID}"/><path d="{path(q[::6], True)}" fill="#ffffff"/>')
    else:
        over = np.vstack([[0, q[0, 1]], q[::6], q[-1:], [WIDTH, q[-1, 1]], [WIDTH, 0], [0, 0]])
        out.append(f'<rect {box} fill="#ffffff"/><path d="{path(over, True)}" fill="{VOID}"/>')
        out.append(f'<path d="{path(q[[0, -1]])}" fill="none" stroke="#888888" stroke-dasharray="3 3"/>')
    line = np.vstack([q[::6], q[-1:]])
    out.append(f'<path d="{path(line, closed)}" fill="none" stroke="{COLOURS[None]}" stroke-width="2"/>')
    r = np.vstack([q, q, q[:1]]) if closed else q
    s = arc_length(r) / arc_length(q, closed)[-1]
    for bend in found.bends:
        at = (s >= bend.start - 1e-3) & (s <= bend.end + 1e-3)
        piece = r[at]
        thin = np.vstack([piece[::4], piece[-1:]])
        out.append(f'<path d="{path(thin)}" fill="none" stroke="{COLOURS[bend.way]}" stroke-width="2"/>')
    return "\n".join([*out, "</svg>", ""])


def draw_all(folder: Path) -> list[Path]:
    """Write every picture into a folder.

    Returns the paths. Raises ValueError where an example is not of its type.
    """
    written = []
    for name, (points, closed) in EXAMPLES.items():
        found = classify(points, closed)
        if found.type != name:
            raise ValueError(f"the example of {name} is of type {found.type}")
        target = folder / f"profile-{name.lower()}.svg"
        target.write_text(picture(points, closed, found), encoding="utf-8")
        written.append(target)
    return written


if __name__ == "__main__":
    for file in draw_all(IMAGES):
        print(file.name, file.stat().st_size)
