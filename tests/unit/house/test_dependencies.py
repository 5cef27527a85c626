"""Rules of the layout that import-linter cannot say."""

from __future__ import annotations

import ast
import re
import sys
import tomllib

import pytest

from geometry.kernel_cache.sources import APART
from tests.source_tree import PACKAGES, ROOT, imports, modules

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_kernels_import_numpy_numba_math_and_kernels_only():
    allowed = {"__future__", "typing", "numpy", "numba", "math"}
    wrong = []
    for name, tree in modules():
        if "kernels" not in name.split("."):
            continue
        for target, line in imports(tree):
            top = target.split(".")[0]
            if target in APART and name.endswith("__init__"):  # it names the folders of compiled kernels
                continue
            if top not in allowed and not (top in PACKAGES and "kernels" in target.split(".")):
                wrong.append(f"{name}:{line} imports {target}")
    assert not wrong, "\n".join(wrong)


MAX_ARGUMENTS = 12
"""Of a kernel; what belongs together travels in a named tuple."""


def test_no_kernel_has_more_arguments_than_a_reader_can_tell_apart():
    kernels = [(name, f) for name, tree in modules() for f in ast.walk(tree) if isinstance(f, ast.FunctionDef)
               and any("njit" in ast.unparse(d) for d in f.decorator_list)]
    assert len(kernels) > 200
    assert [f"{name}.{f.name}" for name, f in kernels if len(f.args.args) > MAX_ARGUMENTS] == []


def test_every_kernel_package_is_seen():
    assert {n.split(".")[0] for n, _ in modules() if "kernels" in n.split(".")} >= {"geometry", "verify"}


LOCKS = ("requirements.lock", "requirements-bench.lock", "requirements-runtime.lock")
KERNEL_WHEELS = ("cadquery-ocp", "cadquery-ocp-novtk")
# names of modules that differ from the name of their distribution
DISTRIBUTION = {"OCP": "cadquery-ocp-novtk", "PIL": "pillow", "fpdf": "fpdf2", "yaml": "pyyaml"}
# parts of a distribution's interface that another distribution installs
PART_OF = {"starlette": "fastapi", "pydantic-core": "pydantic"}
GENERATED = "zonemill_client"  # the client that examples/clients/python is run with


def locked(lock: str) -> dict[str, str]:
    """Name and version of every distribution of a lock."""
    lines = (ROOT / lock).read_text().splitlines()
    return dict(re.split(r"==| ;", line)[:2] for line in lines)


def declared(requirements: list) -> set[str]:
    """Names of the distributions a list of requirements asks for; groups that are included are left out."""
    return {re.split(r"[\[<>=! ]", r, maxsplit=1)[0].lower() for r in requirements if isinstance(r, str)}


@pytest.mark.parametrize("lock", LOCKS)
def test_the_lock_names_no_host(lock):
    lines = (ROOT / lock).read_text().splitlines()
    assert len(lines) > 50
    assert not [s for s in lines if "://" in s or s.startswith("-") or not re.match(r"^[a-z0-9._-]+(\[.+\])?==", s)]


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_holds_one_wheel_of_the_cad_kernel(lock):
    """Both install the package OCP: in one environment the later one would overwrite files of the other."""
    wanted = "cadquery-ocp-novtk" if lock == "requirements-runtime.lock" else "cadquery-ocp"
    assert [name for name in KERNEL_WHEELS if name in locked(lock)] == [wanted]


def test_the_runtime_lock_has_the_versions_of_the_development_lock():
    development, runtime = locked("requirements.lock"), locked("requirements-runtime.lock")
    assert runtime.pop("cadquery-ocp-novtk") == development["cadquery-ocp"]
    assert runtime.items() <= development.items()


def test_the_runtime_lock_holds_nothing_of_development():
    heavy = {"cadquery", "vtk", "casadi", "trame", "matplotlib", "nlopt", "ezdxf", "s3fs", "aiohttp"}
    tools = {name for group in ("dev", "test") for name in declared(PROJECT["dependency-groups"][group])} - {"psycopg"}
    assert {"pytest", "mypy", "ruff", "schemathesis"} <= tools
    assert not (heavy | tools) & set(locked("requirements-runtime.lock"))


def test_the_product_imports_what_it_declares_and_nothing_else():
    """cadquery alone stands apart: the generator of test parts imports it, inside its functions."""
    found = {target.split(".")[0] for _, tree in modules() for target, _ in imports(tree)}
    found -= {*sys.stdlib_module_names, *PACKAGES, GENERATED}
    names = {DISTRIBUTION.get(n, n.replace("_", "-")) for n in found}
    wanted = declared(PROJECT["project"]["dependencies"])
    assert names - {"cadquery"} == wanted | (names & set(PART_OF))
    assert {PART_OF[n] for n in names & set(PART_OF)} <= wanted
    assert "cadquery" in declared(PROJECT["dependency-groups"]["family"])


def test_cadquery_is_imported_by_the_generator_alone_and_only_when_it_draws():
    packages = {name for name, tree in modules() for target, _ in imports(tree) if target.split(".")[0] == "cadquery"}
    assert {name.split(".")[0] for name in packages} == {"examples"}
    at_import = [name for name, tree in modules() for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)
                 for target, _ in imports(ast.Module([node], [])) if target.split(".")[0] == "cadquery"]
    assert not at_import


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_says_that_it_is_typed(package):
    assert (ROOT / package / "py.typed").is_file()
    assert "py.typed" in PROJECT["tool"]["setuptools"]["package-data"]["*"]


def test_no_file_is_huge():
    files = [p for k in PACKAGES for p in (ROOT / k).rglob("*.py")]
    sizes = {str(p.relative_to(ROOT)): len(p.read_text().splitlines()) for p in files}
    assert not {p: n for p, n in sizes.items() if n > 600}, "a module this long hides a second concept"
