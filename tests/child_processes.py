"""Processes that a test has started: those of other tests, such as a database, may run in the same worker."""

import psutil


def running():
    """The processes that run under this one now, a set."""
    return set(psutil.Process().children(recursive=True))


def started_since(before):
    """Processes under this one that are none of ``before`` and come from none of them, a list."""
    return [p for p in running() - before if not _of(p, before)]


def _of(process, before):
    try:
        return not before.isdisjoint(process.parents())
    except psutil.NoSuchProcess:
        return True
