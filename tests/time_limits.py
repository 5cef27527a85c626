"""Limits of wall-clock time, which hold on an idle machine.

A busy machine must not fail a test. The everyday run therefore allows 20 times the limit, which still finds what hangs.
``make limits`` allows the limit itself.
"""

from __future__ import annotations

import os

BUSY = 20.0
"""Share of the limit that a busy machine may need."""


def in_time(seconds: float, limit: float) -> bool:
    """Whether what took ``seconds`` was fast enough; ``limit``, s, is that of an idle machine."""
    return seconds < limit * (1.0 if os.environ.get("ZONEMILL_LIMITS") else BUSY)
