"""What becomes of each command of the documentation: it is run, held to a rule, or not run for a reason given here.

``python -m tests.doc_rules`` prints one line for each command with its way, and the numbers.
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

import typer

from service.cli import app
from service.settings import Settings
from tests.doc_pages import ASSIGNED, PAGES, Command, Simple, commands, fences, simple, spans
from tests.source_tree import ROOT


class Way(IntEnum):
    """How a command is kept true; a line of several programs has the greatest."""

    EVERYDAY = 0
    SLOW = 1
    RULE = 2
    REASON = 3


@dataclass(frozen=True)
class NotRun:
    """Commands that no test can run: pattern of the whole command, reason, and texts that stand in files of ours."""

    pattern: str
    reason: str
    evidence: dict[str, tuple[str, ...]]


NOT_RUN = (
    NotRun(r"docker compose .*", "test machines have no container engine; the file is checked against its schema",
           {"tests/contract/test_compose.py": ("vendor.compose-spec",)}),
    NotRun(r"python3 -m venv \.venv", "wants a package index afterwards; make test-runtime does the same in CI",
           {"Makefile": ("$(PYTHON) -m venv --clear $(RUNTIME)",), ".ci/run": ("make test-runtime",)}),
    NotRun(r"\.venv/bin/pip install --no-deps -r requirements-runtime\.lock",
           "wants a package index; make test-runtime does the same in CI",
           {"Makefile": ("--no-deps -r requirements-runtime.lock",)}),
    NotRun(r"\.venv/bin/pip install --no-deps -e \.", "wants a package index; make test-runtime does the same in CI",
           {"Makefile": ("$(RUNTIME)/bin/python -m pip $(PIP_OPTIONS) --no-deps -e .",)}),
    NotRun(r"apt-get install libgl1 libx11-6 libexpat1", "changes the machine; the image installs the same packages",
           {"Dockerfile": ("libexpat1 libgl1 libx11-6",)}),
    NotRun(r"dask worker ADDRESS .*", "runs until it is stopped; the tests of a cluster run it with the same options",
           {"tests/contract/test_service_cluster.py": ('"--no-nanny", "--nthreads", "1", "--memory-limit", "0"',)}),
    NotRun(r"npx vite", "wants the packages of the page; make web builds the page with the same vite",
           {"web/package.json": ('"vite"', '"build"'), ".ci/run": ("make web",)}),
    NotRun(r"pre-commit install", "pre-commit is not part of .venv; its hooks call what make check calls",
           {".pre-commit-config.yaml": (".venv/bin/ruff check", ".venv/bin/lint-imports")}),
    NotRun(r"chrt -f 20", "wants the right to set priorities; names how a figure was taken",
           {"docs/whole-jobs.md": ("real time",)}),
    NotRun(r"git clone", "there is no address to clone from in the project", {"docs/view.md": ("`git clone`",)}),
    NotRun(r"pip (check|install zonemill(\[family\])?)", "alternatives that a decision rejects; nobody is to run them",
           {"docs/adr/0013-two-locks-and-two-kernel-wheels.md": ("## Rejected",)}),
    NotRun(r"\./go/run-job part\.step out", "wants Go and its packages; make clients builds it and runs it so in CI",
           {"tests/contract/test_clients.py": ('["./run-job"]', "ZONEMILL_BASE=url, ZONEMILL_KEY=key"),
            ".ci/run": ("make clients",)}),
)

NOT_IN_CI = {
    "demo": ("run as it stands by tests/unit/house/test_doc_commands.py", {}),
    "serve": ("run as it stands by tests/unit/house/test_doc_commands.py", {}),
    "test-cov": ("the everyday tests once more, with the figures of pytest-cov",
                 {"pyproject.toml": ("[tool.coverage.run]", "pytest-cov")}),
    "limits": ("wants an idle machine; the everyday tests run the same with wider limits",
               {"tests/time_limits.py": ("ZONEMILL_LIMITS",)}),
    "soak": ("takes longer than CI waits; the same tests run once, shorter, in the slow set",
             {"tests/contract/test_service_faults.py": ("pytest.mark.soak", "pytest.mark.slow")}),
    "kernels": ("rewrites the list of kernels; the everyday tests tell when it is due",
                {"tests/unit/service/commands/test_kernel_compiling.py": ("make kernels",)}),
    "golden": ("rewrites the expected files; the everyday tests compare them",
               {"tests/golden_file.py": ("ZONEMILL_GOLDEN",)}),
    "bench": ("takes hours; each script is asked for its help", {}),
    "bench-jobs": ("plans whole jobs, for minutes each; the script is asked for its help", {}),
    "lock": ("wants uv and a package index; the locks are compared with pyproject.toml",
             {"tests/unit/house/test_dependencies.py": ("requirements-runtime.lock",)}),
    "third-party": ("rewrites THIRD_PARTY.md; a test compares it with what the script writes",
                    {"tests/unit/house/test_third_party.py": ("THIRD_PARTY.md",)}),
}
"""Targets of make that CI does not call, by the reason and texts of our files that bear it out."""

TOOLS = ("cat", "cd", "curl", "export", "jq", "openssl", "sha256sum", "sqlite3")
"""Programs that are run where a page has them."""
ABROAD = ("apt-get", "bash", "chrt", "dask", "docker", "git", "go", "kubectl", "mvn", "node", "npm", "npx", "pip",
          "pip3", "pre-commit", "pytest", "ruff", "mypy", "systemctl", "uv", "sh", *TOOLS)
"""Programs by others; one of these with an argument is a command, alone it is a name."""
QUICK = {"openapi", "serve", "keys create", "keys list", "keys revoke", "keys webhook-secret"}
"""Commands of zonemill that take seconds."""
OPTIONS_BY_OTHERS = {"--default-non-nullable": "openapi-typescript", "--insecure": "gone, and named as gone"}
VARIABLES_BY_OTHERS = {"NUMBA_NUM_THREADS": "numba", "POSTGRES_PASSWORD": "docker-compose.yml"}
SCRIPT = re.compile(r"(?:benchmarks|\.ci)/[\w./-]+\.py")


UsageError = typer.BadParameter.__bases__[0]
"""Typer brings a click of its own, whose classes it does not all name."""


class UnknownCommand(AssertionError):
    """A command of a page that nothing runs and no rule holds."""


def is_command(text: str) -> bool:
    """Whether a code span is something to run, and not the name of a thing."""
    try:
        found = [part for part in simple(text) if part.words]
    except ValueError:
        return False
    if not found or ":" in found[0].words[0] and "://" not in text:
        return False
    first, count = found[0].program, len(found[0].words)
    if first in ("zonemill", "make", *(p for p in ABROAD), "python", "python3"):
        return count > 1
    if first.startswith(("./", "../")) and not first.endswith((".md", ".py")) and "*" not in first:
        return count > 1
    option = any(re.match(r"--?[A-Za-z]", word) for word in found[0].words[1:])
    return option and re.fullmatch(r"[\w./-]+", first) is not None and not first.startswith("-")


@cache
def all_commands() -> tuple[Command, ...]:
    """Every command of every page, in the order of the pages."""
    out: list[Command] = []
    for page in PAGES:
        found = [c for fence in fences(page) for c in commands(fence)] + [c for c in spans(page) if is_command(c.text)]
        out += sorted(found, key=lambda c: c.line)
    return tuple(out)


def reason_of(part: Simple) -> NotRun | None:
    """The row of the table that a part belongs to."""
    return next((row for row in NOT_RUN if re.fullmatch(row.pattern, " ".join(part.words))), None)


def way_of(command: Command) -> Way:
    """The way of a command line.

    Raises
    ------
    UnknownCommand
        A program of it is run by nothing and held by no rule.
    """
    return max((_way(part, command) for part in simple(command.text)), default=Way.RULE)


def _way(part: Simple, command: Command) -> Way:
    if not part.words:
        return Way.RULE if command.inline else Way.EVERYDAY
    if reason_of(part):
        return Way.REASON
    name, words = part.program, part.words
    if not command.inline and words[0] in ("zonemill", "python", "pip", "openapi-python-client"):
        raise UnknownCommand(f"{command}: a command in a fence works as it stands; write .venv/bin/{words[0]}")
    if name == "zonemill":
        verb, complete = parsed(part)
        if command.unit:
            return Way.RULE  # no test machine has the user and the folder of a unit; the page runs the same beside it
        return Way.RULE if not complete else Way.EVERYDAY if verb in QUICK or verb.startswith("--") else Way.SLOW
    if name == "make":
        return Way.SLOW if words[1:] in (["demo"], ["serve"]) and not command.inline else Way.RULE
    if name == "python" and words[1] == "-c":
        return Way.EVERYDAY
    if name == "openapi-python-client" or name == "python" and re.fullmatch(r"\w+\.py", words[1]):
        return Way.SLOW  # tests/contract/test_openapi.py generates and uses this client every day
    if script_of(part) or words[1:3] == ["-m", "pytest"]:
        return Way.RULE
    if name in TOOLS or name == "export":
        return Way.EVERYDAY
    if re.fullmatch(r"\./[\w-]+\.sh", words[0]):
        return Way.EVERYDAY
    if command.inline and fragment_of_zonemill(words):
        return Way.RULE
    raise UnknownCommand(f"{command}: nothing runs {words[0]}; add a rule or a reason to tests/doc_rules.py")


@cache
def zonemill() -> Any:
    """The command line, with its commands below it."""
    return typer.main.get_command(app)


def fragment_of_zonemill(words: list[str]) -> bool:
    """Whether the words are a command of zonemill without its name, such as ``plan --mesh-step``."""
    return words[0] in zonemill().commands


def parsed(part: Simple) -> tuple[str, bool]:
    """Command of zonemill that a part names, and whether it has all it needs to run.

    Raises
    ------
    UnknownCommand
        There is no such command, option or value.
    """
    command = zonemill()
    words, verb = part.words[1:], []
    while hasattr(command, "commands") and words and not words[0].startswith("-"):
        if words[0] not in command.commands:
            raise UnknownCommand(f"zonemill has no command {' '.join([*verb, words[0]])}")
        verb.append(words[0])
        command, words = command.commands[words[0]], words[1:]
    known = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
    wrong = [w for w in words if w.startswith("--") and w.partition("=")[0] not in known]
    if wrong:
        raise UnknownCommand(f"zonemill {' '.join(verb)} has no option {wrong[0]}")
    if hasattr(command, "commands"):
        return " ".join([*verb, *words]), bool(words)
    try:
        command.make_context("zonemill", list(words))
    except UsageError as error:
        if type(error).__name__ in ("MissingParameter", "BadOptionUsage"):
            return " ".join(verb), False
        raise UnknownCommand(f"zonemill {' '.join(part.words[1:])}: {error.format_message()}") from None
    return " ".join(verb), True


def script_of(part: Simple) -> tuple[Path, list[str]] | None:
    """The script of ours that a part runs and its words, None where it runs none.

    A script without its folder is the one of that name under benchmarks.
    """
    words = part.words[1:] if part.program in ("python", "python3") else part.words
    if words[:1] == ["-m"] and len(words) > 1:
        path = ROOT / Path(*words[1].split(".")).with_suffix(".py")
        return (path, words[2:]) if (ROOT / words[1].partition(".")[0]).is_dir() else None
    if words and SCRIPT.fullmatch(words[0]):
        return ROOT / words[0], words[1:]
    if words and re.fullmatch(r"\w+\.py", words[0]):
        named = sorted((ROOT / "benchmarks").rglob(words[0]))
        return (named[0], words[1:]) if len(named) == 1 else None
    return None


@cache
def targets() -> dict[str, list[str]]:
    """Prerequisites of every target of the Makefile, variables left out."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return {m[1]: [w for w in m[2].replace("|", " ").split() if not w.startswith("$")]
            for m in re.finditer(r"^([a-z][a-z-]*):(?!=)([^\n#]*)$", text, re.MULTILINE)}


@cache
def called_in_ci() -> set[str]:
    """Targets that CI calls, those they need, and those that are no more than such targets."""
    out = set(re.findall(r"\bmake ([a-z-]+)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))) & set(targets())
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    everyday = {name for name in targets() if re.search(
        rf"^{name}:[^\n]*\n\t\$\(BIN\)/python -m pytest -q (?:tests/\S+ ?)+\n(?!\t)", text, re.MULTILINE)}
    hooks = {"hooks"}  # tests/unit/house/test_commit_hook.py runs its script
    while True:
        more = {p for name in out for p in targets()[name] if p in targets()} | everyday | hooks
        more |= {n for n, needs in targets().items() if needs and set(needs) <= out | more and re.search(
            rf"^{n}:[^\n]*\n(?!\t)", text, re.MULTILINE)}
        if more <= out:
            return out
        out |= more


def broken_rules(command: Command) -> Iterator[str]:
    """What is wrong with a command that is not run, or of which a part can be checked without running it."""
    for part in simple(command.text):
        yield from (f"no file of ours reads {name}" for name in part.variables if not variable_is_known(name))
        if part.program == "make":
            yield from broken_make(part)
        elif part.program in ("python", "pytest") and part.words[1:3] == ["-m", "pytest"]:
            yield from (f"there is no {w}" for w in part.words[3:] if "/" in w and not (ROOT / w).exists())
        elif part.words[:2] == ["docker", "compose"]:
            yield from broken_compose(part)
        elif part.words and fragment_of_zonemill(part.words):
            parsed(Simple({}, ["zonemill", *part.words]))
        elif script := script_of(part) if part.words else None:
            yield from (f"there is no {script[0].name}" for _ in range(not script[0].is_file()))


def broken_make(part: Simple) -> Iterator[str]:
    """A target that is not there, that CI does not call and no reason is given for, or a K that chooses nothing."""
    for word in part.words[1:]:
        match = ASSIGNED.fullmatch(word)
        if match and match[1] == "K":
            soaks = [p for p in (ROOT / "tests").rglob("test_*.py") if "pytest.mark.soak" in p.read_text()]
            named = [p for p in soaks if match[2] in p.stem or re.search(rf"def test_\w*{match[2]}", p.read_text())]
            yield from () if named else ("it chooses no soak test",)
        elif match:
            known = f"$({match[1]})" in (ROOT / "Makefile").read_text()
            yield from () if known else (f"the Makefile does not read {match[1]}",)
        elif word not in targets():
            yield f"the Makefile has no target {word}"
        elif word not in called_in_ci() and word not in NOT_IN_CI:
            yield f"CI does not call make {word}; give the reason in NOT_IN_CI"


def broken_compose(part: Simple) -> Iterator[str]:
    """A service that docker-compose.yml does not have; a command inside of one that is none."""
    text = (ROOT / "docker-compose.yml").read_text(encoding="utf-8")
    for k, word in enumerate(part.words):
        name = part.words[k + 1] if word == "exec" else word.partition("=")[0] if part.words[k - 1] == "--scale" else ""
        if name and not re.search(rf"^  {name}:$", text, re.MULTILINE):
            yield f"docker-compose.yml has no service {name}"
        if word == "exec":
            inner = Command(ROOT / "docker-compose.yml", 0, shlex.join(part.words[k + 2:]), inline=True)
            way_of(inner)


@cache
def sources() -> str:
    """Text of all that reads variables of the environment, the settings of the service left out."""
    files = [ROOT / "Makefile", ROOT / "docker-compose.yml"]
    for folder in (".ci", "tests", "benchmarks", "examples/curl", "examples/clients"):
        files += [p for p in (ROOT / folder).rglob("*") if p.suffix in ("", ".py", ".sh", ".go") and p.is_file()
                  and p.stat().st_size < 200_000 and "doc_" not in p.name]
    return "\n".join(p.read_text(encoding="utf-8", errors="replace") for p in files)


def variable_is_known(name: str) -> bool:
    """Whether something of ours reads a variable of the environment, or it is of a program by others."""
    if name.islower():
        return True  # of the shell of the page itself
    setting = name.removeprefix("ZONEMILL_").lower()
    return setting in Settings.model_fields or name in VARIABLES_BY_OTHERS or re.search(rf"\b{name}\b",
                                                                                        sources()) is not None


def variables(page: Path) -> list[Command]:
    """Code spans that are the assignment of a variable of the environment and no more."""
    return [s for s in spans(page) if re.fullmatch(r"[A-Z][A-Z0-9_]+=[^=]\S*|[A-Z][A-Z0-9_]{3,}=", s.text)]


def lone_options(page: Path) -> list[Command]:
    """Code spans that begin with an option."""
    return [s for s in spans(page) if re.match(r"--[a-z]", s.text)]


@cache
def options_of_zonemill() -> frozenset[str]:
    """Every option of every command of zonemill."""
    todo = [zonemill()]
    out = {"--help"}
    while todo:
        command = todo.pop()
        out |= {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
        todo += getattr(command, "commands", {}).values()
    return frozenset(out)


@cache
def scripts(page: Path) -> tuple[Path, ...]:
    """Every script of benchmarks and .ci that a page names or runs."""
    texts = [c.text for c in spans(page)] + [c.text for fence in fences(page) for c in commands(fence)]
    out = set()
    for text in texts:
        try:
            parts = list(simple(text))
        except ValueError:
            continue
        out |= {found[0] for part in parts if part.words and (found := script_of(part)) and found[0].is_file()}
    return tuple(sorted(p for p in out if p.relative_to(ROOT).parts[0] in ("benchmarks", ".ci")))


def main() -> None:
    """Print every command with its way, and the numbers."""
    ways = Counter[str]()
    for command in all_commands():
        way = way_of(command)
        ways[way.name.lower()] += 1
        print(f"{way.name.lower():9} {command}")
    print(f"{len(PAGES)} pages, {len({c.page for c in all_commands()})} with commands, {len(all_commands())} commands: "
          + ", ".join(f"{count} {name}" for name, count in sorted(ways.items())))


if __name__ == "__main__":
    main()
