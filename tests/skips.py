"""One line at the end of a run for all tests that were skipped for want of a program."""

from __future__ import annotations

from typing import Any

REMEDIES = {"rs274": "apt-get install linuxcnc-uspace", "opencamlib": "make peers",
            "nc_gcode_interpreter": "make peers",
            "chromium": "apt-get install chromium", "postgres": "apt-get install postgresql",
            "psycopg": "make setup", "make web": "make web", "curl": "apt-get install curl",
            "compiler": "apt-get install gcc", "../shared": "put the folder shared beside the checkout"}
"""By a word of the reason: the command that brings what is missing."""


def remedies(reasons: list[str]) -> tuple[int, list[str]]:
    """How many of the skips want a program, and the commands that bring those, without repeats."""
    found = [next((command for word, command in REMEDIES.items() if word in reason.lower()), "") for reason in reasons]
    return sum(map(bool, found)), sorted({command for command in found if command})


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the line."""
    reasons = [str(r.longrepr[2] if isinstance(r.longrepr, tuple) else r.longrepr)
               for r in terminalreporter.stats.get("skipped", [])]
    count, commands = remedies(reasons)
    if count:
        terminalreporter.write_line(f"{count} tests were skipped because programs by others are missing; "
                                    f"to run them: {'; '.join(commands)}")
