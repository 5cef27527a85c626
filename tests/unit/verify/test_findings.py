"""Which findings are told where there are too many to tell all."""

from verify.findings import KEPT_OF_A_KIND, MAX_FINDINGS, ordered
from verify.model import Finding, FindingKind


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
