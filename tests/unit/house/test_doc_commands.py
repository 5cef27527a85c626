"""Every command of every page is run as it stands, or held to a rule, or listed with the reason why no test runs it.

Pages are read by ``tests/doc_pages.py``; ``tests/doc_rules.py`` decides what becomes of a command;
``tests/doc_sessions.py`` is the reader's shell. ``python -m tests.doc_rules`` prints the list.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from examples.demo import write_demo, write_small
from service.cli import app
from tests.doc_pages import PAGES, Command, commands, fences, indented, simple, spans
from tests.doc_rules import (
    NOT_IN_CI,
    NOT_RUN,
    OPTIONS_BY_OTHERS,
    UnknownCommand,
    Way,
    all_commands,
    broken_rules,
    called_in_ci,
    is_command,
    lone_options,
    options_of_zonemill,
    reason_of,
    script_of,
    scripts,
    variable_is_known,
    variables,
    way_of,
)
from tests.doc_sessions import Session, make_checkout
from tests.source_tree import ROOT

LANGUAGES = {"sh", "console", "python", "json", "ini", "text"}
PROGRAMS = {"curl": "curl", "jq": "jq", "openssl": "openssl", "sqlite3": "sqlite3"}
"""Programs by others that commands want, by the package that brings each."""
DRAWS = "cadquery"
FAKES = ROOT / "tests" / "contract" / "fakes"


def name_of(page: Path) -> str:
    """A page as tests are named after it."""
    return page.relative_to(ROOT).as_posix()


def ways(page: Path) -> set[Way]:
    """Ways of the commands in the fences of a page."""
    return {way_of(c) for fence in fences(page) for c in commands(fence)}


SESSIONS = [p for p in PAGES if ways(p) & {Way.EVERYDAY, Way.SLOW} or any(f.language == "python" for f in fences(p))]
SLOW = [p for p in SESSIONS if Way.SLOW in ways(p)]
RUN = [(c, p.words[1:]) for c in all_commands() if way_of(c) <= Way.SLOW for p in simple(c.text)
       if p.program == "zonemill"]


def is_run_with_more(command: Command) -> bool:
    """Whether a fence runs the same command of zonemill, or running text one with more options."""
    words = next(simple(command.text)).words[1:]
    longer = (c for c, other in RUN if other[:len(words)] == words)
    return any(not c.inline or len(c.text) > len(command.text) for c in longer)


INLINE = {c.text: c for c in all_commands() if c.inline and way_of(c) <= Way.SLOW and not (
    c.text.startswith("zonemill") and is_run_with_more(c))}
"""Commands in running text that have all they need and that no other command covers, one of each."""


# Nothing is left out.

@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_fence_names_its_language_and_no_command_stands_elsewhere(page: Path) -> None:
    text = re.sub(r"^ {0,3}```.*?^ {0,3}```[^\S\n]*$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    assert "```" not in text, "a fence that does not end, or is deeper than three spaces"
    wrong = [f"{name_of(page)}:{f.line}: {f.language!r}" for f in fences(page) if f.language not in LANGUAGES]
    assert not wrong, f"fences of no language of {sorted(LANGUAGES)}: {wrong}"
    hidden = [str(c) for c in indented(page) if is_command(c.text)]
    hidden += [f"{name_of(page)}:{f.line}" for f in fences(page) if f.language == "text" and any(
        is_command(line.removeprefix("$ ")) for line in f.text.splitlines())]
    assert not hidden, f"commands outside fences of sh and console: {hidden}"


def test_every_command_has_a_way() -> None:
    unknown = []
    for command in all_commands():
        try:
            way_of(command)
        except UnknownCommand as error:
            unknown.append(str(error))
    assert not unknown, "\n".join(unknown)
    assert len(all_commands()) > 100 and len(SESSIONS) > 5


def test_the_rules_notice_what_is_not_there() -> None:
    page = ROOT / "README.md"

    def wrong(text: str, *, inline: bool = True) -> bool:
        command = Command(page, 1, text, inline=inline)
        try:
            way_of(command)
            return bool(list(broken_rules(command)))
        except UnknownCommand:
            return True

    assert wrong("zonemill plant part.step") and wrong("zonemill plan p.step --setups s.json")
    assert wrong("zonemill serve --port many") and not wrong("zonemill serve --port 80")
    assert wrong("zonemill plan p.step", inline=False) and wrong("frobnicate --all", inline=False)
    assert wrong("make everything") and wrong("make soak K=nonesuch") and not wrong("make soak K=load")
    assert wrong("docker compose exec nobody true") and wrong("docker compose exec api zonemill key")
    assert wrong("python benchmarks/jobs/no_such.py") and wrong("ZONEMILL_NONESUCH=1 make test")
    assert [is_command(t) for t in ("make test", "make", "zonemill", "frobnicate --all", "ls -l", "0.3 to 12 mm",
                                    "stock.step_file", "plan --mesh-step", "docs/limits.md")] == [
        True, False, False, True, True, False, False, True, False]
    assert [s.words for s in simple('a=$(b "$c" <d) && X=1 ../.venv/bin/e -f | g >h')] == [
        ["b", "$c"], [], ["../.venv/bin/e", "-f"], ["g"]]


# Rules.

@pytest.mark.parametrize("command", [c for c in all_commands()], ids=str)
def test_what_is_not_run_keeps_the_rules(command: Command) -> None:
    assert not list(broken_rules(command))


def test_make_knows_what_to_do(checkouts: Path) -> None:
    if shutil.which("make") is None:
        pytest.skip("make is not installed; remedy: apt-get install make")
    folder = make_checkout(checkouts / "make")
    found = {tuple(p.words[1:]) for c in all_commands() for p in simple(c.text) if p.program == "make"}
    # One call for all, since make asks for the versions of uv and node each time; a later value of a variable counts.
    words = sorted({word for words in found for word in words})
    done = subprocess.run(["make", "-n", *words], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stdout, f"make -n {' '.join(words)}: {done.stderr}"


def test_reasons_are_used_and_borne_out() -> None:
    parts = [p for c in all_commands() for p in simple(c.text)]
    used = {row.pattern for p in parts if p.words and (row := reason_of(p))}
    assert {row.pattern for row in NOT_RUN} == used, "a reason for a command that no page has"
    named = {w for p in parts if p.program == "make" for w in p.words[1:]}
    assert set(NOT_IN_CI) <= named - called_in_ci(), "a reason for a target that CI calls or no page names"
    for evidence in [*(row.evidence for row in NOT_RUN), *(texts for _, texts in NOT_IN_CI.values())]:
        for file, texts in evidence.items():
            gone = [t for t in texts if t not in (ROOT / file).read_text()]
            assert not gone, f"{file} has no {gone}"
    for name in ("demo", "serve"):  # run below
        assert any(not c.inline and re.match(rf"make {name}\b", c.text) for c in all_commands())


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_variables_and_options_are_known(page: Path, helps: dict[str, str]) -> None:
    unknown = [str(s) for s in variables(page) if not variable_is_known(s.text.partition("=")[0])]
    known = {*options_of_zonemill(), *OPTIONS_BY_OTHERS}
    texts = [helps[name_of(path)] for path in scripts(page)]
    for span in lone_options(page):
        for option in re.findall(r"--[a-z-]+", span.text):
            if option not in known and not any(has_option(text, option) for text in texts):
                unknown.append(f"{span}: no program of this page has {option}")
    assert not unknown, "\n".join(unknown)


HELP = """
import contextlib, io, json, os, runpy, sys
texts, beside = {}, sys.path[:]
for name in sys.argv[1:]:
    said, sys.argv, sys.path = io.StringIO(), [name, "--help"], [os.path.dirname(name), *beside]
    asks = "argparse" in open(name).read()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            runpy.run_path(name, run_name="__main__" if asks else "imported")
            texts[name] = "did not end" if asks else ""
        except SystemExit as end:
            texts[name] = f"ended with {end.code}: {said.getvalue()}" if end.code else said.getvalue()
        except BaseException as error:
            texts[name] = f"ended with {type(error).__name__}: {error}"
print(json.dumps(texts))
"""


@pytest.fixture(scope="module")
def helps() -> dict[str, str]:
    """What each script that a page names prints as its help; they share one process, for imports take seconds."""
    names = sorted({name_of(path) for page in PAGES for path in scripts(page)})
    done = subprocess.run([sys.executable, "-c", HELP, *names], cwd=ROOT, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


def has_option(text: str, option: str) -> bool:
    """Whether a help has an option."""
    return re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", text) is not None


@pytest.mark.parametrize("script", sorted({name_of(p) for page in PAGES for p in scripts(page)}))
def test_scripts_say_how_they_are_called(script: str, helps: dict[str, str]) -> None:
    assert not helps[script].startswith(("ended with", "did not end")), helps[script]
    for command in all_commands():
        for part in simple(command.text):
            found = script_of(part) if part.words else None
            if found and name_of(found[0]) == script:
                named = [w.partition("=")[0] for w in found[1] if w.startswith("--")]
                gone = [option for option in named if not has_option(helps[script], option)]
                assert not gone, f"{command}: {script} has no {gone}"


@pytest.mark.parametrize("script", sorted({s.text for page in PAGES for s in spans(page)
                                           if re.fullmatch(r"\.ci/[\w/-]+", s.text)}))
def test_scripts_of_the_shell_are_whole(script: str) -> None:
    shell = (ROOT / script).read_text().splitlines()[0].rpartition("/")[2].rpartition(" ")[2]
    done = subprocess.run([shell, "-n", script], cwd=ROOT, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("fence", [f for p in PAGES for f in fences(p) if f.language in ("json", "python")],
                         ids=lambda f: f"{name_of(f.page)}:{f.line}")
def test_code_of_other_languages_is_whole(fence) -> None:
    if fence.language == "json":
        assert not fence.text.strip() or json.loads(fence.text)
    else:
        code = compile(fence.text, name_of(fence.page), "exec")
        if not fence.name:  # a file is run by the command that names it
            exec(code, {})


# Commands that are run.

@pytest.fixture(scope="module")
def checkouts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder for all checkouts of this module."""
    return tmp_path_factory.mktemp("docs")


@pytest.fixture(scope="module")
def given(checkouts: Path) -> Path:
    """Folder with what a reader brings along, by the names on the pages."""
    folder = checkouts / "given"
    step, setup = write_small(folder)
    shutil.copy(step, folder / "part.step")
    shutil.copy(setup, folder / "setup.json")
    step, setup = write_demo(folder)
    # The service takes the form of a job with a blank. This one is too small: the job ends once both are read.
    shutil.copy(folder / "small.step", folder / "casting.step")
    blank = {"kind": "step", "step_file": "casting.step"}
    (folder / "tools.csv").write_text("id,kind,diameter_mm,flute_length_mm\nT1,ball,3,9\n")
    (folder / "casting.setup.json").write_text(json.dumps({**json.loads(setup.read_text()), "stock": blank}))
    return folder


def begin(page: Path, folder: Path, given: Path) -> Session:
    """A reader who begins with a page: in the checkout, with the examples in their folder."""
    checkout = make_checkout(folder)
    own = folder.with_name(f"{folder.name}-given")
    shutil.copytree(given, own)
    for fence in fences(page):
        if fence.name:
            (own / fence.name).write_text(fence.text)
    return Session(checkout, checkout / (page.parent.relative_to(ROOT) if "examples" in page.parts else ""), own)


def play(session: Session, page: Path, *, slow: bool) -> int:
    """Run the commands of the fences of a page; how many."""
    count = 0
    for fence in fences(page):
        found = commands(fence)
        beside = any(serves(c) for c in found)
        for command in found:
            way = way_of(command)
            if way == Way.EVERYDAY or way == Way.SLOW and slow:
                count += 1
                want(command)
                if serves(command):
                    session.start(command)
                else:
                    session.run(command, beside=beside)
    session.stop()
    return count


def serves(command: Command) -> bool:
    """Whether a command serves until Ctrl-C."""
    last = list(simple(command.text))[-1]
    return last.program in ("zonemill", "make") and last.words[1:2] in (["serve"], ["view"])


def want(command: Command) -> None:
    """Skip the test where a program by others is not installed."""
    for part in simple(command.text):
        if part.program in PROGRAMS and shutil.which(part.program) is None:
            pytest.skip(f"{part.program} is not installed; remedy: apt-get install {PROGRAMS[part.program]}")
        if part.program == "zonemill" and part.words[1:2] == ["family"]:
            pytest.importorskip(DRAWS)


@cache
def kept(page: Path) -> list[Command]:
    """Commands of the fences of a page that are run every day."""
    return [c for fence in fences(page) for c in commands(fence) if way_of(c) == Way.EVERYDAY]


@pytest.mark.network
@pytest.mark.parametrize("page", [p for p in SESSIONS if kept(p)], ids=name_of)
def test_pages_read_from_their_top_do_what_they_say(page: Path, checkouts: Path, given: Path,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs are those of a chain that computes nothing."""
    from service.api.server import background, settings_with

    session = begin(page, checkouts / f"{page.parent.name}-{page.stem}", given)
    monkeypatch.setenv("PYTHONPATH", str(FAKES))  # of the processes of jobs
    settings = settings_with({"data_dir": session.checkout / "data", "port": 0, "poll_s": 0.05, "workers": 1,
                              "webhook_secret": "s" * 40, "webhook_origins": ["https://mes.invalid"]})
    try:
        if not any("8000" in c.text or c.text.startswith(("./", "job=")) for c in kept(page)):
            assert play(session, page, slow=False) == len(kept(page))
            return
        with background(settings, "fake_chain") as url:
            session.serve = lambda: url
            assert play(session, page, slow=False) == len(kept(page))
    finally:
        session.close()


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("page", SLOW, ids=name_of)
def test_pages_do_what_they_say_with_real_jobs(page: Path, checkouts: Path, given: Path,
                                               request: pytest.FixtureRequest) -> None:
    """Parts of the demo and of the warm-up are planned and proved, over HTTP too."""
    session = begin(page, checkouts / f"{page.parent.name}-{page.stem}-slow", given)
    if "other.ngc" in page.read_text():
        shutil.copy(request.getfixturevalue("proved") / "program.linuxcnc.ngc", session.given / "other.ngc")

    def serve() -> str:
        session.start(Command(page, 0, "make serve"))
        return session.address

    session.serve = serve
    try:
        assert play(session, page, slow=True)
    finally:
        session.close()


STANDS_FOR = {"PART": "part.step", "SETUP.json": "setup.json", "DIR": "out/part", "NAME": "mes", "ID": "KEY",
              "zonemill.db": "data/zonemill.db", "COPY": "copy.db", "FILE": "tools.csv"}
"""What a reader puts in the place of the words of running text; KEY is the id of a key."""


def ready(text: str, key: str = "") -> str:
    """A command of running text with what the reader puts in."""
    for word, instead in STANDS_FOR.items():
        text = re.sub(rf"(?<![\w.]){re.escape(word)}(?![\w.])", instead.replace("KEY", key), text)
    return text


@pytest.fixture(scope="module")
def desk(checkouts: Path, given: Path) -> Path:
    """A checkout for commands in running text, with the reader's files."""
    folder = make_checkout(checkouts / "running-text")
    for path in given.iterdir():
        shutil.copy(path, folder / path.name)
    return folder


def zonemill(*words: str) -> str:
    """Run a command of zonemill in this process and the folder it is in; what it prints."""
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code == 0, f"zonemill {' '.join(words)}: {done.output}"
    return done.stdout


@pytest.mark.parametrize("text", sorted(t for t, c in INLINE.items() if way_of(c) == Way.EVERYDAY))
def test_commands_in_running_text(text: str, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    want(INLINE[text])
    monkeypatch.chdir(desk)
    monkeypatch.setenv("ZONEMILL_WEBHOOK_SECRET", "s" * 40)
    key = json.loads(zonemill("keys", "create", "--principal", "first"))["id"]
    (part,) = simple(ready(text, key))
    if part.program != "zonemill":
        done = subprocess.run(part.words, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return
    said = zonemill(*part.words[1:])
    assert said or "revoke" in text
    if "> openapi.yaml" in text:
        assert said == (ROOT / "openapi.yaml").read_text()


@pytest.fixture(scope="module")
def reader(desk: Path, given: Path) -> Iterator[Session]:
    """A reader at the desk."""
    session = Session(desk, desk, given)
    yield session
    session.close()


PLAN = ".venv/bin/zonemill plan part.step --setup setup.json --out out/part"


@pytest.fixture(scope="module")
def proved(reader: Session) -> Path:
    """Folder with the files of the small part, planned and proved by the command line."""
    reader.run(Command(ROOT / "README.md", 0, PLAN))
    return reader.checkout / "out" / "part"


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.timeout(900)
@pytest.mark.parametrize("text", sorted(t for t, c in INLINE.items() if way_of(c) == Way.SLOW))
def test_long_commands_in_running_text(text: str, reader: Session, proved: Path) -> None:
    assert proved.is_dir()
    command = Command(INLINE[text].page, INLINE[text].line, f".venv/bin/{ready(text)}")
    want(command)
    if command.text == PLAN:
        return  # that is how they were proved
    if serves(command):
        reader.start(command)
        reader.stop()
    else:
        reader.run(command)
