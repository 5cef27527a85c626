"""What the project promises about its docstrings, read from the source without importing it."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator

import pytest

from tests.source_tree import ROOT, modules

SPEC = importlib.util.spec_from_file_location("docstrings", ROOT / ".ci" / "docstrings.py")
assert SPEC is not None and SPEC.loader is not None
docstrings = importlib.util.module_from_spec(SPEC)
sys.modules["docstrings"] = docstrings
SPEC.loader.exec_module(docstrings)

CASES = [(name, tree) for name, tree in modules() if "migrations" not in name]
FILES = docstrings.chosen([])


def public(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef]:
    """Public functions and classes of a module."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node


@pytest.mark.parametrize(("name", "tree"), CASES, ids=[n for n, _ in CASES])
def test_module_and_everything_public_in_it_has_a_docstring(name, tree):
    missing = [] if ast.get_docstring(tree) else ["the module itself"]
    missing += [f"{n.name} (line {n.lineno})" for n in public(tree) if not ast.get_docstring(n)]
    assert not missing, f"{name}: no docstring on {', '.join(missing)}"


@pytest.mark.parametrize("path", FILES, ids=[str(p.relative_to(ROOT)) for p in FILES])
def test_arrays_have_shape_dtype_unit_and_frame_and_errors_their_class(path):
    wrong = [f"{p.where}: {', '.join(p.missing)}" for p in docstrings.places(path) if p.missing]
    assert not wrong, "\n".join(wrong)


def test_formulas_name_their_source():
    assert sum(p.source for path in FILES for p in docstrings.places(path)) >= docstrings.LEAST_SOURCES


def judge(source: str) -> tuple[str, ...]:
    """What the rules find missing in the one function of a source."""
    (node,) = ast.parse(source).body
    assert isinstance(node, ast.FunctionDef)
    return docstrings.judged(node, "", "x").missing


def test_the_rules_notice_what_they_should():
    """A checker that cannot fail is none."""
    head = "def f(a: F64) -> None:\n    '''"
    assert judge(f"{head}Do.'''") == ("no word on a", "no shape", "no dtype", "no unit")
    assert judge(f"{head}a : (n, 3) float64, mm'''") == ("no frame",)
    assert judge(f"{head}a : (n, 3) float64, mm, setup frame'''") == ()
    assert judge(f"{head}a : (n, 3) float64, rows of the setup frame'''") == ("no unit",)
    assert judge("def f():\n    '''Do.'''\n    raise InputError('x')") == ("no Raises for InputError",)
    section = "Raises\n    ------\n    InputError"
    assert judge(f"def f():\n    '''Do.\n\n    {section}\n    '''\n    raise InputError('x')") == ()
