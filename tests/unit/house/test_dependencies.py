"""Rules of the layout that import-linter cannot say."""

from __future__ import annotations

import re

from geometry.kernels.sources import APART
from tests.source_tree import PACKAGES, ROOT, imports, modules


def test_kernels_import_numpy_numba_math_and_kernels_only():
    allowed = {"__future__", "typing", "numpy", "numba", "math"}
    wrong = []
    for name, tree in modules():
        if "kernels" not in name.split(".") or name in APART:  # no kernels: they name folders
            continue
        for target, line in imports(tree):
            top = target.split(".")[0]
            if top not in allowed and not (top in PACKAGES and "kernels" in target.split(".")):
                wrong.append(f"{name}:{line} imports {target}")
    assert not wrong, "\n".join(wrong)


def test_every_kernel_package_is_seen():
    assert {n.split(".")[0] for n, _ in modules() if "kernels" in n.split(".")} >= {"geometry", "verify"}


def test_the_lock_names_no_host():
    for lock in ("requirements.lock", "requirements-bench.lock"):
        lines = (ROOT / lock).read_text().splitlines()
        assert len(lines) > 50
        assert not [s for s in lines if "://" in s or s.startswith("-") or not re.match(r"^[a-z0-9._-]+(\[.+\])?==", s)]


def test_no_file_is_huge():
    files = [p for k in PACKAGES for p in (ROOT / k).rglob("*.py")]
    sizes = {str(p.relative_to(ROOT)): len(p.read_text().splitlines()) for p in files}
    assert not {p: n for p, n in sizes.items() if n > 600}, "a module this long hides a second concept"
