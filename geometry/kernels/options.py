"""Options of numba for every kernel here, in one place.

``error_model`` numpy: a division by zero gives inf or NaN instead of raising, which a kernel must not do.
No fast-math: bounds rely on infinities, and the same bytes on every machine rely on the order of operations.
"""

from typing import Any

KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
