"""The cutter as a shape: its profile and the envelope it sweeps.

No path is planned here.
"""

from toolpath.cutter.cutter import Cutter

__all__ = ["Cutter"]
