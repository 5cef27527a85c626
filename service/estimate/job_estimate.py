"""What a job will take: memory and processor seconds, from the lengths of the arrays that it will allocate.

An estimate is a sum of shares. Each share has a count (``service.estimate.job_size``), the bytes of one item, and the
processor seconds of one item. Bytes follow the arrays that hold an item at the same time. Seconds are measured.
docs/scale.md has the parts of the calibration, what they took, and the command that repeats it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from service.estimate.estimate import BASE, Estimate, Share
from service.estimate.job_size import JobSize
from service.stages.job_part import JobPart


@dataclass(frozen=True)
class Cost:
    """What one item takes.

    what    : the items, in words
    count   : their number in a job
    memory  : bytes of an item at the peak of a plan
    seconds : processor seconds of an item in a plan
    zones   : the same two in a dry check, which ends before the first pass
    proof   : the same two in a proof of one program
    """

    what: str
    count: Callable[[JobSize], float]
    memory: float
    seconds: float
    zones: tuple[float, float]
    proof: tuple[float, float]

    def of(self, kind: str) -> tuple[float, float]:
        """Bytes and seconds of an item in a job of a kind."""
        return {"plan": (self.memory, self.seconds), "zones": self.zones, "verify": self.proof}[kind]


COSTS = (
    # interpreter, libraries, compiled kernels, pictures of fixed size, and the process that writes STEP-NC
    Cost(BASE, lambda _: 1.0, 800e6, 30.0, (650e6, 20.0), (650e6, 25.0)),
    # mesh with normals and parameters, its tree with corners and boxes, in up to five frames and parts of them; their
    # number also tells of many curved faces, each of which is a zone with passes of its own
    Cost("facets of the part", lambda s: s.facets, 3000.0, 2e-3, (1500.0, 3e-4), (1500.0, 3e-4)),
    # place, normal, area, face and triangle in two frames; region; reach and tip by tool
    Cost("planning samples", lambda s: s.planning_samples, 500.0, 1e-5, (500.0, 2e-5), (0.0, 0.0)),
    # place and normal in two frames, tip, zone, target of the zone, what the proof finds
    Cost("samples of the proof", lambda s: s.proof_samples, 300.0, 4e-5, (0.0, 0.0), (300.0, 5e-5)),
    # two heights (16 bytes), distance and place of the nearest blocked node at one or two heights (16 each)
    Cost("lattices of the tools", lambda s: s.tool_nodes, 40.0, 2.5e-6, (40.0, 2.5e-6), (0.0, 0.0)),
    # top, cover and part of the blank (24 bytes), top and cover of the stock that is cut (16)
    Cost("stock of the planner", lambda s: s.stock_nodes, 40.0, 1e-6, (0.0, 0.0), (0.0, 0.0)),
    # height and the tables of a pass; a node of a field has 4 bytes and as many again for its shape
    Cost("stock of the proof", lambda s: s.proof_nodes, 30.0, 1e-6, (0.0, 0.0), (30.0, 1e-6)),
    # about 20 places a mm: path, moves as read back, texts of program and STEP-NC, paths of the page
    Cost("passes over curved faces, mm", lambda s: s.curved_path, 1e4, 12e-3, (0.0, 0.0), (0.0, 0.0)),
    Cost("passes over planes and in layers, mm", lambda s: s.plain_path, 1e3, 5e-4, (0.0, 0.0), (0.0, 0.0)),
)


def estimate_of(job: JobPart, kind: str = "plan") -> Estimate:
    """The estimate of a job whose part is read; the same input gives the same estimate, on any machine.

    kind : 'plan', 'zones' or 'verify'

    Raises
    ------
    SetupError
        As ``JobSize.of``.
    """
    return estimated(JobSize.of(job), kind)


def estimated(size: JobSize, kind: str = "plan") -> Estimate:
    """The estimate of a job of a size; kind : as for ``estimate_of``."""
    shares = []
    for cost in COSTS:
        count, (memory, seconds) = cost.count(size), cost.of(kind)
        if memory or seconds:
            shares.append(Share(cost.what, round(count), round(1e-6 * memory * count), round(seconds * count, 1)))
    return Estimate(sum(s.memory_mb for s in shares), float(round(sum(s.seconds for s in shares))), tuple(shares))


__all__ = ["COSTS", "Cost", "estimate_of", "estimated"]
