# The process from which jobs start. It imports nothing at the top: what it imports is what its children need not load.
"""``python -m service.jobs.fork_server FD``: a process with the planner loaded, which forks a child for each job.

It writes ``loaded`` to the socket FD once it can fork. Then each message on FD is the path of a request of
``service.jobs.job_process``, with three file descriptors: the pipe of that process, its log, and a pipe for its status.
The child writes its process number into the status, and this process the exit code, each as a line; 0 stands for a
process number where none can be forked. While nothing is asked, it loads compiled kernels. It ends when the other end
of the socket is closed, and its children with it.

It has one thread, because a forked child has only the thread that forked, and locks of the others stay locked in it.
"""

from __future__ import annotations

LOADED = b"loaded"
IMPORTED = ("service.pipeline", "service.part_reading", "service.from_wire", "service.checkpoint_store",
            "service.jobs.disk_space", "service.jobs.job_process")


def _stored_kernels():
    """Load the compiled kernels of the cache, one at each step. Kernels with threads of their own are passed over."""
    from service.commands.kernel_compiling import STALE, is_stored, kernel_of, read_list

    for listed in read_list():
        try:
            kernel, arguments = kernel_of(listed)
            if not kernel.targetoptions.get("parallel") and is_stored(kernel, arguments):
                kernel.compile(arguments)
        except STALE:
            continue
        yield


def _is_alone():
    """Whether this process has one thread."""
    import os

    return len(os.listdir("/proc/self/task")) == 1


def _run_child(path, fds, parent):
    """What a forked child does; returns its exit code.

    path   : of the request
    fds    : pipe, log and status
    parent : process number of the server
    """
    import contextlib
    import gc
    import os

    from service.jobs import job_process

    pipe, log, status = fds
    os.setsid()
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.write(status, b"%d\n" % os.getpid())
    for fd in map(int, os.listdir("/proc/self/fd")):
        if fd > 2 and fd != pipe:
            with contextlib.suppress(OSError):  # that of the list itself
                os.close(fd)
    gc.enable()
    return job_process.main(["", path, str(pipe), str(parent)])


def _fork(path, fds):
    """Process number of a new child that runs a request."""
    import gc
    import os
    import sys
    import traceback

    gc.freeze()  # so that a search for garbage in the child does not copy the memory it shares with this process
    parent = os.getpid()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        code = _run_child(path, fds, parent)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _serve(listener, kernels):
    """Fork children and report their ends until the other end of the socket is closed."""
    import os
    import selectors
    import socket

    status_of = {}
    with selectors.DefaultSelector() as selector:
        selector.register(listener, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select(0.0 if kernels is not None else None):
                if key.fd == listener.fileno():
                    path, fds, _flags, _address = socket.recv_fds(listener, 65536, 3)
                    if not path:
                        return
                    try:
                        child = _fork(path.decode(), fds)
                        handle = os.pidfd_open(child)
                    except OSError:  # no room for a process
                        _report(fds[2], 0)
                    else:
                        status_of[handle] = child, fds[2]
                        selector.register(handle, selectors.EVENT_READ)
                    for fd in fds[:2]:
                        os.close(fd)
                else:
                    selector.unregister(key.fileobj)
                    child, status = status_of.pop(key.fd)
                    _report(status, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
                    os.close(key.fd)
            if kernels is not None and next(kernels, LOADED) is LOADED:
                kernels = None


def _report(status, code):
    """Write the exit code of a child; whoever asked may be gone."""
    import contextlib
    import os

    with contextlib.suppress(BrokenPipeError):
        os.write(status, b"%d\n" % code)
    os.close(status)


def main(argv):
    """Entry point; see the module."""
    import gc
    import importlib
    import resource
    import socket
    import sys

    gc.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for module in IMPORTED:
        importlib.import_module(module)
    gc.collect()
    if not _is_alone():
        print("the process from which jobs start has several threads and ends", file=sys.stderr)
        return 1
    with socket.socket(fileno=int(argv[1])) as listener:
        listener.send(LOADED)
        _serve(listener, _stored_kernels())
    return 0


if __name__ == "__main__":
    import sys

    sys.exit(main(sys.argv))
