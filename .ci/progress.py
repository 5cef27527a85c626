#!/usr/bin/env python3
"""Run a command and show that it goes on: a label, seconds, and its latest line. Its whole output only if it fails.

    progress.py [--of LOCK] LABEL COMMAND [ARGUMENT ...]

--of LOCK : the command installs this lock with pip or uv; packages are counted. On a terminal one line is rewritten,
elsewhere a line comes at least every 5 s. Python 3.11 or newer, nothing else: it runs before anything is installed.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

LINE_EVERY_S = float(os.environ.get("PROGRESS_EVERY_S", "5"))  # tests shorten it
REWRITE_EVERY_S = 0.25
COUNTED = re.compile(r"^\s*Collecting ")
COLOUR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
LEFT = 78  # columns, where a terminal does not tell


class Run:
    """The command while it runs: its output so far, its latest line, and packages counted."""

    def __init__(self, command: list[str]) -> None:
        self.output: list[str] = []
        self.latest, self.count = "", 0
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True, errors="replace")
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.output.append(line)
            self.count += bool(COUNTED.match(line))
            self.latest = COLOUR.sub("", line).strip() or self.latest

    def wait(self, seconds: float) -> int | None:
        """Exit code, or None where it still runs after so long."""
        try:
            code = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None
        self._reader.join(5)
        return code


def show(label: str, command: list[str], total: int = 0) -> int:
    """Run the command, show its progress on stderr; returns its exit code."""
    live, started, shown = sys.stderr.isatty(), time.monotonic(), time.monotonic()
    print(label, end="" if live else "\n", file=sys.stderr, flush=True)
    try:
        run = Run(command)
    except OSError as error:
        print(f"\n{command[0]}: {error.strerror}" if live else f"{command[0]}: {error.strerror}", file=sys.stderr)
        return 127
    while (code := run.wait(REWRITE_EVERY_S if live else min(LINE_EVERY_S, 0.5))) is None:
        if live or time.monotonic() - shown >= LINE_EVERY_S:
            shown = time.monotonic()
            part = f"{run.count} of {total}  " if run.count and total else ""
            text = f"{shown - started:6.0f} s  {part}{run.latest}"
            text = f"{label}{text}" if live else f"  {text}"
            width = shutil.get_terminal_size((LEFT, 24)).columns - 1
            print(("\r\x1b[K" if live else "") + text[:width], end="" if live else "\n", file=sys.stderr, flush=True)
    end = f"{'done' if code == 0 else f'failed with {code}'} after {time.monotonic() - started:.0f} s"
    print(f"\r\x1b[K{label}: {end}" if live else f"  {end}", file=sys.stderr, flush=True)
    if code:
        sys.stderr.writelines(run.output)
    return code


def main() -> int:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description="Run a command and show that it goes on.")
    parser.add_argument("--of", type=Path, help="lock whose packages the command installs")
    parser.add_argument("label")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    given = parser.parse_args()
    total = sum(1 for line in given.of.read_text().splitlines() if "==" in line) if given.of else 0
    try:
        return show(given.label, given.command, total)
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
