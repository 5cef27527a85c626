"""Compiled kernels never outlive a source they were compiled from, and an edit compiles only what depends on it."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from geometry.kernel_cache.cache import bases, remove_stale, sources
from geometry.kernel_cache.sources import PACKAGES, REGISTERS, Sources, import_statements
from tests import source_tree
from tests.source_tree import ROOT, imports, modules

LEAF = "from numba import njit\n\n\n@njit(cache=True)\ndef {name}(x):\n    return x + {addend}\n"
OUTER = ("from numba import njit\n\nfrom verify.kernels.inner import inner\n\n\n"
         "@njit(cache=True)\ndef outer(x):\n    return 2.0 * inner(x)\n")
RUN = """
from pathlib import Path
from verify.kernels.outer import outer
from verify.kernels.apart import apart
print(outer(1.0), apart(1.0))
for kernel in (outer, apart):
    print(sum(kernel.stats.cache_hits.values()), Path(kernel.stats.cache_path).parent)
"""
COPIED = ("geometry/kernel_cache/cache.py", "geometry/kernel_cache/sources.py", "geometry/kernels/__init__.py",
          "verify/kernels/__init__.py")


@pytest.fixture
def tree(tmp_path):
    """A project of three kernels: outer takes inner, apart takes nothing."""
    return _tree(tmp_path / "tree")


def _tree(root):
    for name in COPIED:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    (root / "verify" / "kernels" / "outer.py").write_text(OUTER)
    _edit(root, "inner", 1.0)
    _edit(root, "apart", 1.0)
    return root


def _edit(root, name, addend):
    (root / "verify" / "kernels" / f"{name}.py").write_text(LEAF.format(name=name, addend=addend))


def _run(root, home, given=None, code=RUN):
    """What the kernels of a tree give in a new process: values, then for each its cache hits and base."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    env |= {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1", "HOME": str(home)}
    env |= {"NUMBA_CACHE_DIR": str(given)} if given else {}
    run = subprocess.run([sys.executable, "-c", code], cwd=root, env=env, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()


def _hits(lines):
    return [line.split()[0] for line in lines[1:]]


# ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_edit_compiles_what_depends_on_it_and_nothing_else(tree, tmp_path):
    home = tmp_path / "home"
    first = _run(tree, home)
    assert first[0] == "4.0 2.0" and _hits(first) == ["0", "0"]
    _edit(tree, "inner", 5.0)  # outer.py itself is as it was
    edited = _run(tree, home)
    assert edited[0] == "12.0 2.0" and _hits(edited) == ["0", "1"]
    _edit(tree, "inner", 1.0)
    _edit(tree, "apart", 7.0)
    last = _run(tree, home)
    assert last[0] == "4.0 8.0" and _hits(last) == ["1", "0"]  # what it was before is still there


def test_an_edit_of_a_docstring_compiles_nothing(tree, tmp_path):
    inner = tree / "verify" / "kernels" / "inner.py"
    code = ("from verify.kernels.inner import inner\n"
            "print(inner(1.0), inner.__doc__ is None, sum(inner.stats.cache_hits.values()))")
    plain = inner.read_text()
    bodies = plain, plain.replace("(x):", '(x):\n    """Adds."""'), plain.replace("(x):", '(x):\n    r"""Adds\n\n1."""')
    texts = [f'"""{doc}"""\n{body}' for body in bodies for doc in ("A module.", "A\n\nlonger one.\n")][:5]
    seen = []
    for text in texts:
        inner.write_text(text)
        seen += _run(tree, tmp_path, code=code)
    assert seen == ["2.0 True 0", "2.0 True 1", "2.0 False 1", "2.0 False 1", "2.0 False 1"]


def test_two_functions_of_one_name_have_files_of_their_own_whatever_is_written_on_them(tree, tmp_path):
    inner = tree / "verify" / "kernels" / "inner.py"
    one = "@njit(cache=True)\ndef inner(x):\n    {doc}\n    return x + {addend}\n"
    code = "from verify.kernels.inner import first, inner\nprint(first(1.0), inner(1.0))"
    for doc in ('"""Adds."""', '"""Adds\n    one or\n    two.\n    """'):
        inner.write_text("from numba import njit\n\n\n" + one.format(doc=doc, addend=1.0) + "first = inner\n"
                         + one.format(doc=doc, addend=2.0))
        assert _run(tree, tmp_path, code=code) == ["2.0 3.0"]


@pytest.mark.slow
def test_without_our_locator_numba_answers_with_the_machine_code_of_before(tree, tmp_path):
    (tree / "verify" / "kernels" / "__init__.py").write_text("")
    given = tmp_path / "given"
    assert _run(tree, tmp_path, given)[0] == "4.0 2.0"
    _edit(tree, "inner", 5.0)
    assert _run(tree, tmp_path, given)[0] == "4.0 2.0"


@pytest.mark.slow
def test_another_checkout_takes_the_same_machine_code(tree, tmp_path):
    home, given = tmp_path / "home", tmp_path / "given"
    first = _run(tree, home)
    assert [line.split()[1] for line in first[1:]] == [str(home / ".cache" / "zonemill" / "numba")] * 2
    other = _run(_tree(tmp_path / "elsewhere" / "tree"), home)
    assert other[0] == first[0] and _hits(other) == ["1", "1"]
    asked = _run(tree, home, given)
    assert _hits(asked) == ["0", "0"] and [line.split()[1] for line in asked[1:]] == [str(given)] * 2


@pytest.mark.slow
def test_without_a_home_the_folder_is_in_the_tree(tree, tmp_path):
    (tmp_path / "home").write_text("a file")
    lines = _run(tree, tmp_path / "home")
    assert {line.split()[1] for line in lines[1:]} == {str(tree / "geometry" / "kernels" / "__pycache__" / "numba")}


def test_a_kernel_run_as_a_script_has_a_folder_of_its_own(tree, tmp_path):
    script = tree / "verify" / "kernels" / "inner.py"
    script.write_text(f"import geometry.kernel_cache.cache\n{script.read_text()}\n"
                      "if __name__ == '__main__':\n    inner(1.0)\n    print(inner.stats.cache_path)\n")
    line, = _run(tree, tmp_path, code="import runpy; runpy.run_module('verify.kernels.inner', run_name='__main__')")
    name, _, digest = Path(line).name.rpartition("-")
    assert (name, digest) == ("verify.kernels.inner.__main__", Sources(tree).digest("verify.kernels.inner"))


def test_processes_that_compile_at_once_give_each_result_a_file(tree, tmp_path):
    code = ("from pathlib import Path; from verify.kernels.inner import inner; from numba import types\n"
            "for kind in {kinds!r}:\n    inner.compile((getattr(types, kind),))\n"
            "print(sum(inner.stats.cache_hits.values()), len([*Path(inner.stats.cache_path).glob('*.nbc')]))")
    kinds = ["float64", "float32"], ["int64", "int32"]
    with ThreadPoolExecutor(len(kinds)) as pool:
        assert all(line.startswith("0 ") for line, in pool.map(
            lambda some: _run(tree, tmp_path, code=code.format(kinds=some)), kinds))
    assert _run(tree, tmp_path, code=code.format(kinds=kinds[0] + kinds[1])) == ["4 4"]


# ----------------------------------------------------------------------------------------------------------------------


def test_an_import_without_a_file_is_an_error(tree, tmp_path):
    outer = tree / "verify" / "kernels" / "outer.py"
    for line in ("from verify.kernels.gone import inner", "import verify.kernels.gone", "from verify.gone import x"):
        outer.write_text(OUTER.replace("from verify.kernels.inner import inner", line))
        with pytest.raises(ModuleNotFoundError, match=r"verify\.kernels\.outer imports verify\.(kernels\.)?gone"):
            Sources(tree).digest("verify.kernels.outer")
    with pytest.raises(ModuleNotFoundError, match="verify.kernels.gone"):
        Sources(tree).digest("verify.kernels.gone")


@pytest.mark.parametrize("statement", [
    "from verify.kernels import inner", "import verify.kernels.inner", "import numpy, verify.kernels.inner as other",
    "from . import inner", "from .inner import inner", "from verify.kernels.inner import \\\n    inner",
    "from verify.kernels.inner import (\n    inner,  # (a kernel)\n)",
    "def later():\n    from verify.kernels.inner import inner",
])
def test_every_form_of_import_is_followed(tree, statement):
    (tree / "verify" / "kernels" / "outer.py").write_text(f'"""Prose.\n\nfrom here on\n"""\n{statement}\n')
    assert Sources(tree).dependencies("verify.kernels.outer") == {"verify.kernels.outer", "verify.kernels.inner"}


def test_what_a_package_hands_on_is_followed(tree):
    (tree / "verify" / "__init__.py").write_text("from verify.kernels.inner import inner\n")
    (tree / "verify" / "kernels" / "outer.py").write_text("from verify import inner\n")
    assert "verify.kernels.inner" in Sources(tree).dependencies("verify.kernels.outer")


def test_a_stub_depends_on_every_module_that_registers_a_body_for_it(tree):
    kernels = tree / "geometry" / "kernels"
    (kernels / "stubs.py").write_text("def for_shape(operation, kind): ...\n\n\ndef radius_of(shape): ...\n")
    (kernels / "first.py").write_text("from geometry.kernels import stubs\n"
                                      "from geometry.kernels.stubs import for_shape\n\n\n"
                                      "@for_shape(stubs.radius_of, int)\ndef _radius(shape): ...\n")
    (kernels / "second.py").write_text("from geometry.kernels.stubs import for_shape, radius_of\n\n\n"
                                       "for_shape(radius_of, float)(len)\n")
    (kernels / "third.py").write_text("from geometry.kernels.stubs import radius_of\n")
    expected = {f"geometry.kernels.{name}" for name in ("stubs", "first", "second")}
    graph = Sources(tree)
    assert graph.dependencies("geometry.kernels.stubs") == expected == graph.dependencies("geometry.kernels.first")
    assert graph.dependencies("geometry.kernels.third") == expected | {"geometry.kernels.third"}


def test_shapes_and_what_walks_them_are_one_state():
    """The loops of ``revolved`` are compiled with the bodies of these, which it does not import."""
    graph = Sources(ROOT)
    names = {f"geometry.kernels.{name}" for name in ("revolved", "drop", "outline", "push")}
    assert all(graph.dependencies(name) >= names for name in names)
    assert not graph.dependencies("geometry.kernels.bvh") & names


def test_one_byte_changes_the_digest_of_what_depends_on_it_only(tmp_path):
    for name in PACKAGES[:-2]:
        for path in (ROOT / name).glob("kernels/**/*.py"):
            (tmp_path / path.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, tmp_path / path.relative_to(ROOT))
    before = Sources(tmp_path)
    names = before.compiled()
    assert len(names) > 30
    for changed in ("geometry.kernels.bvh", "geometry.kernels.nearest", "verify.kernels.field",
                    "geometry.kernels.options"):
        path = tmp_path.joinpath(*changed.split(".")).with_suffix(".py")
        content = path.read_bytes()
        path.write_bytes(content + b"\n")
        after = Sources(tmp_path)
        assert {n for n in names if after.digest(n) != before.digest(n)} == {
            n for n in names if changed in before.dependencies(n)}
        path.write_bytes(content)
    assert {n for n in names if "geometry.kernels.nearest" in before.dependencies(n)} == {
        "geometry.kernels.nearest", "zones.kernels.nearby", "verify.kernels.surface.depth",
        "verify.kernels.surface.remains"}


def test_versions_and_settings_of_the_compiler_are_in_the_digest(tree, monkeypatch):
    seen = {Sources(tree).digest("verify.kernels.outer")}
    for name in ("numba.__version__", "llvmlite.__version__", "numpy.__version__", "numba.config.BOUNDSCHECK"):
        with monkeypatch.context() as patched:
            patched.setattr(name, "0.0.0")
            seen.add(Sources(tree).digest("verify.kernels.outer"))
    assert len(seen) == 5


def test_no_import_of_the_project_is_overlooked():
    for name, tree in modules():
        text = ROOT.joinpath(*name.split(".")).with_suffix(".py").read_text(encoding="utf-8")
        read = {ast.unparse(statement) for statement in import_statements(text)}
        standing = {ast.unparse(n) for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom)}
        assert standing <= read, name


def test_every_compiled_function_of_the_product_is_behind_the_locator():
    assert set(source_tree.PACKAGES) <= set(PACKAGES)
    trees = dict(modules())
    packages = {f"{n.split('.kernels.')[0]}.kernels.__init__" for n in trees if ".kernels." in n}
    beside = {name for name, tree in trees.items() if ".kernels." not in name
              and any(target.split(".")[:2] in (["numba", "njit"], ["numba", "jit"]) for target, _ in imports(tree))}
    assert len(packages) == 4
    for name in packages | beside:
        first = [n for n in trees[name].body if isinstance(n, ast.Import)]
        assert "geometry.kernel_cache.cache" in {a.name for n in first for a in n.names}, name
    for name, tree in trees.items():
        calls = {n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
        assert ".kernels." in name or not calls & {*REGISTERS}, f"{name} registers a body where nobody looks for it"


# ----------------------------------------------------------------------------------------------------------------------


def test_bases_are_the_one_given_the_users_and_the_tree(tmp_path):
    home, tree = bases("", tmp_path)
    assert tree.is_relative_to(tmp_path) and "__pycache__" in tree.parts and not home.is_relative_to(tmp_path)
    assert bases("elsewhere", tmp_path) == [Path("elsewhere"), home, tree]


def test_folders_of_other_states_go_after_a_week_ours_never(tmp_path, monkeypatch):
    monkeypatch.setattr("geometry.kernel_cache.cache.bases", lambda given: [tmp_path / "missing", tmp_path])
    kernel = "geometry.kernels.drop"
    digest = sources().digest(kernel)
    ours, as_script = tmp_path / f"{kernel}-{digest}", tmp_path / f"{kernel}.__main__-{digest}"
    old, young, whole = tmp_path / f"{kernel}-{'b' * 16}", tmp_path / f"{kernel}-{'c' * 16}", tmp_path / ("d" * 16)
    foreign, looks_like = tmp_path / "kernels_0123", tmp_path / ("e" * 16)
    for folder in (ours, as_script, old, young, whole, foreign):
        (folder / "inside").mkdir(parents=True)
        (folder / "inside" / "file.nbc").write_bytes(b"x")
    looks_like.write_text("a file")
    past = time.time() - 8 * 86400
    for path in (ours, as_script, old, whole, foreign, looks_like):
        os.utime(path, (past, past))
    assert remove_stale() == sorted([old, whole], key=lambda p: p.name)
    assert {p.name for p in tmp_path.iterdir()} == {p.name for p in (ours, as_script, young, foreign, looks_like)}
