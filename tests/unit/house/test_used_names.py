"""Names of the project's modules that a test or a benchmark uses or replaces exist, in those of the slow set too."""

from __future__ import annotations

import ast
import importlib
import tokenize
from collections.abc import Iterator
from types import ModuleType

import pytest

from tests.source_tree import PACKAGES, ROOT


def _module(name: str) -> ModuleType | None:
    """A module of the project, None where there is none of that name."""
    if name.partition(".")[0] not in PACKAGES:
        return None
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not name.startswith(error.name):
            raise
        return None


def _imported(tree: ast.AST) -> tuple[dict[str, ModuleType], list[str]]:
    """The project's modules by the names they have in a file, and the names it imports that do not exist."""
    modules: dict[str, ModuleType] = {}
    missing: list[str] = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or not node.module or node.level:
            continue
        home = _module(node.module)
        if home is None:
            continue
        for alias in node.names:
            full = f"{node.module}.{alias.name}"
            below = getattr(home, alias.name) if hasattr(home, alias.name) else _module(full)
            if isinstance(below, ModuleType):
                modules[alias.asname or alias.name] = below
            elif below is None and not hasattr(home, alias.name):
                missing.append(f"line {node.lineno}: {full}")
    return modules, missing


def _used(tree: ast.AST, modules: dict[str, ModuleType]) -> Iterator[tuple[int, ModuleType, str]]:
    """Line, module and name of what a file reads of a module, or replaces by ``setattr``."""
    own = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    own |= {n.arg for n in ast.walk(tree) if isinstance(n, ast.arg)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id in modules and node.value.id not in own:
                yield node.lineno, modules[node.value.id], node.attr
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "setattr":
            match node.args:
                case [ast.Name(id=of), ast.Constant(value=str(name)), *_] if of in modules and of not in own:
                    if not any(k.arg == "raising" for k in node.keywords):
                        yield node.lineno, modules[of], name


def test_names_exist() -> None:
    """One test for all files: the modules they use are loaded once."""
    pytest.importorskip("cadquery")  # modules that draw parts import it
    missing: list[str] = []
    for path in (p for folder in ("tests", "benchmarks") for p in sorted((ROOT / folder).rglob("*.py"))):
        with tokenize.open(path) as file:
            tree = ast.parse(file.read())
        modules, lost = _imported(tree)
        lost += [f"line {line}: {module.__name__}.{name}" for line, module, name in _used(tree, modules)
                 if not hasattr(module, name) and _module(f"{module.__name__}.{name}") is None]
        missing += [f"{path.relative_to(ROOT)}, {what}" for what in lost]
    assert not missing


def test_a_replaced_name_that_has_moved_is_missing() -> None:
    lines = ("from toolpath.linking import linker", "monkeypatch.setattr(linker, 'way_down', None)", "linker.Linker")
    tree = ast.parse("\n".join(lines))
    modules, missing = _imported(tree)
    used = [(line, name, hasattr(module, name)) for line, module, name in _used(tree, modules)]
    assert sorted(used) == [(2, "way_down", False), (3, "Linker", True)] and not missing
