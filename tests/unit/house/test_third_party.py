"""THIRD_PARTY.md agrees with the locks, and the script that writes it reads what it should."""

from __future__ import annotations

import importlib.util
import json
import sys
from email.message import Message

import pytest

from tests.source_tree import ROOT

_SPEC = importlib.util.spec_from_file_location("third_party", ROOT / ".ci" / "third_party.py")
assert _SPEC is not None and _SPEC.loader is not None
third_party = importlib.util.module_from_spec(_SPEC)
sys.modules["third_party"] = third_party
_SPEC.loader.exec_module(third_party)

NOT_LISTED = {"requirements-bench.lock", "requirements-web.lock"}


def test_the_page_agrees_with_the_locks():
    page = (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8")
    locks = list(third_party.listed(page))
    assert set(locks) == {p.name for p in ROOT.glob("requirements*.lock")} - NOT_LISTED | {"web/package-lock.json"}
    found = third_party.differences(third_party.pinned(locks, page), page)
    assert not found, "\n".join([*found, "Remedy: make third-party"])


def test_no_licence_is_unknown():
    sections = third_party.listed((ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8"))
    assert not [p.name for packages in sections.values() for p in packages if p.licence == third_party.UNKNOWN]


def test_pins_are_read_with_markers_and_extras():
    lock = "alpha==1.2\nbeta[x,y]==3.0.1 ; sys_platform == 'win32'\n# a comment\n"
    packages = third_party.python_packages(lock, {"alpha": "MIT"})
    assert [(p.name, p.version, p.licence) for p in packages] == [
        ("alpha", "1.2", "MIT"), ("beta", "3.0.1", third_party.UNKNOWN)]


def test_node_packages_stand_once_and_without_their_folders():
    entry = {"version": "1.0.0", "license": "ISC"}
    lock = {"packages": {"": {"name": "page"}, "node_modules/a": entry, "node_modules/b/node_modules/a": entry,
                         "node_modules/@s/c": {"version": "2.0.0"}}}
    packages = third_party.node_packages(json.dumps(lock))
    assert [(p.name, p.version, p.licence) for p in packages] == [
        ("@s/c", "2.0.0", third_party.UNKNOWN), ("a", "1.0.0", "ISC")]


@pytest.mark.parametrize(("fields", "licence"), [
    ([("License-Expression", "MIT"), ("License", "something else")], "MIT"),
    ([("Classifier", "License :: OSI Approved :: BSD License"), ("Classifier", "Topic :: X")], "BSD License"),
    ([("License", "Apache 2.0")], "Apache 2.0"),
    ([("License", "x" * 90)], third_party.UNKNOWN),
    ([], third_party.UNKNOWN),
])
def test_a_licence_comes_from_the_most_exact_field(fields, licence):
    message = Message()
    for name, value in fields:
        message[name] = value
    assert third_party.licence_of(message) == licence


def test_a_difference_is_named_both_ways():
    package = third_party.Package
    page = third_party.render({"x.lock": [package("a", "1", "MIT"), package("b", "1", "MIT")]})
    assert third_party.listed(page) == {"x.lock": [package("a", "1", "MIT"), package("b", "1", "MIT")]}
    found = third_party.differences({"x.lock": [package("a", "2", "MIT"), package("b", "1", "MIT")]}, page)
    assert found == ["x.lock: a 2 is not in THIRD_PARTY.md", "x.lock: a 1 is in THIRD_PARTY.md only"]
