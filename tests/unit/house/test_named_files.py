"""Every file and folder of the project that a page, a docstring, a comment or the page's source names exists."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.source_tree import PACKAGES, ROOT

TOPS = (*PACKAGES, "tests", "benchmarks", "docs", "web")
ENDINGS = "py|md|ts|mjs|html|yaml|toml|bib|json|sh|lock"
NAMED = re.compile(rf"(?<![\w/.<*{{-])((?:\.\./)*(?:[\w-]+/)+[\w.-]+\.(?:{ENDINGS}))(?![\w/])")
FOLDER = re.compile(rf"(?<![\w/.<*{{:~$-])((?:{'|'.join(TOPS)})/(?:[\w.-]+/)*)(?![\w/.<*{{$-])")
"""A folder that begins with one of the top level and ends in a slash."""
BARE = re.compile(r"`{1,2}([a-z_0-9]+\.py)\b")
MADE = re.compile(r"^(?:out|data|build|dist|tmp|\.venv|service/page|web/node_modules)/|(?:^|/)(?:NAME|[A-Z]+)\.|://")
"""What a run makes, and names that stand for many."""
NOT_OURS = ("share/doc", "shared/", "../shared/")


def texts() -> Iterator[tuple[Path, str]]:
    """Pages whole; of Python files docstrings and comments; of the page's source its comments."""
    pages = [ROOT / n for n in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md")]
    for page in [*pages, *sorted((ROOT / "docs").rglob("*.md"))]:
        yield page, page.read_text(encoding="utf-8")
    for package in (*PACKAGES, "tests", "benchmarks"):
        for path in sorted((ROOT / package).rglob("*.py")):
            with tokenize.open(path) as file:
                source = file.read()
            tokens = tokenize.generate_tokens(io.StringIO(source).readline)
            words = [t.string for t in tokens if t.type == tokenize.COMMENT
                     or t.type == tokenize.STRING and t.string.lstrip("rbfRBF")[:3] == '"""']
            yield path, "\n".join(words)
    for path in sorted((ROOT / "web" / "src").rglob("*.ts")):
        if path.name != "wire.ts":
            lines = path.read_text(encoding="utf-8").splitlines()
            yield path, "\n".join(s for s in lines if s.lstrip().startswith(("//", "*", "/*")))


def exists(name: str, beside: Path) -> bool:
    """Whether a name is a file from the root, from the folder of the text, or from a package."""
    return any((folder / name).exists() for folder in (ROOT, beside.parent, ROOT / "web", ROOT / "docs"))


ALL = list(texts())
FILES = {p.name for folder in (*PACKAGES, "tests", "benchmarks", ".ci", "docs") for p in (ROOT / folder).rglob("*.py")}


@pytest.mark.parametrize(("path", "text"), ALL, ids=[str(p.relative_to(ROOT)) for p, _ in ALL])
def test_named_files_exist(path: Path, text: str) -> None:
    gone = [n for n in NAMED.findall(text) if not MADE.search(n) and not n.startswith(NOT_OURS)
            and not exists(n, path)]
    gone += [n for n in BARE.findall(text) if n not in FILES]
    gone += [n for n in FOLDER.findall(text) if not MADE.search(n) and not exists(n, path)]
    assert not gone, f"{path.relative_to(ROOT)} names files that are not there: {sorted(set(gone))}"


def test_the_rule_notices_a_file_that_is_gone() -> None:
    text = "see `geometry/no_such.py: f` and zones/model.py."
    assert NAMED.findall(text) == ["geometry/no_such.py", "zones/model.py"]
    assert not exists("geometry/no_such.py", ROOT / "README.md") and exists("zones/model.py", ROOT / "README.md")
    text = "| a route | `service/routes/` | in `verify/gcode/dialects/`, tests/golden/; geometry/kernel_cache/cache.py"
    assert FOLDER.findall(text) == ["service/routes/", "verify/gcode/dialects/", "tests/golden/"]
    assert not exists("service/routes/", ROOT / "README.md") and exists("verify/gcode/", ROOT / "README.md")
