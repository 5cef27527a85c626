"""The real chain, but what the setup's label "kill" names dies once, of SIGKILL, when a job has been planned.

"worker": the process that runs the child, which is the service itself where it is embedded; "child": the child. Every
plan and every proof leaves a line in the file "done" beside the folders of what is kept.
"""

import os
import signal

import service.chain as chain
from service.chain import verify_program, zones_only  # noqa: F401
from toolpath.plan import plan_job

PROVE = chain.prove


def plan(part_path, setup, out, progress, kept=None, **more):
    done = kept.folder.parent.parent / "done"
    done.parent.mkdir(exist_ok=True)

    def said(what):
        with done.open("a") as handle:
            handle.write(f"{what}\n")

    def planner(*args, **given):
        made = plan_job(*args, **given)
        said("planned")
        return made

    def prove(*args, **given):
        mark = done.with_name("died")
        if setup.labels["kill"] != "nobody" and not mark.exists():
            mark.touch()
            os.kill(os.getppid() if setup.labels["kill"] == "worker" else os.getpid(), signal.SIGKILL)
            signal.pause()
        proof = PROVE(*args, **given)
        said("proved")
        return proof

    chain.prove = prove
    return chain.plan(part_path, setup, out, progress, planner=planner, kept=kept, **more)
