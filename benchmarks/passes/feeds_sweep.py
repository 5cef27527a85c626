"""Speeds and feeds of the tools of 300 family parts, in all materials, on machines fast and slow.

No solid is built: a setup follows from the layout and its gaps. Every figure is checked: finite, above zero, none above
what machine or tool allow, and as the words of a program have it. Drawing the layouts takes some seconds a part.
Run: .venv/bin/python benchmarks/passes/feeds_sweep.py [parts]
"""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from examples.family.recipes import draw_layout, truth_of
from examples.setups import suggest_setup
from output.header_text import decimal
from schemas.materials import MATERIALS
from schemas.setup import Setup
from service.cutting_data import DEFAULT_MAX_FEED_MM_MIN, DEFAULT_MAX_RPM
from service.from_wire import parse_setup
from service.stages.job_inputs import JobInputs
from toolpath.plan_settings import CutData

PARTS = 300
OTHERS = ("narrow", "leaning_pair", "three_walls", "wavy")
MACHINES: dict[str, dict[str, Any]] = {
    "no limits stated": {},
    "old mill": {"max_rpm": 4000, "max_feed_mm_min": 800},
    "bench mill": {"max_rpm": 2500, "max_feed_mm_min": 60},
    "crawler": {"max_rpm": 40, "max_feed_mm_min": 0.1},
    "high speed": {"max_rpm": 60000, "max_feed_mm_min": 20000},
}
OVERRIDES: list[dict[str, float]] = [
    {}, {"spindle_rpm": 50000}, {"feed_mm_min": 9000, "plunge_feed_mm_min": 9000}, {"max_rpm": 3000},
    {"max_engagement_deg": 30}, {"spindle_rpm": 900, "feed_mm_min": 15.5, "max_rpm": 800},
]


def suggested(parts: int) -> Iterator[dict[str, Any]]:
    """The setups suggested for family parts: of three two random ones, and one of the other recipes in turn."""
    for k in range(parts):
        third, place = divmod(k, 3)
        recipe, seed = ("random", 2 * third + place) if place < 2 else (OTHERS[third % len(OTHERS)], third)
        layout = draw_layout(seed, recipe)
        yield suggest_setup(layout, truth_of(layout, f"{recipe}-{seed}"))


def varied(seed: int, raw: dict[str, Any]) -> Iterator[Setup]:
    """One suggested setup with every machine and material, each tool with one of ``OVERRIDES``."""
    for k, limits in enumerate(MACHINES.values()):
        tools = [{**t, **OVERRIDES[(seed + k + i) % len(OVERRIDES)]} for i, t in enumerate(raw["tools"])]
        for name in MATERIALS:
            yield parse_setup(json.dumps({**raw, "tools": tools, "material": name,
                                          "machine": {**raw["machine"], **limits}}))


def cut_table(setup: Setup) -> Mapping[str, CutData]:
    """Speeds, feeds and layer depths of the tools of a setup, by tool id."""
    return JobInputs.of(setup).cut_table


def faults(setup: Setup) -> list[str]:
    """What is wrong with the figures of a setup, in words."""
    machine, table, out = setup.machine, cut_table(setup), []
    for tool in setup.tools:
        cut = table[tool.id]
        own = min(tool.max_rpm or math.inf, machine.max_rpm or math.inf)
        most_rpm = min(own, math.inf if tool.spindle_rpm else DEFAULT_MAX_RPM if machine.max_rpm is None else math.inf)
        for work, c in (("roughing", cut), ("finishing", cut.finish or cut)):
            most = machine.max_feed_mm_min or (math.inf if tool.feed_mm_min or tool.plunge_feed_mm_min
                                               else DEFAULT_MAX_FEED_MM_MIN)
            out += [f"{tool.id} {work}: {what}" for what in _wrong(c, most_rpm, most)]
    return out


def _wrong(cut: CutData, most_rpm: float, most_feed: float) -> Iterator[str]:
    speed = float(decimal(cut.spindle_rpm, 0))
    if not 1.0 <= speed <= most_rpm:
        yield f"S{speed:g} of {most_rpm:g}"
    for name, feed in (("feed", cut.feed), ("plunge", cut.plunge_feed), ("link", cut.link_feed)):
        word = float(decimal(feed, 1 if feed >= 1.0 else 4))
        if not (math.isfinite(feed) and 0.0 < word <= most_feed):
            yield f"{name} F{word:g} of {most_feed:g}"


def sweep(raw: Iterable[dict[str, Any]]) -> Counter[str]:
    """Print how many figures of suggested setups were looked at and what was wrong."""
    bad: Counter[str] = Counter()
    parts = jobs = tools = 0
    for seed, one in enumerate(raw):
        parts += 1
        for setup in varied(seed, one):
            jobs, tools = jobs + 1, tools + len(setup.tools)
            bad.update(faults(setup))
    print(f"{parts} parts, {jobs} setups, {tools} tools, {8 * tools} figures: {sum(bad.values())} wrong")
    for text, count in bad.most_common(20):
        print(f"{count:6d}  {text}")
    return bad


if __name__ == "__main__":
    sys.exit(bool(sweep(suggested(int(sys.argv[1]) if len(sys.argv) > 1 else PARTS))))
