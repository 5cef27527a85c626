"""Measures the docstrings of the public functions: shape, dtype, unit, frame, errors and sources.

``python .ci/docstrings.py`` prints the figures and exits with 1 where a rule is broken; ``--list`` names every place,
folders or files restrict it to those. The rules are in docs/style.md.

- A function or method that takes or returns arrays names each array parameter and gives a shape such as (n, 3), a
  dtype, a unit (``dimensionless``, ``index``, ``bool`` or ``count`` where there is none) and, for points or
  directions, a frame. What the docstring of its class or module says of unit, dtype and frame counts too.
- A function that raises has a Raises section that names each class.
- A function that implements a formula names its source by a key of docs/bibliography.bib, such as [Lee2003].
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples")
LEAST_SOURCES = 60

ARRAY = re.compile(r"\b(NDArray|ndarray|ArrayLike|F64|F32|I32|I64|U8|BOOL|Array)\b")
SHAPE = re.compile(r"\(\s*[\w*+/\-. |]+\s*,(\s*[\w*+/\-. |]+\s*,?)*\s*\)")
DTYPE = re.compile(r"\b(float64|float32|int64|int32|int16|int8|uint8|uint16|uint32|uint64|bool|complex128)\b")
UNIT = re.compile(r"\b(mm|rad|deg|s|min|ms|px|N|GPa|rpm|dimensionless|index|bool|count|bytes)\b"
                  r"|mm[²³]|1/mm|1/min|mm/min|°")
SPATIAL = re.compile(r"\([^()]*,\s*[23]\s*\)")
FRAME = re.compile(r"\b(frame|frames|coordinates|plane|parameters?|pixels?|unit square)\b", re.IGNORECASE)
KEY = re.compile(r"\[[A-Z][A-Za-z]*\d{4}[a-z]?(?:,[^\]]*)?\]|\[ISO\d+(?:-\d+)?(?:,[^\]]*)?\]")


@dataclass(frozen=True)
class Place:
    """A public function: file, line and name, what applies to it and what is missing."""

    where: str
    arrays: bool
    raises: bool
    missing: tuple[str, ...]
    source: bool


def annotations(node: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """Names of the array parameters; the empty name stands for an array that is returned."""
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    names = [a.arg for a in every if a.annotation is not None and ARRAY.search(ast.unparse(a.annotation))]
    return names + ([""] if node.returns is not None and ARRAY.search(ast.unparse(node.returns)) else [])


def raised(node: ast.AST) -> set[str]:
    """Classes that a function raises itself, without those that functions defined inside it raise."""
    found: set[str] = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(child, ast.Raise) and isinstance(child.exc, ast.Call):
            function = child.exc.func
            name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
            found |= {name} if name[:1].isupper() else set()
        found |= raised(child)
    return found


def judged(node: ast.FunctionDef | ast.AsyncFunctionDef, around: str, where: str) -> Place:
    """What the docstring of one function lacks; ``around``: docstrings of its class and module."""
    text = ast.get_docstring(node) or ""
    arrays, errors = annotations(node), raised(node)
    missing = []
    if arrays:
        unnamed = [a for a in arrays if a and not re.search(rf"\b{a}\b", text)]
        missing += [f"no word on {', '.join(unnamed)}"] if unnamed else []
        missing += [] if SHAPE.search(text) else ["no shape"]
        missing += [] if DTYPE.search(text) or DTYPE.search(around) else ["no dtype"]
        missing += [] if UNIT.search(text) or UNIT.search(around) else ["no unit"]
        missing += ["no frame"] if SPATIAL.search(text) and not FRAME.search(f"{text}\n{around}") else []
    if errors:
        section = text.partition("Raises")[2]
        absent = sorted(e for e in errors if e not in section)
        missing += [f"no Raises for {', '.join(absent)}"] if absent else []
    return Place(where, bool(arrays), bool(errors), tuple(missing), bool(KEY.search(text)))


def places(path: Path) -> Iterator[Place]:
    """Every public function and method of a file; properties and validators count, dunder methods do not."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    module = ast.get_docstring(tree) or ""
    name = path.relative_to(ROOT).as_posix()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("_"):
            yield judged(node, module, f"{name}:{node.lineno} {node.name}")
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            around = f"{ast.get_docstring(node) or ''}\n{module}"
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef) and not inner.name.startswith("_"):
                    yield judged(inner, around, f"{name}:{inner.lineno} {node.name}.{inner.name}")


def chosen(names: list[str]) -> list[Path]:
    """The files asked for, all of the product by default; migrations are left out."""
    roots = [ROOT / n for n in names] or [ROOT / p for p in PACKAGES]
    files = [p for r in roots for p in (sorted(r.rglob("*.py")) if r.is_dir() else [r])]
    return [p for p in files if "migrations" not in p.parts and "clients" not in p.parts]


def main() -> int:
    """Command line; 0 where every rule holds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("names", nargs="*", help="folders or files")
    parser.add_argument("--list", action="store_true", help="name every place")
    given = parser.parse_args()
    found = [p for path in chosen(given.names) for p in places(path)]
    arrays, errors = [p for p in found if p.arrays], [p for p in found if p.raises]
    wrong = [p for p in found if p.missing]

    def share(of: list[Place], what: str) -> str:
        held = sum(not any(m.startswith(what) for m in p.missing) for p in of)
        return f"{held} of {len(of)}"

    sources = sum(p.source for p in found)
    print(f"public functions {len(found)}, with arrays {len(arrays)}, that raise {len(errors)}, "
          f"with a source {sources}")
    for what in ("no word", "no shape", "no dtype", "no unit", "no frame"):
        print(f"  {what.removeprefix('no '):6} {share(arrays, what)}")
    print(f"  raises {share(errors, 'no Raises')}")
    print(f"  all    {len(found) - len(wrong)} of {len(found)}")
    if given.list or 0 < len(wrong) <= 40:
        print("\n".join(f"{p.where}: {'; '.join(p.missing)}" for p in wrong))
    few = not given.names and sources < LEAST_SOURCES
    if few:
        print(f"only {sources} functions name their source, at least {LEAST_SOURCES} must")
    return 1 if wrong or few else 0


if __name__ == "__main__":
    sys.exit(main())
