"""Every kind of finding and every reason of the remainder has its place in the documentation."""

from __future__ import annotations

import re

from tests.source_tree import ROOT
from verify.model import FindingKind
from zones.remainder.reasons import Reason

OF_THE_JOB = {"coverage", "load", "nothing_cut"}
"""Kinds that reports have for the whole job."""
REPORTS = ("report.py", "verification_report.py")
ALL = {*map(str, FindingKind), *OF_THE_JOB}


def test_verify_has_a_row_for_each_kind_in_order_of_gravity() -> None:
    text = (ROOT / "docs" / "verify.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z_]+)` \|", text[:text.index("| `proved` |")], re.MULTILINE)
    assert rows[:len(FindingKind)] == list(map(str, FindingKind))
    assert set(rows) == ALL and len(rows) == len(ALL)


def test_the_glossary_names_each_kind() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| kind of finding \| (.*) \|$", text, re.MULTILINE)
    assert set(re.findall(r"`([a-z_]+)`", row)) == ALL


def test_the_report_makes_the_kinds_of_the_whole_job() -> None:
    source = "".join((ROOT / "service" / "report" / name).read_text(encoding="utf-8") for name in REPORTS)
    assert set(re.findall(r'\bof_job\("([a-z_]+)"', source)) == OF_THE_JOB


def test_the_glossary_names_each_reason() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| reason \| (.*) \|$", text, re.MULTILINE)
    words = re.split(r", or |, | or ", row.split(": ")[1].split(" (")[0].replace("in a verification, ", ""))
    assert {w.strip("`").removesuffix(" or") for w in words} == {*map(str, Reason), "not_in_program"}
