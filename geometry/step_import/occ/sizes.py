"""Checks of the size of a part and of its unit."""

from __future__ import annotations

import re

from geometry.errors import PartError
from geometry.mesh import F64

REFUSE_BELOW, REFUSE_ABOVE = 0.5, 10_000.0
DOUBT_BELOW, DOUBT_ABOVE = 2.0, 5_000.0
# Mean wall thickness (mm) below which a whole part is more likely in a wrong unit than machinable.
DOUBT_THICKNESS = 0.1
# Units that the author may have meant, in mm. The likeliest come first: mm against m is the usual mistake, since many
# CAD kernels count in metres; then inch.
FACTORS = {"mm": 1.0, "m": 1000.0, "inch": 25.4, "cm": 10.0, "foot": 304.8}
# Names of things that are larger than a metre. A small part under such a name gets a warning.
LARGE_THINGS = re.compile(r"wind[\s_-]*(turbine|blade)|turbine[\s_-]*tower|fuselage|\bhull\b|wing[\s_-]*spar",
                          re.IGNORECASE)


def check_size(box: F64, unit: str, factor: float) -> None:
    """Refuse a part whose size no milling machine can take.

    box    : (2, 3) float64, mm, STEP coordinates
    unit   : str, length unit of the file
    factor : float, mm in one unit of the file
    Raises PartError (``part_too_small`` below 0.5 mm overall, ``part_too_large`` above 10 m).
    """
    size = float((box[1] - box[0]).max())
    if REFUSE_BELOW <= size <= REFUSE_ABOVE:
        return
    small = size < REFUSE_BELOW
    raise PartError(
        f"the part measures {size:.4g} mm overall ({size / factor:.4g} {unit} in the file), "
        f"{'less' if small else 'more'} than the limit of {REFUSE_BELOW if small else REFUSE_ABOVE:g} mm"
        + _likely(size, unit, factor),
        code="part_too_small" if small else "part_too_large", measured=size,
        limit=REFUSE_BELOW if small else REFUSE_ABOVE,
        remedy="export the part in the unit it was drawn in")


def doubts(box: F64, volume: float, area: float, unit: str, factor: float, names: tuple[str, ...]) -> list[str]:
    """Sentences about a unit that may be wrong; nothing is rescaled.

    box    : (2, 3) float64, mm, STEP coordinates
    volume : float, mm³
    area   : float, mm²
    unit   : str, length unit of the file
    factor : float, mm in one unit of the file
    names  : product names in the file
    """
    size = float((box[1] - box[0]).max())
    thickness = 2.0 * volume / area if area > 0 else 0.0
    out = []
    if size < DOUBT_BELOW or size > DOUBT_ABOVE:
        out.append(f"the part measures {size:.4g} mm overall, unusual for milling; the unit '{unit}' may be wrong"
                   + _likely(size, unit, factor))
    elif thickness < DOUBT_THICKNESS:
        out.append(f"the mean wall thickness is {thickness:.3g} mm on a part of {size:.4g} mm; the unit '{unit}' may "
                   "be wrong" + _likely(size, unit, factor, DOUBT_THICKNESS / max(thickness, 1e-9)))
    large = [n for n in names if LARGE_THINGS.search(n)]
    if large and size < 1000.0:
        out.append(f"the file calls the part '{large[0]}', yet it measures {size:.4g} mm overall; if the unit '{unit}' "
                   "is wrong, the likely factor is 1000 (metres)")
    return out


def _likely(size: float, unit: str, factor: float, at_least: float = 0.0) -> str:
    """The likeliest unit that makes the part plausible, in words."""
    for name, millimetres in FACTORS.items():
        scale = millimetres / factor
        if name != unit and DOUBT_BELOW <= size * scale <= DOUBT_ABOVE and scale >= at_least:
            return f"; read as {name} it would be {size * scale:.4g} mm (factor {scale:.4g})"
    return ""
