"""Fillets in a separate process, because the CAD kernel crashes on some of them.

    python -m examples.family.fillets IN.brep OUT.brep RADIUS EDGE [EDGE ...]

Edges are numbered in the order in which the kernel lists them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TIME_LIMIT = 60.0


def filleted(solid: Any, radius: float, edges: list[int]) -> Any | None:
    """A solid with fillets of ``radius`` mm on some of its edges, or None where the kernel cannot make them.

    solid : cadquery Solid
    edges : places in ``solid.Edges()``
    """
    import cadquery as cq

    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder, "before.brep"), Path(folder, "after.brep")
        cq.Shape.exportBrep(solid, str(before))
        command = [sys.executable, "-m", "examples.family.fillets", str(before), str(after), repr(radius),
                   *map(str, edges)]
        try:
            done = subprocess.run(command, cwd=Path(__file__).resolve().parents[2], capture_output=True,
                                  timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            return None
        if done.returncode != 0 or not after.exists():
            return None
        solids = cq.Shape.importBrep(str(after)).Solids()
    return solids[0] if len(solids) == 1 and solids[0].isValid() else None


def main(arguments: list[str]) -> int:
    """Run the command of the module docstring; returns 0 when the file was written."""
    import cadquery as cq

    before, after, radius, *edges = arguments
    solid = cq.Shape.importBrep(before).Solids()[0]
    listed = solid.Edges()
    cq.Shape.exportBrep(solid.fillet(float(radius), [listed[int(k)] for k in edges]), after)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
