"""Output of the command line: the result on stdout, everything else on stderr, errors as one clear block."""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

from geometry.errors import CamError
from service.errors import error_mapping, problem_document

MEASURED_SHOWN = 20
LIVE_EVERY_S, LINE_EVERY_S = 1.0, 5.0  # between two lines of one stage, on a terminal and elsewhere
REWRITE_S = 0.25  # between two rewrites of a line on a terminal


def say(text: str) -> None:
    """One line to stderr."""
    print(text, file=sys.stderr, flush=True)


class Progress:
    """Progress lines on stderr: every new stage with its time and percentage, and again while the stage lasts.

    every_s : s between two lines of one stage; by default 1 on a terminal, where the line is rewritten, and 5 elsewhere
    """

    def __init__(self, every_s: float | None = None) -> None:
        self.started, self.stage, self.fraction, self.shown = time.monotonic(), "", 0.0, 0.0
        self.live = sys.stderr.isatty()
        self.every = every_s if every_s is not None else LIVE_EVERY_S if self.live else LINE_EVERY_S
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._ticker: threading.Thread | None = None

    def __call__(self, stage: str, fraction: float) -> None:
        with self._lock:
            new, self.stage, self.fraction = stage != self.stage, stage, fraction
            if new or (self.live and time.monotonic() - self.shown > REWRITE_S):
                self._print(new=new)
        if self._ticker is None:
            self._ticker = threading.Thread(target=self._tick, name="progress", daemon=True)
            self._ticker.start()

    def _tick(self) -> None:
        while not self._closed.wait(self.every / 4):
            with self._lock:
                if time.monotonic() - self.shown >= self.every:
                    self._print(new=False)

    def _print(self, *, new: bool) -> None:
        self.shown = time.monotonic()
        text = f"{self.shown - self.started:7.1f} s  {100 * self.fraction:3.0f} %  {self.stage}"
        if self.live:
            print(("\n" if new else "") + "\r\x1b[K" + text, end="", file=sys.stderr, flush=True)
        else:
            say(text)

    def close(self) -> None:
        """End the line; later calls do nothing."""
        if self._closed.is_set():
            return
        self._closed.set()
        if self._ticker is not None:
            self._ticker.join()
        if self.live and self.stage:
            say("")


def print_json(data: Any) -> None:
    """The result, as JSON on stdout."""
    sys.stdout.write(json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n")
    sys.stdout.flush()


def verification_summary(report: dict[str, Any], seconds: float) -> str:
    """A verification in a few lines: state, findings by kind with the first of each, coverage, files, time.

    report  : from ``service.pipeline.verify_program``; seconds : duration of the verification
    """
    count = sum(report.get("finding_counts", {}).values())
    lines = [f"{report['state']}: {count or 'no'} finding{'' if count == 1 else 's'}"]
    for kind, number in report.get("finding_counts", {}).items():
        own = [f for f in report["findings"] if f["kind"] == kind]
        first = min(own, key=lambda f: f.get("line") or sys.maxsize, default=None)
        where = "" if first is None else f"line {first['line']}: " if first.get("line") else ""
        lines.append(f"  {kind:<10} {number:4d}  {where}{'' if first is None else first.get('message', '')}")
    if report.get("coverage") is not None:
        lines.append(f"  coverage   {100 * report['coverage']:.2f} % of the judged area within the budget")
    if report.get("gouge_max_mm"):
        lines.append(f"  deepest    {report['gouge_max_mm']:g} mm cut into the part")
    if made := report.get("machined"):
        lines.append(f"  machined   {made['volume_mm3']:g} mm3 remain, nodes {made['step_mm']:g} mm apart")
    if files := report.get("files"):
        lines.append(f"  files      {', '.join(f['name'] for f in files)}, report.json")
    lines.append(f"  took       {seconds:.1f} s")
    return "\n".join(lines)


def error_block(error: CamError) -> str:
    """An error as text for people."""
    lines = [f"error: {error.message}", f"  code      {error.code} ({type(error).__name__})"]
    if error.subjects:
        lines.append(f"  concerns  {', '.join(error.subjects)}")
    if isinstance(error.measured, list) and error.measured and isinstance(error.measured[0], dict):
        for item in error.measured[:MEASURED_SHOWN]:
            lines.append("  found     " + ": ".join(str(v) for v in item.values()))
        if len(error.measured) > MEASURED_SHOWN:
            lines.append(f"  found     and {len(error.measured) - MEASURED_SHOWN} more")
    elif error.measured is not None:
        lines.append(f"  measured  {error.measured}")
    if error.limit is not None:
        lines.append(f"  limit     {error.limit}")
    if error.remedy:
        lines.append(f"  remedy    {error.remedy}")
    return "\n".join(lines)


def report_error(error: CamError, *, as_json: bool) -> int:
    """Print an error (block on stderr; with ``as_json`` the problem document on stdout) and return the exit code."""
    if as_json:
        print_json(problem_document(error))
    else:
        say(error_block(error))
    return error_mapping(error).exit_code
