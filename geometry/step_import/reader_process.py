"""Entry of the reader's child process: request on stdin, part, patches or error in the result file.

Where both are wanted, the part is handed over first.

The module has no heavy imports at its top, so that limits are set before the CAD kernel is loaded.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from geometry.child_process import TYPED_ERROR, guard_child, hand_over
from geometry.errors import CamError, PartError, ResourceError


def main() -> int:
    """Read the request, load the part, write the answer; returns the exit code."""
    result = guard_child()
    request = json.load(sys.stdin)
    try:
        data = _load(request, result)
    except CamError as error:
        result.write_text(json.dumps(error.as_dict()))
        return TYPED_ERROR
    except MemoryError:
        result.write_text(json.dumps(ResourceError("out of memory", code="out_of_memory").as_dict()))
        return TYPED_ERROR
    result.write_bytes(data)
    return 0


def _load(request: dict, result: Path | None = None) -> bytes:
    from geometry.setup_frame import SetupFrame

    placement = request.pop("placement")
    where = SetupFrame(**placement) if placement else None
    try:
        wanted = request.pop("wanted", "part")
        if wanted == "patches":
            from geometry.step_import.occ.patches import load_patches

            return load_patches(placement=where, **request)
        if wanted == "both" and result is not None:
            from geometry.step_import.occ.loading import load_solid, part_of

            flat, solid, fuse = request.pop("flat"), request.pop("solid"), request.pop("fuse")
            loaded = load_solid(request.pop("path"), solid, fuse)
            part = part_of(loaded, placement=where, **request)
            hand_over(result, part.to_bytes())
            from geometry.step_import.occ.patches import patches_of

            return patches_of(loaded.body, where, [f.number for f in part.faces if flat or f.surface != "plane"])
        from geometry.step_import.occ.loading import load_part

        return load_part(placement=where, **request).to_bytes()
    except CamError:
        raise
    except Exception as problem:
        # pybind registers the kernel's exceptions below Exception; others are bugs and appear as a crash
        if not type(problem).__module__.startswith("OCP"):
            raise
        raise PartError(f"the CAD kernel failed: {type(problem).__name__}: {problem}", code="kernel_failed",
                        remedy="export the part again, if possible from another program") from problem


if __name__ == "__main__":
    sys.exit(main())
