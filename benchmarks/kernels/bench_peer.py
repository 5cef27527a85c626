"""Volumes cut by three programs of three axes: the witness's field of distances beside FreeCAD's path simulator.

Run from the root of the checkout: ``python benchmarks/kernels/bench_peer.py [--steps H ...]``, with ``freecadcmd`` on
the path (Debian: freecad; measured with 0.20.2); says so and ends where it is not there. The programs: the pocket of
``tests/pocket_case.py``, the ball to and fro over the wavy block of ``bench_prove.py``, and what ``zonemill plan``
makes of the small part that ``zonemill warm`` compiles with. A line is one program at one step of both.

Bounds. Ours: a sixteenth of the step for every mm² of surface, as for planes that lie badly to the grid
(docs/theory/proof.md). FreeCAD: it lowers every square of its raster that a tool touches, finds the profile of a tool
in steps of the resolution, and draws squares within a resolution of each other at one height: the resolution times
twice the area cut in plan, and times the area of walls, that is what heights differ by between neighbours.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from benchmarks.proof.bench_prove import TOOL as BALL  # noqa: E402
from benchmarks.proof.bench_prove import block, program  # noqa: E402
from examples.demo import write_small  # noqa: E402
from geometry.mesh import F64, TriangleMesh  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.step_import.reader import read_part  # noqa: E402
from geometry.tool_body import ToolBody  # noqa: E402
from service.from_wire import read_setup, tool_bodies  # noqa: E402
from tests import pocket_case  # noqa: E402
from verify.blank.blank import stock_bounds  # noqa: E402
from verify.gcode.reader import FEED, read_program  # noqa: E402
from verify.material.material import machined  # noqa: E402
from verify.material.stock_field import DistanceField  # noqa: E402
from verify.model import ProofSetup, StockKind  # noqa: E402
from verify.moves import Moves


@dataclass(frozen=True, eq=False)
class Job:
    """A program with what it cuts; the part's mesh stands for its bounds."""

    name: str
    text: str
    mesh: TriangleMesh
    tools: tuple[ToolBody, ...]
    setup: ProofSetup

    def moves(self) -> Moves:
        """The feed moves, as the witness reads them."""
        p = read_program(self.text, name=self.name)
        keep = p.kind == FEED
        rows = {t.number: k for k, t in enumerate(self.tools)}
        return Moves(p.start[keep], p.end[keep], keep[keep], np.array([rows[int(t)] for t in p.tool[keep]], np.int32))


def jobs() -> Iterator[Job]:
    """The three programs."""
    pocket = pocket_case.block().mesh
    yield Job("pocket", pocket_case.text(pocket_case.program()), pocket, (pocket_case.TOOL,), pocket_case.SETUP)
    wavy = block()
    yield Job("wavy block", program(TriangleTree(wavy), 10_000), wavy, (BALL,), box_of(0.5))
    with tempfile.TemporaryDirectory(prefix="zonemill-peer-") as folder:
        step, setup = write_small(folder)
        subprocess.run([Path(sys.executable).parent / "zonemill", "plan", str(step), "--setup", str(setup), "--out",
                        folder], check=True, capture_output=True)
        wire = read_setup(setup)
        text = Path(folder, "program.linuxcnc.ngc").read_text()
        yield Job("planned", text, read_part(step).mesh, tool_bodies(wire),
                  box_of(wire.stock.margin_mm + wire.stock.uncertainty_mm))


def box_of(margin: float) -> ProofSetup:
    """A box so much larger than the part."""
    return ProofSetup(StockKind.BOX, margin=margin, uncertainty=0.0)


def peer(job: Job, moves: Moves, steps: list[float]) -> tuple[F64, F64, str]:
    """What FreeCAD says was cut, mm³, its seconds, and its version."""
    with tempfile.TemporaryDirectory(prefix="zonemill-peer-") as folder:
        np.savez(Path(folder, "ask.npz"), stock=stock_bounds(job.mesh.bounds, job.setup), start=moves.start,
                 end=moves.end, tool=moves.tool, tools=[(t.radius, t.corner_radius) for t in job.tools],
                 resolutions=steps)
        subprocess.run(["freecadcmd", str(Path(__file__).with_name("peer_freecad.py"))], check=True,
                       capture_output=True, env={**os.environ, "ZONEMILL_PEER": folder})
        with np.load(Path(folder, "told.npz")) as told:
            return told["volume"][:, 0] - told["volume"][:, 1], told["seconds"], ".".join(told["version"])


def peer_bound(field: DistanceField, step: float) -> float:
    """mm³ for every mm of resolution, by how far down each column was cut; over the middle of the grid."""
    share = np.clip(0.5 + field.values / field.step, 0.0, 1.0)
    standing = share.sum(axis=2) * field.step
    depth = np.where(standing > 0.0, standing.max() - standing, 0.0)
    walls = sum(float(np.abs(np.diff(depth, axis=k, prepend=0.0, append=0.0)).sum()) for k in (0, 1)) * field.step
    return step * (2.0 * float((depth > 0.5 * field.step).sum()) * field.step**2 + walls)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=float, nargs="+", default=[0.4, 0.2, 0.1])
    steps = parser.parse_args().steps
    if shutil.which("freecadcmd") is None:
        print("freecadcmd is not on the path: nothing to compare with")
        return
    print(f"{'program':12s} {'moves':>6} {'mm':>5} {'ours mm³':>10} {'bound':>7} {'FreeCAD mm³':>11} {'bound':>7} "
          f"{'apart':>8} {'of both':>7} {'FreeCAD s':>9}")
    for job in jobs():
        moves = job.moves()
        theirs, seconds, version = peer(job, moves, steps)
        for step, other, took in zip(steps, theirs.tolist(), seconds.tolist(), strict=True):
            field = machined(job.mesh, moves, job.tools, job.setup, step)
            blank = float(np.prod(np.diff(stock_bounds(job.mesh.bounds, job.setup), axis=0)))
            gone, own, far = blank - field.volume, field.surface().areas.sum() * step / 16.0, peer_bound(field, step)
            print(f"{job.name:12s} {len(moves):6d} {step:5.2f} {gone:10.2f} {own:7.2f} {other:11.2f} {far:7.2f} "
                  f"{other - gone:8.2f} {abs(other - gone) / (own + far):7.2f} {took:9.1f}", flush=True)
    print(f"FreeCAD {version}")


if __name__ == "__main__":
    main()
