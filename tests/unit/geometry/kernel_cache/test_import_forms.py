"""The sources of kernels use only the forms of import and of registering that ``geometry.kernel_cache.sources`` finds.

A form that it overlooks would leave stale machine code after an edit, in silence. So would a string that it takes for a
docstring.
"""

from __future__ import annotations

import ast
import functools

import pytest

from geometry.kernel_cache.sources import _DOCSTRING as DOCSTRING
from geometry.kernel_cache.sources import PACKAGES, REGISTERS, Sources, import_statements, without_docstrings

SOURCES = Sources()


@functools.cache
def read() -> list[str]:
    """Every project module that the machine code of some kernel can depend on."""
    return sorted(set().union(*(SOURCES.dependencies(name) for name in SOURCES.compiled())))


def overlooked(text: str) -> list[str]:
    """Imports and registrations of a source text that ``Sources`` does not see, as text."""
    seen = {ast.unparse(s) for s in import_statements(text)}
    out = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom) and ast.unparse(node) not in seen:
            out.append(ast.unparse(node))
        if isinstance(node, ast.Import):
            out += [f"import {a.name}" for a in node.names
                    if a.name.split(".")[0] in PACKAGES and SOURCES.root.joinpath(*a.name.split(".")).is_dir()]
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in REGISTERS:
            out.append(ast.unparse(node))
    return out


def test_every_import_of_a_kernel_is_found():
    assert len(read()) > 40
    faults = {name: overlooked(SOURCES._text(name)) for name in read()}
    assert {name: found for name, found in faults.items() if found} == {}


def test_bodies_are_registered_in_folders_of_kernels_that_are_searched():
    searched = {p for package in PACKAGES for p in (SOURCES.root / package).glob("kernels/**/*.py")}
    nested = {p for package in PACKAGES for p in (SOURCES.root / package).rglob("kernels/**/*.py")
              if "tests" not in p.parts} - searched
    assert nested == set()


@pytest.mark.parametrize("text", ["x = 1; from geometry.kernels.near import f", "if True: import geometry.kernels.ray",
                                  "import geometry.kernels as k", "revolved.for_shape(revolved.radius_of, 1)"])
def test_forms_that_are_not_found_are_named(text):
    assert overlooked(text)


def stray(text: str) -> list[str]:
    """What the digest leaves out of a source text though it is no docstring of its module, a class or a function."""
    docstrings = {(at.body[0].lineno, at.body[0].end_lineno) for at in ast.walk(ast.parse(text))
                  if isinstance(at, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(at) is not None}
    out = []
    for match in DOCSTRING.finditer(text):
        first = text.count("\n", 0, match.start() + match.group().index('"""')) + 1
        if (first, text.count("\n", 0, match.end()) + 1) not in docstrings:
            out.append(match.group())
    return out


def test_docstrings_alone_are_left_out_of_the_digest():
    assert {name: found for name in read() if (found := stray(SOURCES._text(name)))} == {}


def test_strings_that_are_values_stay():
    assert stray('TABLE = {"a":\n    """value""", "b": 1}\n')  # so such a form would be noticed
    kept = 'x = """value"""\n"""Of x."""\ny = f(\n    """value""")\n'
    assert without_docstrings(kept) == kept
    noted = 'def f():  # note\n    r"""A "word".\n\n    """\n    return 1\n'
    assert without_docstrings(noted) == "def f():\n    return 1\n"
