"""Source files that a compiled kernel depends on, and one digest over them.

Machine code holds whatever was inlined into it: kernels and constants of other modules, and the bodies that modules
register for the stubs of ``geometry.kernels.revolved``. So a module depends on itself, on every project module it
imports, on every module that registers a body for one of its stubs, and on all that these depend on in turn.
Docstrings are left out: no machine code depends on them.

Files are read, never imported. Import statements are found by line and parsed one by one, since parsing whole modules
takes a third of a second in every process.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

import llvmlite
import numba
import numpy as np
from numba import config

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples", "tests",
            "benchmarks")
"""Folders below the root whose modules belong to the project."""

APART = ("geometry.kernel_cache.cache", "geometry.kernel_cache.sources")
"""Modules that every package of kernels imports and no machine code depends on."""

REGISTERS = ("for_shape", "overload")
"""Functions that take a stub first and register a body for it."""

SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "USING_SVML", "DEBUGINFO_DEFAULT")
"""Settings of numba that change machine code and are not in its own key."""

LONGEST = 60
"""Lines an import statement may have."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+[.\w]+[ \t]+import\b|import[ \t]+\w)", re.M)
_COMPILES = re.compile(r"^[ \t]*@(?:numba\.)?njit\b|^\w+ = njit\(", re.M)
_DOCSTRING = re.compile(r'(?:\A|(?<=:)[ \t]*(?:#[^\n]*)?\n)\s*[rR]?"""(?:[^"\\]|\\.|"(?!""))*"""', re.S)
_REGISTERS = re.compile(rf"\b(?:{'|'.join(REGISTERS)})\(")


def without_docstrings(source: str) -> str:
    """A source without the docstrings in triple double quotes of its module, classes and functions."""
    return _DOCSTRING.sub("", source)


def toolchain() -> str:
    """Versions and settings of the compiler; with others the same source gives other machine code."""
    settings = [f"{name}={getattr(config, name, None)}" for name in SETTINGS]
    return " ".join([numba.__version__, llvmlite.__version__, np.__version__, *settings])


def import_statements(source: str) -> Iterator[ast.Import | ast.ImportFrom]:
    """Every import statement of a module, at any place; a line of prose that reads like one may be among them."""
    for match in _IMPORT.finditer(source):
        lines = source[match.start():].split("\n", LONGEST)[:LONGEST]
        for count, line in enumerate(lines, start=1):
            try:
                statement = ast.parse("\n".join(lines[:count]).strip()).body[0]
            except SyntaxError:  # prose, or it goes on in the next line
                if "(" in lines[0] or line.endswith("\\"):
                    continue
                break
            if isinstance(statement, ast.Import | ast.ImportFrom):
                yield statement
            break


class Sources:
    """The source files of the project below ``root``; each is read once."""

    def __init__(self, root: Path = ROOT) -> None:
        self.root = root
        self._texts: dict[str, str] = {}
        self._imports: dict[str, dict[str, str]] = {}
        self._registering: dict[str, set[str]] | None = None
        self._digests: dict[str, str] = {}
        self._lines: dict[str, list[tuple[int, int]]] = {}

    def name_of(self, path: Path) -> str | None:
        """Dotted name of a project module by its file; None for any other file."""
        try:
            parts = path.resolve().relative_to(self.root.resolve()).with_suffix("").parts
        except ValueError:
            return None
        if len(parts) < 2 or parts[0] not in PACKAGES or path.suffix != ".py":
            return None
        return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)

    def imported(self, name: str) -> dict[str, str]:
        """Project modules that a module imports, by the names it uses for them and for what it takes from them.

        Raises
        ------
        ModuleNotFoundError
            A module of the project is imported that has no file.
        """
        if name not in self._imports:
            self._imports[name] = dict(self._resolved(name))
        return self._imports[name]

    def dependencies(self, name: str) -> set[str]:
        """Every module that the machine code of ``name`` can depend on, itself among them.

        Raises
        ------
        ModuleNotFoundError
            A module of the project is imported that has no file.
        """
        found, ahead = {name}, [name]
        while ahead:
            at = ahead.pop()
            new = ({*self.imported(at).values()} | self._registering_for(at)) - found - {*APART}
            found |= new
            ahead += new
        return found

    def digest(self, name: str) -> str:
        """First 16 hex digits of a SHA-256 over the toolchain and over names and code of all dependencies.

        Raises
        ------
        ModuleNotFoundError
            A module of the project is imported that has no file.
        """
        if name not in self._digests:
            digest = hashlib.sha256(toolchain().encode())
            for other in sorted(self.dependencies(name)):
                content = without_docstrings(self._text(other)).encode()
                digest.update(f"\n{other} {len(content)}\n".encode())
                digest.update(content)
            self._digests[name] = digest.hexdigest()[:16]
        return self._digests[name]

    def line_of_code(self, name: str, line: int) -> int:
        """Place of a line of a module among those that the digest takes in; docstrings do not move it.

        Raises
        ------
        ModuleNotFoundError
            The module has no file.
        """
        if name not in self._lines:
            text = self._text(name)
            self._lines[name] = [(text.count("\n", 0, m.end()) + 1, m.group().count("\n"))
                                 for m in _DOCSTRING.finditer(text)]
        return line - sum(lines for last, lines in self._lines[name] if last < line)

    def compiled(self) -> list[str]:
        """Every module that holds compiled functions, by name."""
        paths = (p for package in PACKAGES for p in (self.root / package).rglob("*.py"))
        names = sorted(name for name in map(self.name_of, paths) if name is not None)
        return [n for n in names if n not in APART and _COMPILES.search(self._text(n))]

    def _file(self, name: str) -> Path | None:
        module = self.root.joinpath(*name.split("."))
        return next((p for p in (module.with_suffix(".py"), module / "__init__.py") if p.is_file()), None)

    def _text(self, name: str) -> str:
        if name not in self._texts:
            path = self._file(name)
            if path is None:
                raise ModuleNotFoundError(f"kernels depend on {name}, which has no file below the project's root",
                                          name=name)
            self._texts[name] = path.read_bytes().decode("utf-8")
        return self._texts[name]

    def _resolved(self, name: str) -> Iterator[tuple[str, str]]:
        for statement in import_statements(self._text(name)):
            if isinstance(statement, ast.Import):
                for alias in statement.names:
                    if alias.name.split(".")[0] in PACKAGES:
                        yield alias.asname or alias.name, self._found(alias.name, name)
                continue
            source = self._source(statement, name)
            if source.split(".")[0] not in PACKAGES:
                continue
            for alias in statement.names:
                inner = f"{source}.{alias.name}"
                yield alias.asname or alias.name, inner if self._file(inner) else self._found(source, name)

    def _source(self, statement: ast.ImportFrom, name: str) -> str:
        """The module or package named after ``from``, in full."""
        if not statement.level:
            return statement.module or ""
        path = self._file(name)
        parts = name.split(".")
        up = statement.level - (path is not None and path.name == "__init__.py")
        return ".".join([*parts[:len(parts) - up], *filter(None, [statement.module])])

    def _found(self, target: str, importer: str) -> str:
        if self._file(target) is None:
            raise ModuleNotFoundError(f"{importer} imports {target}, which has no file below the project's root",
                                      name=target)
        return target

    def _registering_for(self, name: str) -> set[str]:
        """Modules that register a body for a stub of this one."""
        if self._registering is None:
            self._registering = {}
            for package in PACKAGES:
                for path in sorted((self.root / package).glob("kernels/**/*.py")):
                    other = self.name_of(path)
                    if other is not None and other not in APART and _REGISTERS.search(self._text(other)):
                        for target in self._targets(other):
                            self._registering.setdefault(target, set()).add(other)
        return self._registering.get(name, set())

    def _targets(self, name: str) -> Iterator[str]:
        """Modules whose stubs get a body here."""
        known = self.imported(name)
        for node in ast.walk(ast.parse(self._text(name))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or not node.args:
                continue
            if node.func.id in REGISTERS:
                stub = ast.unparse(node.args[0])
                used = stub.rpartition(".")[0] if isinstance(node.args[0], ast.Attribute) else stub
                if used in known:
                    yield known[used]
