"""Forward steps by the rule of a circular arc, which steps on true profiles are compared with."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from geometry.mesh import F64
from toolpath.passes.forward_step import LONGEST, PassProfile


def arc_rule(profile: PassProfile, radius: float, tolerance: float, longest: float = LONGEST) -> F64:
    """Distances along a pass by the rule of a circular arc, (n,) float64, mm [Sarkar2015, section 3.4].

    The curvature at the start of a step stands for all of it. Convex of radius R: cos phi = 1 - e / (R + r), concave
    1 - e / (R - r); the step is the chord 2 R sin phi. For comparison only: where the curvature changes this rule
    exceeds the tolerance.
    """
    s = profile.ways
    spline = CubicSpline(s, profile.contact)
    bend = np.einsum("ij,ij->i", spline(s, 2), profile.normal)  # positive concave
    out = [0.0]
    while out[-1] < profile.length:
        k = float(np.interp(out[-1], s, bend))
        step = longest
        if abs(k) > 1e-9:
            big = 1.0 / abs(k)
            share = tolerance / (big + radius if k < 0.0 else max(big - radius, 1e-9))
            if share < 1.0:
                step = min(2.0 * big * np.sin(np.arccos(1.0 - share)), longest)
        out.append(min(out[-1] + step, profile.length))
    return np.array(out)
