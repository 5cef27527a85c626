# The process in which one job is computed. It imports nothing at the top, so that it starts quickly.
"""``python -m service.jobs.job_process REQUEST.json FD PARENT``: run one job, send progress lines to the pipe FD.

PARENT is the number of the process that starts it, with which it ends.

The request is {"kind", "part", "setup", "program", "stock", "spindle_tool", "out", "kept", "chain", "room",
"address_bytes"}; "room" holds arguments of ``service.estimate.memory_room.MemoryRoom``. Lines on the pipe are JSON:
{"stage", "progress"} while it runs, {"estimate"} once the part is read, {"resumed"} when it uses a checkpoint of an
earlier attempt (``service.checkpoint_store``), then {"state"} or {"error"} once. Exit code 0 with a state, 3 with an
error.
"""


def guard(parent, address_bytes):
    """End with the parent, leave no core file, and set a soft limit on the address space."""
    import ctypes
    import os
    import resource
    import signal
    import sys

    ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        sys.exit(1)  # the parent died before the request above took effect
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    soft = address_bytes if hard == resource.RLIM_INFINITY else min(address_bytes, hard)
    # The hard limit stays, since the STEP reader, a child of this process, sets its own.
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def reporter(send, interval=0.2):
    """The ``progress(stage, fraction)`` callback: sends every change of stage, and fractions a few times a second."""
    import time

    sent_stage, sent_at, reached = "", 0.0, 0.0

    def progress(stage, fraction):
        nonlocal sent_stage, sent_at, reached
        now = time.monotonic()
        reached = max(reached, float(fraction))
        if stage == sent_stage and now - sent_at < interval:
            return
        sent_stage, sent_at = stage, now
        send({"stage": str(stage), "progress": reached})

    return progress


def compute(request, progress, resumed, estimated):
    """Run the requested pipeline, leave its files in the out folder, and return the final state.

    resumed   : called with the number of checkpoints used, by kind
    estimated : called with what the job is expected to take, as plain data
    """
    import contextlib
    import importlib
    from pathlib import Path

    from geometry.child_process import collect_rarely
    from service.estimate.memory_room import MemoryRoom
    from service.from_wire import parse_setup
    from service.part_reading import PartReading

    collect_rarely()
    part, out = Path(request["part"]), Path(request["out"])
    setup = parse_setup(request["setup"])
    more: dict[str, object] = {"blank_path": Path(request["stock"])} if request.get("stock") else {}
    room = MemoryRoom(**request.get("room", {}))

    def admit(estimate):
        estimated(estimate.as_dict())
        room.enter(estimate, progress)

    more["admit"] = admit
    with contextlib.ExitStack() as stack:
        stack.callback(room.leave)
        if request["chain"] == "service.pipeline":  # the part is read while the chain is imported
            more["reading"] = stack.enter_context(PartReading(part, setup, planned=request["kind"] == "plan"))
        return _computed(importlib.import_module(request["chain"]), request, part, setup, out, progress, resumed, more)


def _computed(chain, request, part, setup, out, progress, resumed, more):
    """Ask the chain for the result of the request; returns the final state."""
    import json
    from pathlib import Path

    from service.checkpoint_store import Kept
    from verify.gcode.program_text import cleaned, decoded

    if request["kind"] == "plan":
        kept = Kept(Path(request["kept"]), resumed)
        result, name = chain.plan(part, setup, out, progress, kept=kept, **more), "report.json"
        state = result["state"]
    elif request["kind"] == "zones":
        result, name = chain.zones_only(part, setup, progress, **more), "zones.json"
        state = "done"
    else:
        text = cleaned(decoded(Path(request["program"]).read_bytes()))
        result = chain.verify_program(part, setup, text, progress, out=out, spindle_tool=request["spindle_tool"],
                                      **more)
        name = "report.json"
        state = result["state"]
    if not (out / name).exists():
        (out / name).write_text(json.dumps(result, indent=1, sort_keys=True, allow_nan=False) + "\n")
    return state


def main(argv):
    """Entry point; see the module."""
    import json
    import os
    import traceback

    with open(argv[1], encoding="utf-8") as handle:
        request = json.load(handle)
    pipe = int(argv[2])
    guard(int(argv[3]), request["address_bytes"])
    from geometry.errors import CamError, InternalError, ResourceError
    from service.jobs.disk_space import is_full, storage_full

    def send(message):
        os.write(pipe, (json.dumps(message, default=str) + "\n").encode())

    try:
        send({"state": compute(request, reporter(send), lambda taken: send({"resumed": taken}),
                               lambda estimate: send({"estimate": estimate}))})
        return 0
    except CamError as error:
        send({"error": error.as_dict()})
    except MemoryError:
        limit = request["address_bytes"]
        send({"error": ResourceError(f"the job needed more address space than {limit / 1e9:.1f} GB",
                                     code="job_memory", limit=limit).as_dict()})
    except Exception as error:
        if is_full(error):
            send({"error": storage_full().as_dict()})
            return 3
        traceback.print_exc()
        send({"error": InternalError(f"{type(error).__name__}: {error}", code="bug",
                                     remedy="please report it with part and setup").as_dict()})
    return 3


if __name__ == "__main__":
    import sys

    sys.exit(main(sys.argv))
