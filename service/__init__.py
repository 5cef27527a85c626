"""HTTP, command line, jobs and the engine: the only layer that may import all others.

Here live settings, the pipeline and its rooms. Geometry, planning and simulation do not live here.
"""

import os

# Matrices here have three columns: threads of OpenBLAS win nothing on them and wait for each other on a busy machine.
# It reads the variable when numpy is imported, which a module of this package does.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
