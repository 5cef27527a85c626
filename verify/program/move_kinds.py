"""The two kinds of move: in feed and rapid."""

from __future__ import annotations

RAPID, FEED = 0, 1
