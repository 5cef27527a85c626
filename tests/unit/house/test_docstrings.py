"""What the project promises about its docstrings, read from the source without importing it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from tests.source_tree import modules

ARRAY = re.compile(r"\b(NDArray|ndarray|F64|F32|I32|I64|U8|BOOL|Array)\b")
SHAPE = re.compile(r"\(\s*[\w*+\-. ]+\s*,(\s*[\w*+\-. ]+\s*,?)*\s*\)")
UNIT = re.compile(
    r"\b(mm|rad|deg|min|unit|units|unitless|indices|index|bool|parameters?|rows?|counts?|fractions?|numbers?|ids?|mask"
    r"|uint8|weights?|labels?)\b|mm[²³]|0\.\.1"
)


def public(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef]:
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node


def array_parameters(node: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return [a.arg for a in every if a.annotation is not None and ARRAY.search(ast.unparse(a.annotation))]


CASES = [(name, tree) for name, tree in modules() if "migrations" not in name]


@pytest.mark.parametrize(("name", "tree"), CASES, ids=[n for n, _ in CASES])
def test_module_and_everything_public_in_it_has_a_docstring(name, tree):
    missing = [] if ast.get_docstring(tree) else ["the module itself"]
    missing += [f"{n.name} (line {n.lineno})" for n in public(tree) if not ast.get_docstring(n)]
    assert not missing, f"{name}: no docstring on {', '.join(missing)}"


@pytest.mark.parametrize(("name", "tree"), CASES, ids=[n for n, _ in CASES])
def test_array_parameters_come_with_shape_and_unit(name, tree):
    wrong = []
    for node in public(tree):
        if isinstance(node, ast.ClassDef) or not array_parameters(node):
            continue
        text = ast.get_docstring(node) or ""
        if not SHAPE.search(text):
            wrong.append(f"{node.name} (line {node.lineno}): no shape such as (n, 3)")
        elif not UNIT.search(text):
            wrong.append(f"{node.name} (line {node.lineno}): no unit")
    assert not wrong, f"{name}: {'; '.join(wrong)}"


def test_the_rule_notices_what_it_should():
    """A checker that cannot fail is none: a function without shape, without unit, and a right one."""
    assert not SHAPE.search("points in mm") and SHAPE.search("points : (n, 3) float64, mm")
    assert SHAPE.search("(m,) int32") and not UNIT.search("(n, 3) float64 normalised")
    tree = ast.parse("def f(a: F64, b: int) -> F64:\n    return a\n")
    assert array_parameters(next(public(tree))) == ["a"]
