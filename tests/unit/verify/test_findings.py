"""Which findings are told where there are too many to tell all, and on which line."""

import numpy as np
import pytest

from tests.hand_parts import tool
from verify.findings import KEPT_OF_A_KIND, MAX_FINDINGS, Source, contact_findings, ordered
from verify.kernels.stock import CUTTER
from verify.model import Finding, FindingKind
from verify.moves import Moves


def _many(kind, count):
    return [Finding(kind, "p", k + 1, None, None, None, float(k), 0.0, "") for k in range(count)]


def test_a_grave_kind_does_not_crowd_out_the_one_that_says_why():
    told, counts = ordered(_many(FindingKind.COLLISION, 500) + _many(FindingKind.LIMIT, 1))
    assert len(told) == MAX_FINDINGS and counts == {"collision": 500, "limit": 1}
    assert [str(f.kind) for f in told] == ["collision"] * (MAX_FINDINGS - 1) + ["limit"]
    assert told[0].depth == 499.0


def test_all_kinds_at_once_keep_their_gravest():
    told, _ = ordered([f for kind in FindingKind for f in _many(kind, 300)])
    assert len(told) == MAX_FINDINGS
    kinds = [f.kind for f in told]
    assert kinds == sorted(kinds, key=list(FindingKind).index)
    for kind in FindingKind:
        depths = [f.depth for f in told if f.kind == kind]
        assert len(depths) >= KEPT_OF_A_KIND >= 10 and depths == [float(299 - k) for k in range(len(depths))]


def test_few_findings_are_all_told():
    told, _ = ordered(_many(FindingKind.RESIDUAL, 3) + _many(FindingKind.GOUGE, 2))
    assert [str(f.kind) for f in told] == ["gouge"] * 2 + ["residual"] * 3


@pytest.mark.parametrize("more, line", [(2e-6, 59), (-2e-6, 59), (0.01, 60)])
def test_of_depths_that_differ_by_rounding_the_first_line_is_told(more, line):
    """A rapid runs into a wall, and the lift out of it is as deep but for rounding."""
    ends = np.array([[0.0, 0, 0], [2.0, 0, 0], [2.0, 0, 30]])
    moves = Moves(ends[:-1], ends[1:], np.zeros(2, bool), np.zeros(2, np.int32))
    source = Source(("p",), np.zeros(2, np.int32), np.array([59, 60], np.int32), np.ones(2, np.int32))
    events = np.array([[1.0, CUTTER, 1.0 + more, 0.0, 3.0, 0.0, 1.0], [0.0, CUTTER, 1.0, 0.0, 3.0, 0.1, 1.0]])
    (found,) = contact_findings(events, moves, source, np.full(2, 0.4), (tool(4.0, 0.0),))
    assert (found.kind, found.line) == (FindingKind.RAPID, line)
    assert found.depth == pytest.approx(1.0 + max(more, 0.0), abs=1e-5)
