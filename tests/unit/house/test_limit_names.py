"""Constants that limit something are named MAX_ and MIN_, in the program and on its page."""

from __future__ import annotations

import re

from tests.source_tree import ROOT

PLACES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples", "tests", "benchmarks",
          ".ci", "docs/figures")
OTHER = re.compile(r"\b(?:MOST|AT_MOST|AT_LEAST|MAXIMUM|MINIMUM)_[A-Z]\w*")


def test_limits_have_one_form_of_name():
    files = [p for place in PLACES for p in (ROOT / place).rglob("*.py")]
    files += [p for p in (ROOT / "web" / "src").rglob("*.ts")]
    found = {p.relative_to(ROOT).as_posix(): names for p in files
             if (names := sorted({*OTHER.findall(p.read_text(encoding="utf-8"))}))}
    assert found == {}
