"""Measures the docstrings of the public functions: shape, dtype, unit, frame, errors and sources.

``python .ci/docstrings.py`` prints the figures and exits with 1 where a rule is broken; ``--list`` names every place,
folders or files restrict it to those. The rules are in docs/style.md.

- A function or method that takes or returns arrays says of each one its shape such as (n, 3), its dtype, its unit
  (``dimensionless``, ``unit`` of vectors of length one, ``index``, ``bool`` or ``count`` where there is none) and, for
  points or directions, its frame. An array has an entry ``name : (n, 3) float64, mm, setup frame`` of its own or shared
  with others, or the same in running text behind its name. What is returned stands behind ``Returns``, or in the text
  without such entries. An entry of that name in the docstring of the class or module serves too; nothing else of them
  does. The dtype is that of the annotation; names such as F64 are followed to where they are defined.
- A function that raises has a Raises section with each class on a line. What counts: ``raise`` with a class, a call of
  it, a name bound to one, or a function whose annotation says it; and errors of the project that private functions of
  the same module raise which it calls, unless it catches them. A stub that only raises NotImplementedError needs none.
  What builds a class (``__init__``, ``__post_init__``) is described in the docstring of the class.
- A function that implements a formula names its source by a key of docs/bibliography.bib, such as [Lee2003].
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples")
LEAST_SOURCES = 60

Function = ast.FunctionDef | ast.AsyncFunctionDef

GENERIC = ("NDArray", "ndarray", "ArrayLike")
DTYPES = ("float64", "float32", "intp", "int64", "int32", "int16", "int8", "uint8", "uint16", "uint32", "uint64",
          "bool", "complex128", "object")
DTYPE = re.compile(rf"\b({'|'.join(DTYPES)}|any dtype and unit)\b")
UNIT = re.compile(r"(?<!['’])\b(mm|µm|rad|deg|degrees|s|min|ms|px|pixels?|N|GPa|rpm|dimensionless|unit(?! square)|"
                  r"index|bool|count|bytes|object)\b|mm[²³]|1/mm|1/min|mm/min|°|%|any dtype and unit")
SURE = re.compile(r"\b(mm|rad|deg|px|dimensionless|unit(?! square))\b|mm[²³]|1/mm|1/min|mm/min|°")
NOT_PLACES = re.compile(r"1/mm|1/min|mm/min|mm[²³]|rad|deg|s|min|count|index|N")
_TERM = r"(?:(?:\d+ ?)?[A-Za-z]\w{0,9}|\d+)"
_TOKEN = rf"(?:{_TERM}(?:\s?[-+*/]\s?{_TERM})*|\.\.\.)"
SHAPE = re.compile(rf"\(\s*(?:{_TOKEN}\s*,\s*)+(?:{_TOKEN}\s*)?\)")
NO_LENGTH = re.compile(rf"\b(mm|rad|deg|dimensionless|index|{'|'.join(DTYPES)})\b")
PLACES = re.compile(r",\s*[23]\s*\)$|^\(\s*[23]\s*,\s*\)$")
FRAME = re.compile(r"\b(frames?|in plan|coordinates|plane|parameters?|pixels?|unit square|colou?rs?|barycentric)\b",
                   re.IGNORECASE)
SEVERAL = re.compile(r"\b(two|three|four|five|six|both|each|pairs?|of these|lists?|dict)\b", re.IGNORECASE)
NEAR = 45  # letters behind a dtype within which any unit counts; farther away only one that is no common word
MAY_RAISE = re.compile(r"\braise\b|(?<!def )\b_[A-Za-z]\w*\(")
BUILDS = ("__init__", "__post_init__", "__new__")
ENTRY = re.compile(r"^( *)[A-Za-z_*][\w.]*(?:(?:, *| and )[A-Za-z_][\w.]*)* *: ", re.M)
HEADER = re.compile(r"^[ \t]*([A-Z][a-z]+)[ \t]*\n[ \t]*-{3,}[ \t]*$", re.M)
KEY = re.compile(r"\[[A-Z][A-Za-z]*\d{4}[a-z]?(?:,[^\]]*)?\]|\[ISO\d+(?:-\d+)?(?:,[^\]]*)?\]")


@dataclass(frozen=True)
class Place:
    """A public function: file, line and name, what applies to it and what is missing."""

    where: str
    arrays: int
    raises: bool
    missing: tuple[str, ...]
    source: bool


# ---------------------------------------------------------------------------------------------------------- the project

@dataclass
class Module:
    """What the rules need of one module: arrays by name, functions, classes and where its names come from."""

    tree: ast.Module
    text: str
    lines: list[str] = field(default_factory=list)
    imports: dict[str, tuple[str, str]] = field(default_factory=dict)
    arrays: dict[str, str] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)
    classes: dict[str, ast.ClassDef] = field(default_factory=dict)


def module_of(tree: ast.Module) -> Module:
    """The names of a module."""
    found = Module(tree, ast.get_docstring(tree) or "")
    ahead = list(tree.body)
    for node in ahead:
        ahead += node.body if isinstance(node, ast.If) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            found.imports |= {a.asname or a.name: (node.module, a.name) for a in node.names}
        elif isinstance(node, Function):
            found.functions[node.name] = node
        elif isinstance(node, ast.ClassDef):
            found.classes[node.name] = node
        elif isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            if isinstance(node.value, ast.Subscript) and ast.unparse(node.value.value) in (*GENERIC, "np.ndarray"):
                found.arrays[node.targets[0].id] = dtype_of(node.value)
    return found


@cache
def module_in(path: Path) -> Module:
    """The module of a file."""
    source = path.read_text(encoding="utf-8")
    found = module_of(ast.parse(source))
    found.lines = source.split("\n")
    return found


def module_named(name: str) -> Module | None:
    """A module of the project by its dotted name."""
    base = ROOT.joinpath(*name.split("."))
    path = next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)
    return module_in(path) if path else None


def project() -> list[Module]:
    """Every module of the product."""
    return [module_in(path) for path in chosen([])]


@cache
def methods() -> dict[str, list[Function]]:
    """Methods of the project by name."""
    found: dict[str, list[Function]] = {}
    for module in project():
        for node in module.classes.values():
            for inner in node.body:
                if isinstance(inner, Function):
                    found.setdefault(inner.name, []).append(inner)
    return found


def defined(name: str, module: Module, kind: str) -> tuple[object, Module] | None:
    """Where a name is defined: as an array, function or class of the module or of one that it imports it from."""
    at: Module | None = module
    for _ in range(6):
        if at is None:
            return None
        table = getattr(at, kind)
        if name in table:
            return table[name], at
        if name not in at.imports:
            return None
        source, name = at.imports[name]
        at = module_named(source)
    return None


def dtype_of(node: ast.expr) -> str:
    """The dtype in ``NDArray[np.float64]``; "" for any."""
    found = DTYPE.search(ast.unparse(node).replace("bool_", "bool"))
    return found.group() if found else ""


def arrays_in(node: ast.expr | None, module: Module) -> list[str]:
    """Dtypes of the arrays in an annotation, "" where it leaves the dtype open."""
    if node is None:
        return []
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return arrays_in(ast.parse(node.value, mode="eval").body, module)
    if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
        outer = ast.unparse(node.value if isinstance(node, ast.Subscript) else node)
        if outer.rpartition(".")[2] in GENERIC:
            return [dtype_of(node)]
        known = defined(outer, module, "arrays")
        if known is not None:
            return [str(known[0])]
    return [d for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr) for d in arrays_in(child, module)]


@dataclass(frozen=True)
class Scope:
    """The module and class in which a function's names are looked up."""

    module: Module
    inside: ast.ClassDef | None = None

    def function(self, call: ast.Call) -> Function | None:
        """The function or method of the project that a call names; None where the text does not show it."""
        function = call.func
        if isinstance(function, ast.Name):
            known = defined(function.id, self.module, "functions")
            return known[0] if known is not None and isinstance(known[0], Function) else None
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            if function.value.id in ("self", "cls") and self.inside is not None:
                return next((n for n in self.inside.body if isinstance(n, Function) and n.name == function.attr), None)
            if function.value.id in self.module.classes:
                body = self.module.classes[function.value.id].body
                return next((n for n in body if isinstance(n, Function) and n.name == function.attr), None)
        return None

    def private(self, call: ast.Call) -> Function | None:
        """A private function of this module that a call names."""
        name = ast.unparse(call.func).rpartition(".")[2]
        if not name.startswith("_") or name.startswith("__"):
            return None
        if isinstance(call.func, ast.Name) and name not in self.module.functions:
            return None
        return self.function(call)


# ------------------------------------------------------------------------------------------------------------- the text

def sections(text: str) -> dict[str, str]:
    """The parts of a docstring by header; the part before the first has the name ""."""
    heads = list(HEADER.finditer(text))
    found = {"": text[:heads[0].start()] if heads else text}
    for head, end in zip(heads, [*(h.start() for h in heads[1:]), len(text)], strict=False):
        found[head.group(1)] = text[head.end():end]
    return found


def entries(text: str) -> list[tuple[list[str], str, int, int]]:
    """Entries ``a, b : text``: names, text with the lines that go on with it, and where it lies."""
    found = []
    text = re.sub(r";(\s+)(?=[A-Za-z_]\w*(?:, \w+)* +: )", "\n\\1", text)
    for match in ENTRY.finditer(text):
        names = re.findall(r"[A-Za-z_][\w.]*", match.group().replace(" and ", ", "))
        end = text.find("\n", match.end())
        end = len(text) if end < 0 else end
        indent = len(match.group(1).replace("\n", ""))
        while end < len(text):
            after = text.find("\n", end + 1)
            line = text[end + 1:after if after >= 0 else len(text)]
            if len(line) - len(line.lstrip()) <= indent or not line.strip() or ENTRY.match(line):
                break
            end = after if after >= 0 else len(text)
        found.append((names, text[match.end():end], match.start(), end))
    return found


def behind(name: str, others: list[str], text: str) -> Iterator[str]:
    """Running text behind each place of a name, to the next other array or the end of the paragraph."""
    joined = r"(?:`*(?:,| and|,? or)\s+`*(?:" + "|".join(map(re.escape, others)) + r")\b`*)*" if others else ""
    stop = r"\b(?:" + "|".join(map(re.escape, others)) + r")\b(?!')|" if others else ""
    for match in re.finditer(rf"\b{re.escape(name)}\b`*{joined}", text):
        rest = text[match.end():]
        end = re.search(rf"{stop}\n\s*\n|\.\s|;\s|\Z", rest)
        yield rest[:end.start() if end else len(rest)]


def sentence_at(text: str, place: int) -> str:
    """The sentence round a place of a text."""
    ends = [m.end() for m in re.finditer(r"[.;]\s|\n\s*\n", text)]
    return text[max([e for e in ends if e <= place], default=0):min([e for e in ends if e > place], default=len(text))]


def lacking(text: str, dtypes: list[str]) -> list[str]:
    """What a text about one array, or about all that is returned, lacks of shape, dtype, unit and frame."""
    shapes = [s for s in SHAPE.finditer(text) if not NO_LENGTH.search(s.group())]
    missing = [] if shapes else ["no shape"]
    named = set(DTYPE.findall(text))
    wanted = {d for d in dtypes if d}
    missing += [] if named and wanted <= named else [f"no dtype {', '.join(sorted(wanted - named))}".strip()]
    units = [UNIT.search(text, d.start(), min(d.end() + NEAR, len(text))) or SURE.search(sentence_at(text, d.start()))
             for d in DTYPE.finditer(text)]
    missing += [] if any(units) else ["no unit"]
    few = len(shapes) < len(dtypes) and not SEVERAL.search(text)
    missing += [f"fewer shapes than {len(dtypes)} arrays"] if shapes and few else []
    spatial = any(_spatial(text[s.end():]) for s in shapes if PLACES.search(s.group()))
    spatial = spatial and not (wanted and all(re.match("u?int|bool", d) for d in wanted))
    missing += ["no frame"] if spatial and not FRAME.search(text) else []
    return missing


def _spatial(text: str) -> bool:
    """Whether the array whose shape stands before a text holds places or directions, by its dtype and unit."""
    dtype, unit = DTYPE.search(text), UNIT.search(text)
    if dtype is not None and re.match("u?int|bool", dtype.group()):
        return False
    return not (unit is not None and NOT_PLACES.fullmatch(unit.group()))


def best(texts: list[list[str]]) -> list[str]:
    """The shortest list of what is missing; no word at all where there is no text."""
    return min(texts, key=len) if texts else ["no word"]


def docstring_of(node: Function, scope: Scope) -> str:
    """The docstring that speaks of a function: that of its class where it builds one."""
    return ast.get_docstring(scope.inside if scope.inside and node.name in BUILDS else node) or ""


def of_arrays(node: Function, around: list[str], scope: Scope) -> tuple[int, list[str]]:
    """How many parameters and returns are arrays, and what their texts lack."""
    text = docstring_of(node, scope)
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
    wanted = {a.arg: d for a in every if a is not None and (d := arrays_in(a.annotation, scope.module))}
    returned = arrays_in(node.returns, scope.module)
    header = HEADER.search(text)
    said = [e for e in entries(text) if header is None or header.group(1) not in ("Returns", "Yields")
            or e[2] < header.start()]
    for _, _, start, end in said:
        text = text[:start] + "\n" * (end - start) + text[end:]
    parts = sections(text)
    rest = "".join(part for head, part in parts.items() if head in ("", "Returns", "Yields"))
    blanked = rest
    missing = []
    for name, dtypes in wanted.items():
        found = [lacking(body, dtypes) for names, body, _, _ in said if name in names]
        for context in around:
            found += [lacking(body, dtypes) for names, body, _, _ in entries(context) if name in names]
        running = re.split(r"\b(?:Returns|Yields)\b", rest)[0] if not found else ""
        for body in behind(name, [w for w in wanted if w != name], running):
            if not lacking(body, dtypes):
                blanked = blanked.replace(body, "\n\n")
            found.append(lacking(body, dtypes))
        missing += [f"{m} of {name}" for m in best(found)]
    if returned:
        own = [parts[h] for h in ("Returns", "Yields") if h in parts]
        own += [blanked[m.start():] for m in re.finditer(r"\b(?:Returns|Yields|Gives)\b", blanked)]
        found = [lacking(p, returned) for p in own + re.split(r"\n\s*\n", blanked)[:1 if own else None]]
        for context in around:
            found += [lacking(body, returned) for names, body, _, _ in entries(context) if node.name in names]
        missing += [f"{m} of what is returned" for m in best(found)]
    return len(wanted) + bool(returned), missing


# ----------------------------------------------------------------------------------------------------------- the errors

@cache
def exception_bases() -> dict[str, set[str]]:
    """Every class of the project by name with the names of all classes above it."""
    direct: dict[str, set[str]] = {}
    for module in project():
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef):
                direct.setdefault(node.name, set()).update(ast.unparse(b).rpartition(".")[2] for b in node.bases)

    def above(name: str, seen: frozenset[str] = frozenset()) -> set[str]:
        return {name}.union(*(above(b, seen | {name}) for b in direct.get(name, ()) if b not in seen))

    return {name: above(name) for name in direct}


def of_project(name: str) -> bool:
    """Whether a class is an error of the project."""
    bases = exception_bases().get(name, set())
    return bool(bases & {"Exception", "CamError", "ValueError", "RuntimeError", "OSError", "TypeError", "KeyError"})


def caught(name: str, handlers: set[str]) -> bool:
    """Whether one of the handlers catches an error."""
    return bool(handlers & ({name, "Exception", "BaseException"} | exception_bases().get(name, set())))


def classes_of(node: ast.expr, scope: Scope, bound: dict[str, set[str]]) -> set[str]:
    """Classes that an expression behind ``raise`` can have; "?" where the text does not show it."""
    if isinstance(node, ast.IfExp):
        return classes_of(node.body, scope, bound) | classes_of(node.orelse, scope, bound)
    if isinstance(node, ast.Name) and node.id in bound:
        return bound[node.id]
    name = ast.unparse(node.func if isinstance(node, ast.Call) else node).rpartition(".")[2]
    if re.match(r"_?[A-Z]", name):
        return {name}
    if isinstance(node, ast.Call):
        known = scope.function(node)
        made = [known] if known is not None else methods().get(name, [])
        classes = [frozenset(re.findall(r"\b[A-Z]\w+", ast.unparse(m.returns))) - {"None"} for m in made if m.returns]
        if len(set(classes)) == 1 and classes[0]:
            return set(classes[0])
        if name == "with_traceback" and isinstance(node.func, ast.Attribute):
            return classes_of(node.func.value, scope, bound)
    return {"?"}


def raised(node: Function, scope: Scope, seen: frozenset[str] = frozenset()) -> set[str]:
    """Classes that a function raises itself or by private functions of its module, without those it catches."""
    lines = scope.module.lines
    if lines and not MAY_RAISE.search("\n".join(lines[node.lineno - 1:node.end_lineno])):
        return set()  # the same answer, sooner
    bound: dict[str, set[str]] = {}
    for inner in ast.walk(node):
        if isinstance(inner, ast.AnnAssign) and isinstance(inner.target, ast.Name):
            classes = {n for n in re.findall(r"\b[A-Z]\w+", ast.unparse(inner.annotation)) if n != "None"}
            bound.setdefault(inner.target.id, set()).update(classes)
        if isinstance(inner, ast.Assign) and isinstance(inner.value, ast.Call) and len(inner.targets) == 1:
            if isinstance(inner.targets[0], ast.Name):
                classes = classes_of(inner.value, scope, {})
                if "?" not in classes:
                    bound.setdefault(inner.targets[0].id, set()).update(classes)
    return _raised(node, scope, bound, frozenset(), seen)


def _names(handler: ast.ExceptHandler) -> set[str]:
    if handler.type is None:
        return {"BaseException"}
    types = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return {ast.unparse(t).rpartition(".")[2] for t in types}


def _raised(node: ast.AST, scope: Scope, bound: dict[str, set[str]], handlers: frozenset[str],
            seen: frozenset[str]) -> set[str]:
    found: set[str] = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(child, ast.Raise) and child.exc is not None:
            found |= {c for c in classes_of(child.exc, scope, bound) if not caught(c, set(handlers))}
        if isinstance(child, ast.Call):
            called = scope.private(child)
            if called is not None and called.name not in seen:
                inner = raised(called, scope, seen | {called.name})
                found |= {c for c in inner if of_project(c) and not caught(c, set(handlers))}
        if isinstance(child, ast.Try):
            names = frozenset(n for h in child.handlers for n in _names(h))
            for part in child.body:
                found |= _raised(ast.Module([part], []), scope, bound, handlers | names, seen)
            for handler in child.handlers:
                again = {handler.name: _names(handler)} if handler.name else {}
                found |= _raised(handler, scope, bound | again, handlers, seen)
            for part in [*child.orelse, *child.finalbody]:
                found |= _raised(ast.Module([part], []), scope, bound, handlers, seen)
        elif isinstance(child, ast.With) and any("suppress(" in ast.unparse(i.context_expr) for i in child.items):
            names = frozenset(ast.unparse(a).rpartition(".")[2] for i in child.items
                              if isinstance(i.context_expr, ast.Call) for a in i.context_expr.args)
            found |= _raised(child, scope, bound, handlers | names, seen)
        else:
            found |= _raised(child, scope, bound, handlers, seen)
    return found


# ----------------------------------------------------------------------------------------------------------- the rules

def named_errors(text: str) -> set[str]:
    """Classes that a docstring names in its Raises section or in running text behind ``Raises``."""
    lines = sections(text).get("Raises", "").splitlines()
    section = [line for line in lines if re.fullmatch(r"[\w., |]+", line.strip())]
    running = re.findall(r"\bRaises\s((?:(?!\n\s*\n)(?!\.\s).)*)", text, re.S)
    return set(re.findall(r"\b[A-Z]\w+", "\n".join([*section, *running])))


def judged(node: Function, around: list[str], where: str, scope: Scope) -> Place:
    """What the docstring of one function lacks; ``around``: docstrings of its class and module."""
    text = docstring_of(node, scope)
    arrays, missing = of_arrays(node, around, scope)
    body = node.body[1:] if ast.get_docstring(node) else node.body
    stub = len(body) == 1 and ast.unparse(body[0]).startswith("raise NotImplementedError")
    errors = set() if stub else raised(node, scope, frozenset({node.name}))
    if errors:
        named = named_errors(text)
        missing += [f"no Raises for {e}" for e in sorted(errors)
                    if not (named if e == "?" else any(e in exception_bases().get(n, {n}) for n in named))]
    return Place(where, arrays, bool(errors), tuple(missing), bool(KEY.search(text)))


def places(path: Path) -> Iterator[Place]:
    """Every public function and method of a file, and what builds its classes; other dunder methods do not count."""
    module = module_in(path)
    name = path.relative_to(ROOT).as_posix()
    for node in module.tree.body:
        if isinstance(node, Function) and not node.name.startswith("_"):
            yield judged(node, [module.text], f"{name}:{node.lineno} {node.name}", Scope(module))
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            around = [ast.get_docstring(node) or "", module.text]
            for inner in node.body:
                if isinstance(inner, Function) and (not inner.name.startswith("_") or inner.name in BUILDS):
                    yield judged(inner, around, f"{name}:{inner.lineno} {node.name}.{inner.name}", Scope(module, node))


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
    print(f"public functions {len(found)}, with arrays {len(arrays)} ({sum(p.arrays for p in found)} parameters and "
          f"returns), that raise {len(errors)}, with a source {sources}")
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
