"""Iso-parametric passes against waterline and plane-parallel ones, zone by zone of a whole plan, at equal true scallop.

Run from the root of the checkout: ``python benchmarks/passes/bench_strategies.py [--wheel FOLDER] [--parallel N]``;
the demo part, or the compressor wheel from the folder of parts by others. Every zone with exact faces is walked by
each strategy through the same stock, refined by the planner's own rounds until no more than the scallop is left; then
by the planner as it is, which goes on from what it took. What is left at the samples of the zone and how deep the
ball enters the part are measured by ``verify.surface.removal`` and on exact faces, which share no code with the
planner. Plane-parallel passes are tried on the first N steep zones of each tool, 120 s at most each.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

import service.pipeline as chain  # noqa: E402
import toolpath.planning.job_plan as planner  # noqa: E402
import toolpath.planning.zone_finishing as finish  # noqa: E402
import toolpath.planning.zone_layout as zone_layout  # noqa: E402
from examples.family.recipes import make_part  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.sampling import sample_surface  # noqa: E402
from geometry.step_import.face_surfaces import read_patches  # noqa: E402
from geometry.surfaces.foot_points import foot_points  # noqa: E402
from service.from_wire import parse_setup  # noqa: E402
from service.stages.preparation import Prepared  # noqa: E402
from toolpath.plan_settings import Pattern
from toolpath.workingsteps import TrajectoryKind, Workingstep  # noqa: E402
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from zones.machinable_area import AreaForm  # noqa: E402

PARALLEL_S = 120
DEEPEST = 60  # samples of the part whose depth in a ball is measured exactly
SPARED = 0.002  # mm a sample may lie in the ball along its normal and is not looked at: facets and rounding


class Measure:
    """The exact part in the frame of the first access, by samples."""

    def __init__(self, step: Path, ready: Prepared) -> None:
        turn, inputs, part = np.eye(4), ready.inputs, ready.views[0].part
        turn[:3, :3] = ready.views[0].rotation
        exact = read_patches(step, None, placement=inputs.placement, solid=inputs.solid)
        s = sample_surface(part.mesh, 20.0, seed=3)
        self.points, self.normals = s.points.copy(), s.normals
        for number, patch in exact.items():
            rows = np.flatnonzero(s.face == number)
            if len(rows):
                start = patch.parameters(part.uv[s.triangle[rows]].mean(axis=1))
                found = foot_points(patch.surface.moved(turn), s.points[rows], start)
                near = found.distance < 0.05
                self.points[rows[near]] = found.points[near]

    def entered(self, moves: Moves, body) -> float:
        """The deepest a sample lies in the ball, mm; 0 for none."""
        low, high = (np.vstack([moves.start, moves.end]).min(axis=0) - 2.0 * body.radius,
                     np.vstack([moves.start, moves.end]).max(axis=0) + 2.0 * body.radius)
        near = np.flatnonzero(((self.points > low) & (self.points < high)).all(axis=1))
        if not len(near):
            return 0.0
        rest = left_by(moves, body, self.points[near], self.normals[near])
        rows = near[np.argsort(rest)[:DEEPEST][np.sort(rest)[:DEEPEST] < -SPARED]]
        start, d = moves.start + [0.0, 0.0, body.radius], moves.end - moves.start
        deep = [0.0]
        for p in self.points[rows]:
            s = np.clip(((p - start) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300), 0.0, 1.0)
            deep.append(body.radius - float(np.linalg.norm(p - start - s[:, None] * d, axis=1).min()))
        return max(deep)


def cuts(steps: list[Workingstep]) -> Moves | None:
    """The cutting moves of steps."""
    lines = [t.points for s in steps for t in s.trajectories if t.motion is TrajectoryKind.CUT]
    if not lines:
        return None
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    return Moves(start, end, np.ones(len(start), np.bool_), np.zeros(len(start), np.int32))


def left_by(moves: Moves, body, points: F64, normals: F64) -> F64:
    """(n,) mm left on normals after moves."""
    return residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]


class Compared(finish.Finish):
    """A finish that prints what each strategy would do before it is walked as ever."""

    measure: Measure
    parallel = 0
    asked: dict[str, int] = {}

    def walk(self, step_id: str) -> list[Workingstep]:
        if self.faces and len(self.checks.points) and self.field.tool.corner_radius > 0:
            worth, zone_layout.WORTH_A_TRY = zone_layout.WORTH_A_TRY, np.inf
            try:
                other, refused = self.layout.along_borders
            finally:
                zone_layout.WORTH_A_TRY = worth
            for reason in refused:
                print(f"{self.zone.id:5} {'-':14} {reason['reason']}", flush=True)
            self._told(self.strategy, step_id)
            if other is not None:
                self._told(other, step_id)
            if self.zone.form is AreaForm.STEEP and self.asked.setdefault(self.field.tool.id, 0) < self.parallel:
                self.asked[self.field.tool.id] += 1
                self._parallel(step_id)
        steps = super().walk(step_id)
        if self.faces and steps:
            why = [r for r in self.strategy.rejected if r["strategy"] == "isoparametric"]
            print(f"{self.zone.id:5} taken: {self.strategy.name} {why}", flush=True)
        return steps

    def _parallel(self, step_id: str) -> None:
        def late(*_: object) -> None:
            raise TimeoutError

        signal.signal(signal.SIGALRM, late)
        signal.alarm(PARALLEL_S)
        try:
            settings = replace(self.settings, pattern=Pattern.ZIGZAG)
            shallow = replace(self.zone, form=AreaForm.SHALLOW)
            made = zone_layout.ZoneLayout(shallow, self.layout.checks, self.field, self.cut, settings).usual
            self._told(replace(made, name="plane-parallel"), step_id)
        except TimeoutError:
            print(f"{self.zone.id:5} {'plane-parallel':14} not done in {PARALLEL_S} s", flush=True)
        finally:
            signal.alarm(0)

    def _told(self, strategy, step_id: str) -> None:
        begin = time.perf_counter()
        trial = self._copied(strategy)
        steps = trial._rounds(step_id, np.ones(len(self.checks.points), np.bool_))
        took, moves = time.perf_counter() - begin, cuts(steps)
        if moves is None:
            print(f"{self.zone.id:5} {strategy.name:14} no pass", flush=True)
            return
        h, given = self.settings.scallop_height, self.given
        planned = trial.residual.residual[:given]
        scored: NDArray[np.bool_] = planned <= h
        left = left_by(moves, self.field.tool, self.checks.points[:given], self.checks.normals[:given])
        way = sum(t.length for s in steps for t in s.trajectories if t.motion is TrajectoryKind.CUT)
        lines = sum(t.motion is TrajectoryKind.CUT for s in steps for t in s.trajectories)
        print(f"{self.zone.id:5} {strategy.name:14} {self.zone.form:8} {self.field.tool.id:3} {given:7d} "
              f"{way:8.0f} {sum(s.seconds for s in steps):7.1f} {lines:6d} {int((~scored).sum()):6d} "
              f"{np.quantile(left[scored], 0.99) if scored.any() else 0:8.4f} "
              f"{left[scored].max() if scored.any() else 0:8.4f} "
              f"{self.measure.entered(moves, self.field.tool):8.4f} {took:6.1f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheel", type=Path, help="folder of the parts by others")
    parser.add_argument("--parallel", type=int, default=2, help="steep zones of each tool")
    args = parser.parse_args()
    Compared.parallel = args.parallel
    exact = chain.trimmed_faces

    def watched(step: Path, ready: Prepared):
        Compared.measure = Measure(step, ready)
        return exact(step, ready)

    chain.trimmed_faces, planner.Finish = watched, Compared
    with tempfile.TemporaryDirectory() as folder:
        if args.wheel:
            step = args.wheel / "imp_kj66_compressor_wheel.step"
            given = json.loads((Path(__file__).resolve().parents[2] / "examples/setups/kj66_compressor_wheel.json"
                                ).read_text())
        else:
            made = make_part(0, "demo")
            step, given = Path(made.write(folder)[0]), made.setup
        print(f"{'zone':5} {'strategy':14} {'form':8} {'by':3} {'samples':>7} {'mm':>8} {'s':>7} {'lines':>6} "
              f"{'failed':>6} {'p99':>8} {'most':>8} {'gouge':>8} {'took s':>6}")
        begin = time.perf_counter()
        report = chain.plan(step, parse_setup(json.dumps(given)), Path(folder) / "out", lambda _stage, _share: None)
        for found in report.get("findings", []):
            print(found["kind"], found.get("line"), found.get("zone"), found.get("depth"), found.get("message"))
        print(f"{report['state']} in {time.perf_counter() - begin:.0f} s, with all trials; "
              f"findings {len(report.get('findings', []))}")
        for zone in report["zones"]:
            print(zone["id"], {k: zone.get(k) for k in ("strategy", "coverage", "scallop_max_mm", "residual_max_mm")})


if __name__ == "__main__":
    main()
