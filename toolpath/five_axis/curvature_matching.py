"""Tilts of flat and bull-nose ends at which the nose curves across the feed as the surface does.

Notation
    M, n     : contact and unit normal out of the material; curvatures are positive where the part is concave
    l        : tangent of the nose circle at M; f the direction square to it on the surface, towards the tool axis
    eta      : tilt; the tool axis is cos(eta) n - sin(eta) f, so a tool fed along -f tilts forward
    k_l, k_f : normal curvatures of the surface along l and f
    R, r     : radius of the circle of corner centres (of the sharp edge of a flat, r = 0) and of the corner

A bull nose on a surface is a sharp flat of radius R on the surface offset by r, where k becomes k / (1 - r k). There,
with a = sin(eta) - R k_l and D = k_l - cos(eta)^2 k_f, the nose stands over a quadric at the angle t round it, l
principal, by

    R (1 - cos t) (a + D R (1 - cos t) / 2)

It is at the height h where q = R (1 - cos t) = (sqrt(a^2 + 2 D h) - a) / D. The half strip is sqrt(2 R q - q^2) to
either side. Contact is of second order at a = 0, of the first order where no tilt gives that (plane, convex). All of
this is second order; ``toolpath.five_axis.tilted_end`` measures heights on the true surface. Theory:
docs/theory/matching.md. The idea is that of [Marciniak1987] and [Li1995], completed here.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody

LEVEL = 1e-12  # a smaller D does not change a strip


def nose_radii(tool: ToolBody) -> tuple[float, float]:
    """R and r of a tool, mm."""
    r = min(tool.corner_radius, tool.radius)
    return tool.radius - r, r


def offset_curvature(k: F64, r: float) -> F64:
    """Curvature of the surface offset towards the tool [DoCarmo1976].

    k : (n,) float64, 1/mm, normal curvature, positive concave
    r : mm, offset

    Returns (n,) float64, 1/mm: k / (1 - r k); inf where a corner of radius r does not fit.
    """
    room = 1.0 - r * np.asarray(k, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(room > 0.0, k / room, np.inf))


def matching_tilt(k_l: F64, tool: ToolBody) -> F64:
    """Tilt at which the nose has the curvature of the surface: sin(eta) = R k_l on the offset surface [Li1995].

    k_l : (n,) float64, 1/mm, positive concave

    Returns (n,) float64, rad; nan outside 0 < k_l < 1 / radius.
    """
    big, r = nose_radii(tool)
    sine = big * offset_curvature(k_l, r)
    with np.errstate(invalid="ignore"):
        return np.arcsin(np.where((sine > 0.0) & (sine < 1.0), sine, np.nan))


def clear_tilt(k_1: F64, tool: ToolBody) -> F64:
    """Least tilt at which no part of the end enters a surface, from its greatest curvature [Marciniak1987].

    k_1 : (n,) float64, 1/mm, greatest normal curvature, positive concave

    Returns (n,) float64, rad: 0 where the surface is level or convex, nan where the end does not fit.

    Notes
    -----
    On a quadric the heel is free from sin(eta) = R k_f cos(eta)^2 on, on a round surface from R k_f on. The second is
    larger and holds for both. The greatest curvature is enough along any l.
    """
    big, r = nose_radii(tool)
    sine = np.maximum(big * offset_curvature(k_1, r), 0.0)
    with np.errstate(invalid="ignore"):
        return np.arcsin(np.where(sine < 1.0, sine, np.nan))


def strip_width(tilt: F64, k_l: F64, k_f: F64, tool: ToolBody, height: float) -> F64:
    """Width of the strip in which a tool fed along f leaves no more than a height [Li1995].

    tilt     : (n,) float64, rad
    k_l, k_f : (n,) float64, 1/mm, l along a principal direction
    height   : mm

    Returns (n,) float64, mm on the surface.

    Notes
    -----
    Second order in h. Where the tool tilts less than the match the strip includes the groove that it cuts
    (``gouge_depth``). The whole end is wide where it stands no higher than ``height`` all round.
    """
    big, r = nose_radii(tool)
    across, along = offset_curvature(k_l, r), offset_curvature(k_f, r)
    a, bend = np.sin(tilt) - big * across, across - along * np.cos(tilt) ** 2
    root = a * a + 2.0 * bend * height
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.where(np.abs(bend) > LEVEL, (np.sqrt(root) - a) / bend, height / a)
        # convex across: the nose rises and comes back; where it never reaches the height it is wide all round
        q = np.where((root < 0.0) | (q > big) | ((a <= 0.0) & (np.abs(bend) <= LEVEL)), big, q)
    half = np.sqrt(np.maximum(2.0 * big * q - q * q, 0.0))
    return np.asarray(2.0 * half / (1.0 - r * np.asarray(k_l)))


def gouge_depth(tilt: F64, k_l: F64, k_f: F64, tool: ToolBody) -> F64:
    """Depth to which the nose cuts beside the contact where the tilt is less than the match [Li1995].

    tilt     : (n,) float64, rad
    k_l, k_f : (n,) float64, 1/mm, positive concave

    Returns (n,) float64, mm: a² / (2 D), second order; 0 where the tilt is enough, inf where D <= 0.
    """
    big, r = nose_radii(tool)
    across, along = offset_curvature(k_l, r), offset_curvature(k_f, r)
    a, bend = np.sin(tilt) - big * across, across - along * np.cos(tilt) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(a < 0.0, np.where(bend > LEVEL, a * a / (2.0 * bend), np.inf), 0.0))


def mean_direction(angle: F64, weight: F64) -> tuple[float, float]:
    """Mean of the best feed directions of the places of an area [Li1995].

    angle  : (n,) float64, rad, best feed on the surface; opposite directions are the same (mod pi)
    weight : (n,) float64, weight of each place, for example its area in mm²

    Returns
    -------
    mean : rad, in (-pi/2, pi/2]; the printed mean of tangents breaks near 90 degrees, doubled angles do not
    spread : dimensionless, 0 where all agree, 1 where they cancel
    """
    total = float(np.sum(weight))
    vector = np.sum(weight * np.exp(2j * np.asarray(angle))) / total if total > 0.0 else 0j
    return 0.5 * float(np.angle(vector)), 1.0 - float(abs(vector))
