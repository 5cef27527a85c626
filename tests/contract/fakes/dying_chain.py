"""The real chain, but what the setup's label "kill" names dies once, of SIGKILL, when a job has been planned.

"worker": the process that runs the child, which is the service itself where it is embedded; "child": the child;
"child in a plan": the child, after ``ACTS`` acts of the first plan. Every plan and every proof leaves a line in the
file "done" beside the folders of what is kept, with "child in a plan" a plan also how many acts it still had to do.
"""

import os
import signal

import service.pipeline as chain
import service.stages.plan_prove_loop as loop
import service.stages.resume as resume
from service.pipeline import verify_program, zones_only  # noqa: F401
from toolpath.plan_checkpoint import CheckpointKeeper
from toolpath.planning.job_plan import plan_job

PROVE = loop.prove
ACTS = 3
resume.ACTS_EVERY_S = resume.ACTS_PAUSE = 0.0  # each act is kept


def plan(part_path, setup, out, progress, kept=None, **more):
    done = kept.folder.parent.parent / "done"
    done.parent.mkdir(exist_ok=True)

    def said(what):
        with done.open("a") as handle:
            handle.write(f"{what}\n")

    def die(who):
        mark = done.with_name("died")
        if who and not mark.exists():
            mark.touch()
            os.kill(os.getppid() if who == "worker" else os.getpid(), signal.SIGKILL)
            signal.pause()

    class Watched(CheckpointKeeper):
        def __init__(self, keeper):
            self.taken, self.keep, self.acts = keeper.taken, keeper.done, 0

        def done(self, now):
            self.keep(now)
            self.acts += 1
            if self.acts == ACTS and setup.labels["kill"] == "child in a plan":
                die("child")

    def planner(*args, keeper, **given):
        watched = Watched(keeper)
        made = plan_job(*args, keeper=watched, **given)
        said(f"planned:{watched.acts}" if setup.labels["kill"] == "child in a plan" else "planned")
        return made

    def prove(*args, **given):
        die({"worker": "worker", "child": "child"}.get(setup.labels["kill"]))
        proof = PROVE(*args, **given)
        said("proved")
        return proof

    loop.prove = prove
    return chain.plan(part_path, setup, out, progress, planner=planner, kept=kept, **more)
