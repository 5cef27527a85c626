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
    """What the rules find missing in the last function of a source, or the last method of its last class."""
    tree = ast.parse(source)
    module = docstrings.module_of(tree)
    node, inside = tree.body[-1], None
    if isinstance(node, ast.ClassDef):
        node, inside = node.body[-1], node
    assert isinstance(node, ast.FunctionDef)
    around = [ast.get_docstring(inside) or ""] if inside else []
    return docstrings.judged(node, [*around, module.text], "x", docstrings.Scope(module, inside)).missing


F64 = "F64 = NDArray[np.float64]\n"
HEAD = f"{F64}def f(a: F64) -> None:\n    '''"


@pytest.mark.parametrize(("text", "missing"), [
    ("Do.", ("no word of a",)),
    ("a : (n, 3) float64, mm", ("no frame of a",)),
    ("a : (n, 3) float64, mm, setup frame", ()),
    ("a : (n, 3) float64, rows of the setup frame", ("no unit of a",)),
    ("a : (n, 3) int64, index", ("no dtype float64 of a",)),
    ("a : (n, 2) float64, 1/mm, least and greatest curvature", ()),
    ("a : (n,) float64, mm", ()),
    ("a : float64, mm", ("no shape of a",)),
    ("a : float64, dimensionless (see above, mm)", ("no shape of a",)),
    ("a : (n,) float64\n\n    The count is that of the index, bool or not.", ("no unit of a",)),
    ("Moves a, (n,) float64, mm.", ()),
    ("Moves a. Another, (n,) float64, mm, stays.", ("no shape of a", "no dtype float64 of a", "no unit of a")),
])
def test_an_array_needs_shape_dtype_unit_and_frame_of_its_own(text, missing):
    assert judge(f"{HEAD}{text}'''") == missing


def test_no_other_array_and_no_module_speaks_for_an_array():
    """A checker that cannot fail is none."""
    three = "def f(a: F64, b: F64, c: F64) -> F64:\n    '''"
    assert len(judge(f"'''float64, mm, setup frame'''\n{F64}{three}Moves a, b and c (see above, mm).'''")) == 12
    missing = judge(f"{F64}{three}Moves a, (n,) float64, mm, b, (n,), and c.'''")
    assert {m.rpartition(" ")[2] for m in missing} == {"b", "c", "returned"}
    entry = "'''Notation.\n\na : (n,) float64, mm\n'''\n"
    assert judge(f"{entry}{HEAD}Do.'''") == ()  # a notation block names the very array


def test_what_is_returned_needs_its_own_words():
    head = f"{F64}INT = NDArray[np.int64]\ndef f(a: F64) -> tuple[F64, INT]:\n    '''a : (n,) float64, mm\n\n    "
    assert judge(f"{head}Do.'''")[0] == "no shape of what is returned"
    assert judge(f"{head}Returns (n,) float64, mm.'''") == ("no dtype int64 of what is returned",
                                                       "fewer shapes than 2 arrays of what is returned")
    assert judge(f"{head}Returns (n,) float64, mm, and (n,) int64, index.'''") == ()
    assert judge(f"{head}Returns\n    -------\n    b : (n,) float64, mm\n    c : (n,) int64, index\n    '''") == ()


def test_names_for_arrays_are_followed():
    assert judge("Bool = NDArray[np.bool_]\ndef f(a: Bool | None) -> None:\n    '''Do.'''") == ("no word of a",)
    imported = "from verify.kernels.tables import Bool\ndef f(a: Bool) -> None:\n    '''Do.'''"
    assert judge(imported) == ("no word of a",)
    assert judge("def f(a: 'dict[str, np.ndarray]') -> None:\n    '''Do.'''") == ("no word of a",)


RAISES = "Do.\n\n    Raises\n    ------\n    InputError\n        Always.\n    "
ERROR = "class InputError(Exception):\n    '''Wrong.'''\n\ndef _refused(x) -> InputError: ...\n\n"


@pytest.mark.parametrize("body", [
    "raise InputError('x')", "raise InputError", "error = InputError('x')\n    raise error", "raise _refused(1)",
    "try:\n        g()\n    except InputError as error:\n        raise error",
    "raise (InputError(1) if x else InputError(2))",
])
def test_every_form_of_raise_needs_its_class(body):
    assert judge(f"{ERROR}def f(x):\n    '''Do.'''\n    {body}") == ("no Raises for InputError",)
    assert judge(f"{ERROR}def f(x):\n    '''{RAISES}'''\n    {body}") == ()
    assert judge(f"{ERROR}def f(x):\n    '''Do. Raises InputError always.'''\n    {body}") == ()


def test_errors_of_private_functions_count_unless_they_are_caught():
    source = ("from geometry.errors import InputError\ndef _g():\n    raise InputError('x')\n"
              "class A:\n    def _h(self):\n        _g()\n    def f(self):\n        '''Do.'''\n        {}")
    assert judge(source.format("self._h()")) == ("no Raises for InputError",)
    assert judge(source.format("_g()")) == ("no Raises for InputError",)
    caught = "try:\n            _g()\n        except {}:\n            pass"
    assert judge(source.format(caught.format("CamError"))) == ()  # InputError is one
    assert judge(source.format(caught.format("GeometryError"))) == ("no Raises for InputError",)


def test_a_raise_that_nobody_can_follow_needs_some_class():
    assert judge("def f(x):\n    '''Do.'''\n    raise x.made()") == ("no Raises for ?",)
    assert judge("def f(x):\n    '''Do. Raises CamError.'''\n    raise x.made()") == ()
    assert judge("def f(x):\n    '''Do.'''\n    raise NotImplementedError") == ()


def test_the_class_speaks_of_what_builds_it():
    source = "class A:\n    '''Held.{}'''\n    def __init__(self):\n        raise ValueError('x')"
    assert judge(source.format("")) == ("no Raises for ValueError",)
    assert judge(source.format("\n\n    Raises ValueError always.\n    ")) == ()
