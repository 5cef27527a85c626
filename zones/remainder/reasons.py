"""Words for why area remains, as reports and zones.json have them."""

from __future__ import annotations

from enum import StrEnum


class Reason(StrEnum):
    """Why no pass of the setup's tools cuts a sample, the least obstruction first (``docs/theory/zones.md``).

    UNDERCUT may be followed by the connection that covers the sample: 'undercut behind connection C2'.
    """

    PASS = "pass"
    HOLDER = "holder"
    SHANK = "shank"
    FIXTURE = "fixture"
    GAP = "gap"
    CORNER = "corner"
    SHARP_CORNER = "sharp corner"
    UNDERCUT = "undercut"


class ProposalVerdict(StrEnum):
    """What a proposal of tools finds for a sample beside a ``Reason`` (``docs/theory/tools.md``).

    TOOL       : some tool to add takes it; only while the proposal is made
    TAKEN      : a tool of the proposal takes it
    SLENDER    : only a neck longer than the limit in diameters reaches it
    TOO_LITTLE : the area is not worth a tool
    """

    TOOL = "tool"
    TAKEN = "taken"
    SLENDER = "slender"
    TOO_LITTLE = "too little"
