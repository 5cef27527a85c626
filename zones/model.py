"""Results of the decomposition of a part: immutable values, mm and rad, setup frame."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Wall:
    """A wall (blade, rib): ``faces`` are all its B-rep faces, ``sides`` the steep ones.

    thickness is the median inward ray length over the sides; height is z_top - z_bottom.
    """

    id: str
    faces: tuple[int, ...]
    sides: tuple[int, ...]
    thickness: float
    z_bottom: float
    z_top: float


@dataclass(frozen=True)
class Connection:
    """Material that bridges a channel with void below some part of its span.

    walls : two or more wall ids; one id twice = two stretches of one wall
    """

    id: str
    faces: tuple[int, ...]
    walls: tuple[str, ...]
    z_bottom: float
    z_top: float


@dataclass(frozen=True)
class Channel:
    """The void between two facing walls (or two stretches of one wall).

    gap_min : mm, least outward ray distance between the sides, without connections and fillets
    at      : mm, the start of that ray on the first wall
    """

    id: str
    walls: tuple[str, str]
    gap_min: float
    at: tuple[float, float, float]


@dataclass(frozen=True)
class Decomposition:
    """Walls, connections and channels of a part.

    face_role : role of every face number: 'wall', 'connection', 'floor', 'base', 'fillet' or 'free'
    seat      : faces of the seat (lowest plane facing away from the access)
    """

    walls: tuple[Wall, ...]
    connections: tuple[Connection, ...]
    channels: tuple[Channel, ...]
    face_role: dict[int, str] = field(default_factory=dict)
    seat: tuple[int, ...] = ()
    warnings: tuple[str, ...] = ()
