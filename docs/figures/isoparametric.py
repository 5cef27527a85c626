"""Draw docs/images/iso-case-1.svg, iso-case-2.svg and iso-chord.svg: grids, passes, chordal error along a pass.

Run from the root of the repository: python docs/figures/isoparametric.py. The regions are those of
benchmarks/passes/bench_isoparametric.py; what is drawn is what the program computes.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from benchmarks.passes.arc_rule import arc_rule  # noqa: E402
from benchmarks.passes.bench_isoparametric import RADIUS, SCALLOP, case, exact_errors  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.parameterization.square_patches import Method, Squared, squared  # noqa: E402
from toolpath.passes.forward_step import PassProfile, steps  # noqa: E402
from toolpath.passes.isoparametric_passes import IsoSurface, lay_out  # noqa: E402

IMAGES = Path(__file__).resolve().parents[1] / "images"
WIDTH, GAP = 420.0, 24.0
GRID, PASS, INK, OURS, ARC = "#94a3b8", "#c2410c", "#111111", "#1d4ed8", "#c2410c"
LINES = 17


def polyline(points: F64, colour: str, width: float) -> str:
    """Points (n, 2) of the picture as an SVG polyline."""
    at = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{at}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def label(x: float, y: float, words: str, anchor: str = "start") -> str:
    """Words at a place of the picture."""
    return f'<text x="{x:.1f}" y="{y:.1f}" font-family="sans-serif" font-size="12" fill="{INK}" ' \
           f'text-anchor="{anchor}">{words}</text>'


def grids(name: str, path: Path) -> None:
    """Three panels: the lines of each re-parameterisation, and the passes on the second."""
    trim = case(name)
    pieces = {m: squared(trim.loops, trim.scale, only=m)[0] for m in (Method.LAPLACE, Method.FRONTS)}
    low, high = trim.loops[0].min(axis=0), trim.loops[0].max(axis=0)
    tall = WIDTH * (high - low)[1] / (high - low)[0]
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {3 * WIDTH + 4 * GAP:.0f} {tall + 3 * GAP:.0f}">',
           '<rect width="100%" height="100%" fill="white"/>']

    def placed(uv: F64, panel: int) -> F64:
        share = (uv - low) / (high - low)
        return np.column_stack([GAP + panel * (WIDTH + GAP) + WIDTH * share[:, 0], 2 * GAP + tall * (1 - share[:, 1])])

    t = np.linspace(0.0, 1.0, 61)
    for panel, (method, piece) in enumerate(pieces.items()):
        for at in np.linspace(0.0, 1.0, LINES):
            out.append(polyline(placed(piece.map(t, np.full(len(t), at)), panel), GRID, 1.0))
            out.append(polyline(placed(piece.map(np.full(len(t), at), t), panel), GRID, 1.0))
        a, b = piece.evenness
        out.append(label(GAP + panel * (WIDTH + GAP), 1.4 * GAP,
                         f"{method}: largest over smallest cell {a:.2f}, distance across {b:.2f}"))
    piece = pieces[Method.FRONTS]
    etas = lay_out(IsoSurface(trim.surface, piece.map), RADIUS, SCALLOP)
    for eta in etas.tolist():
        out.append(polyline(placed(piece.map(t, np.full(len(t), eta)), 2), PASS, 1.2))
    out.append(label(GAP + 2 * (WIDTH + GAP), 1.4 * GAP,
                     f"{len(etas)} passes of a ball of {RADIUS:g} mm, scallop {SCALLOP:g} mm"))
    path.write_text("\n".join([*out, "</svg>"]) + "\n")


def chord(path: Path) -> None:
    """The greatest chordal error of each step of the fourth pass of case I, by both rules (the paper's figure 9)."""
    trim = case("I")
    piece: Squared = squared(trim.loops, trim.scale)[0]
    iso = IsoSurface(trim.surface, piece.map)
    eta = float(lay_out(iso, RADIUS, SCALLOP)[3])
    wide, tall, tolerance = 900.0, 260.0, 0.005
    profile = PassProfile.of(iso.curve(eta), tolerance, RADIUS)
    rows = {}
    for words, ends in (("circular arc at the start of the step", arc_rule(profile, RADIUS, tolerance)),
                        ("true profile", steps(profile, RADIUS, tolerance))):
        rows[words] = ends, exact_errors(iso, eta, profile.parameters(ends), RADIUS)
    most = 1.15 * max(float(off.max()) for _, off in rows.values())
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide + 4 * GAP:.0f} {tall + 4 * GAP:.0f}">',
           '<rect width="100%" height="100%" fill="white"/>']

    def placed(way: F64, off: F64) -> F64:
        return np.column_stack([2.5 * GAP + wide * way / profile.length, 2 * GAP + tall * (1 - off / most)])

    for value in (0.0, tolerance):
        line = placed(np.array([0.0, profile.length]), np.full(2, value))
        out += [polyline(line, INK, 0.8), label(2.2 * GAP, float(line[0, 1]) + 4, f"{value:g}", "end")]
    for k, (colour, (words, (ends, off))) in enumerate(zip((ARC, OURS), rows.items(), strict=True)):
        stairs = placed(np.repeat(ends, 2)[1:-1], np.repeat(off, 2))
        out += [polyline(stairs, colour, 2.0), label(2.5 * GAP + 330.0 * k, 1.2 * GAP, words).replace(INK, colour)]
    out.append(label(2.5 * GAP + 0.5 * wide, tall + 3.4 * GAP,
                     f"way along the fourth pass, 0 to {profile.length:.0f} mm; chordal error by step, mm", "middle"))
    path.write_text("\n".join([*out, "</svg>"]) + "\n")


if __name__ == "__main__":
    grids("I", IMAGES / "iso-case-1.svg")
    grids("II", IMAGES / "iso-case-2.svg")
    chord(IMAGES / "iso-chord.svg")
