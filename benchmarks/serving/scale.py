"""How many workers one database and one scheduler feed: queues with the costs that ``bench_service.py`` measured.

``python benchmarks/serving/scale.py [--job 60] [--apis 2] [--costs bench.json]``. A job runs for so many seconds;
meanwhile its worker asks the database five times a second whether it still holds the job, writes progress and renews
the lease. Each API process goes round five times a second and whenever a job of its own ends: it asks the scheduler
for the slots, counts what runs, claims. Claims wait for one another. Looked for is what is busy first, and how many
workers have work.
"""

from __future__ import annotations

import argparse
import heapq
import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path


@dataclass(frozen=True)
class Costs:
    """Processor time, s, as measured on two cores that other programs shared; upper bounds, for what runs by the clock
    in a process is counted in.

    statement : of PostgreSQL for one statement of ours with its commit
    look      : of the scheduler for the question how many slots there are
    task      : of the scheduler for a task from its submission to its end
    rounds    : of an API process for a round of its dispatcher, and as much again for each job it hands over
    """

    statement: float = 0.0004
    look: float = 0.0017
    task: float = 0.005
    rounds: float = 0.007


@dataclass(frozen=True)
class Site:
    """What is simulated. job : how long one runs, s; progress : rows a second it writes; cores : of the database"""

    workers: int
    job: float = 60.0
    apis: int = 2
    cores: int = 4
    poll: float = 0.2
    lease: float = 20.0
    progress: float = 1.0


class Queue:
    """Something that serves so many at a time, first come first served."""

    def __init__(self, servers: int) -> None:
        self.free = [0.0] * servers
        self.busy = 0.0

    def serve(self, now: float, cost: float) -> float:
        """When what comes now is done."""
        begin = max(now, heapq.heappop(self.free))
        heapq.heappush(self.free, begin + cost)
        self.busy += cost
        return begin + cost

    def share(self, lasted: float) -> float:
        """How much of its time it worked."""
        return self.busy / (lasted * len(self.free))


def simulate(site: Site, costs: Costs, lasted: float = 90.0) -> dict[str, float]:
    """Run a site with a queue that never empties; returns shares of time, 0 to 1, of workers and of what feeds them."""
    events: list[tuple[float, int, Callable[[float], None]]] = []
    order = itertools.count()
    database, scheduler, lock = Queue(site.cores), Queue(1), Queue(1)
    apis = [Queue(1) for _ in range(site.apis)]
    state = {"running": 0, "worked": 0.0, "handed": 0}
    looking = [False] * site.apis

    def at(when: float, what: Callable[[float], None]) -> None:
        heapq.heappush(events, (when, next(order), what))

    def beat(api: int, ends: float) -> Callable[[float], None]:
        def again(now: float) -> None:
            if now >= ends:
                return
            wrote = site.poll * (site.progress + 4.0 / site.lease)  # of this look's share
            answered = database.serve(now, costs.statement * (1.0 + wrote))
            at(max(answered, now + site.poll), again)
        return again

    def ended(api: int, began: float) -> Callable[[float], None]:
        def end(now: float) -> None:
            done = database.serve(now, costs.statement)
            state["running"] -= 1
            state["worked"] += min(now, lasted) - min(began, lasted)
            at(done, go_round(api, forced=True))
        return end

    def go_round(api: int, forced: bool = False) -> Callable[[float], None]:
        def begin(now: float) -> None:
            if not forced:
                at(now + site.poll, go_round(api))
            if looking[api]:
                return
            looking[api] = True
            at(apis[api].serve(now, costs.rounds), look)

        def look(now: float) -> None:
            at(scheduler.serve(now, costs.look), claim)

        def claim(now: float) -> None:
            counted = database.serve(now, 1.4 * costs.statement)  # the count, and two clean-ups once a second
            if state["running"] >= site.workers:
                looking[api] = False
                return
            state["running"] += 1
            state["handed"] += 1
            claimed = lock.serve(counted, costs.statement)
            database.busy += costs.statement
            at(scheduler.serve(claimed, costs.task), start)
            at(apis[api].serve(claimed, costs.rounds), look)  # and the next one, until no slot is left

        def start(now: float) -> None:
            began = database.serve(now, 2 * costs.statement)
            # jobs are not all as long: those of the first moment end spread over the time of one
            length = site.job * (0.5 + (state["handed"] * 0.618) % 1.0)
            at(began + length, ended(api, began))
            at(began + site.poll, beat(api, began + length))
        return begin

    for k in range(site.apis):
        at(k * site.poll / site.apis, go_round(k))
    while events and events[0][0] < lasted:
        now, _, what = heapq.heappop(events)
        what(now)
    return {"database": database.share(lasted), "scheduler": scheduler.share(lasted), "claims": lock.share(lasted),
            "dispatcher": max(a.share(lasted) for a in apis), "jobs_running": state["running"] / site.workers,
            "handed_over_per_s": state["handed"] / lasted}


def from_bench(path: Path) -> Costs:
    """Costs that ``bench_service.py`` printed: of two API processes that go round with nothing to do."""
    idle = json.loads(path.read_text())["cluster"]["idle_per_s"]
    rounds = 2 * 5
    return replace(Costs(), statement=idle["postgres"] / idle["commits"], look=idle["scheduler"] / rounds,
                   rounds=idle["api"] / rounds)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--job", type=float, default=60.0)
    parser.add_argument("--apis", type=int, default=2)
    parser.add_argument("--costs", type=Path)
    given = parser.parse_args()
    costs = from_bench(given.costs) if given.costs else Costs()
    print(costs)
    print(f"{'workers':>8} {'running':>8} {'database':>9} {'scheduler':>10} {'claims':>7} {'dispatcher':>11} first")
    for workers in (10, 100, 300, 1000, 3000):
        found = simulate(Site(workers, given.job, given.apis), costs, lasted=max(90.0, 2 * given.job))
        first = max(("database", "scheduler", "claims", "dispatcher"), key=lambda k: found[k])  # noqa: B023
        print(f"{workers:8d} {found['jobs_running']:8.2f} {found['database']:9.2f} {found['scheduler']:10.2f} "
              f"{found['claims']:7.2f} {found['dispatcher']:11.2f} {first}")


if __name__ == "__main__":
    main()
