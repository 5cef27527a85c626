"""The project's own source files, read without importing them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples")


@cache
def modules() -> tuple[tuple[str, ast.Module], ...]:
    """(dotted name, syntax tree) of every module of the product, sorted."""
    out = []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            out.append((name, ast.parse(path.read_text(encoding="utf-8"), filename=str(path))))
    return tuple(out)


def imports(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Every imported module name and its line, wherever in the file it stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
