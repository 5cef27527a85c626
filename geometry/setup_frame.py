"""The setup frame: where program zero lies in the coordinates of the STEP file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from geometry.errors import SetupError
from geometry.mesh import F64

# Below this angle (rad) between z and x the frame is not determined well enough.
MIN_AXIS_ANGLE = 1e-3


@dataclass(frozen=True)
class SetupFrame:
    """The setup frame given in STEP coordinates, mm.

    origin : (3,) float, mm, program zero in STEP coordinates
    z_axis : (3,) float, setup +Z (tool axis of a 3-axis job) in STEP coordinates, any length but zero
    x_axis : (3,) float, setup +X; only its part square to ``z_axis`` counts

    Raises SetupError (``bad_placement``) for non-finite numbers, a zero axis or parallel axes.

    >>> SetupFrame((1, 2, 3)).matrix @ [1, 2, 3, 1]
    array([0., 0., 0., 1.])
    """

    origin: Sequence[float] = (0.0, 0.0, 0.0)
    z_axis: Sequence[float] = (0.0, 0.0, 1.0)
    x_axis: Sequence[float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("origin", "z_axis", "x_axis"):
            object.__setattr__(self, name, _triple(name, getattr(self, name)))
        for name in ("z_axis", "x_axis"):
            if np.linalg.norm(getattr(self, name)) < 1e-9:
                raise SetupError(f"placement {name} has no length", code="bad_placement", subjects=(name,),
                                 measured=0.0, limit=1e-9, remedy="give a direction, for example [0, 0, 1]")
        angle = _angle(np.array(self.z_axis), np.array(self.x_axis))
        if angle < MIN_AXIS_ANGLE or angle > np.pi - MIN_AXIS_ANGLE:
            raise SetupError("placement z_axis and x_axis are parallel, so the frame is not determined",
                             code="bad_placement", subjects=("z_axis", "x_axis"), measured=angle,
                             limit=MIN_AXIS_ANGLE, remedy="give an x_axis that is square to z_axis")

    @cached_property
    def inverse(self) -> F64:
        """(4, 4) float64, dimensionless but for the shift in mm: setup frame -> STEP coordinates; columns are axes."""
        z = np.array(self.z_axis) / np.linalg.norm(self.z_axis)
        x = np.array(self.x_axis) / np.linalg.norm(self.x_axis)
        x = x - (x @ z) * z
        x /= np.linalg.norm(x)
        out = np.eye(4)
        out[:3, 0], out[:3, 1], out[:3, 2], out[:3, 3] = x, np.cross(z, x), z, self.origin
        return out

    @cached_property
    def matrix(self) -> F64:
        """(4, 4) float64, dimensionless but for the shift in mm: rigid, from STEP coordinates to the setup frame."""
        rotation = self.inverse[:3, :3].T
        out = np.eye(4)
        out[:3, :3] = rotation
        # + 0.0 turns a negative zero into a plain one; otherwise printed numbers show the sign
        out[:3, 3] = -rotation @ np.array(self.origin) + 0.0
        return out

    def as_dict(self) -> dict[str, list[float]]:
        """Plain lists, for a pipe between processes; ``SetupFrame(**d)`` reads them back."""
        return {"origin": list(self.origin), "z_axis": list(self.z_axis), "x_axis": list(self.x_axis)}


def _triple(name: str, value: Any) -> tuple[float, float, float]:
    try:
        a, b, c = (float(x) for x in value)
    except (TypeError, ValueError):
        raise SetupError(f"placement {name} is not three numbers", code="bad_placement", subjects=(name,),
                         measured=str(value), remedy="give three numbers") from None
    if not np.isfinite([a, b, c]).all():
        raise SetupError(f"placement {name} is not finite", code="bad_placement", subjects=(name,),
                         measured=str(value), remedy="give three finite numbers")
    return a, b, c


def _angle(a: F64, b: F64) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
