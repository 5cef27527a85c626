"""Options of numba for every kernel here, in one place.

``error_model`` numpy: a division by zero gives inf or NaN instead of raising, which a kernel must not do.
``no_cfunc_wrapper``: no kernel is handed to another one as a value, so the code for that is not compiled.
Rows are written one number at a time where they come from an array or a tuple: for ``a[i] = b[j]`` numba compiles the
message of a wrong shape, which takes it seconds.
No fast-math: bounds rely on infinities, and the same bytes on every machine rely on the order of operations.
"""

from typing import Any

KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
