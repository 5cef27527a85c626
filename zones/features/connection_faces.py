"""Base region of every face, and the connection that a face or fillet belongs to."""

from __future__ import annotations

from geometry.part import Part
from zones.model import Connection, Decomposition


def face_bases(part: Part, decomposition: Decomposition) -> dict[int, str]:
    """Base region of every face number by its role alone; the side of a wall gets the wall's outside.

    Fillets of a connection belong to it (``connection_of``).
    """
    base: dict[int, str] = {}
    for w in decomposition.walls:
        base.update(dict.fromkeys(w.faces, "top"))
        base.update(dict.fromkeys(w.sides, w.id))
    base.update(connection_of(part, decomposition))
    for info in part.faces:
        role = decomposition.face_role.get(info.number, "free")
        base.setdefault(info.number, "floor" if role in ("floor", "base") else "free")
    return base


def connection_faces(part: Part, decomposition: Decomposition) -> dict[str, tuple[int, ...]]:
    """Face numbers of every connection with its fillets, by id, ascending.

    A fillet along an edge of the connection belongs to it. So does a fillet between two of those that meets nothing
    else but walls: the patch at a corner of the span. A fillet between two connections belongs to both.
    """
    role = decomposition.face_role
    fillets = {f for f, r in role.items() if r == "fillet"}
    beside: dict[int, set[int]] = {}
    for e in part.edges:
        a, b = e.faces
        if a != b:
            beside.setdefault(a, set()).add(b)
            beside.setdefault(b, set()).add(a)
    return {c.id: _with_fillets(c, fillets, role, beside) for c in decomposition.connections}


def _with_fillets(c: Connection, fillets: set[int], role: dict[int, str],
                  neighbours: dict[int, set[int]]) -> tuple[int, ...]:
    body = set(c.faces)
    own = body | {f for f in fillets if neighbours.get(f, set()) & body}
    around = {g for f in own - body for g in neighbours[f]}
    patches = {f for f in (around & fillets) - own
               if len(neighbours[f] & own) > 1 and all(g in own or role.get(g) == "wall" for g in neighbours[f])}
    return tuple(sorted(own | patches))


def connection_of(part: Part, decomposition: Decomposition) -> dict[int, str]:
    """Id of the connection by the number of each of its faces and fillets; a shared fillet belongs to the first."""
    own = {f: c.id for c in decomposition.connections for f in c.faces}
    for c, faces in connection_faces(part, decomposition).items():
        for f in faces:
            own.setdefault(f, c)
    return own
