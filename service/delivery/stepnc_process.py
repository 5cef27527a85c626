"""Entry of the process that writes STEP-NC and reads it back: request on stdin, file names in the result.

The request is a pickle of the arguments of ``service.delivery.stepnc_files.stepnc_files``. Only the parent writes it.
"""

from __future__ import annotations

import json
import pickle
import sys

from geometry.child_process import TYPED_ERROR, guard_child
from geometry.errors import CamError


def main() -> int:
    """Write the files, answer with their kinds and places; returns the exit code."""
    result = guard_child()
    from service.delivery.stepnc_files import stepnc_files

    try:
        files = stepnc_files(*pickle.load(sys.stdin.buffer))
    except CamError as error:
        result.write_text(json.dumps(error.as_dict()))
        return TYPED_ERROR
    result.write_text(json.dumps({name: [kind, str(path)] for name, (kind, _, _, path) in files.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
