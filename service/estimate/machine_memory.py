"""How much memory this machine has: in all, and free now.

A container has no more than its control groups allow, whatever the machine around it has. The limits of all groups
from its own up to the root count, of version 2 and of version 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

GROUPS = Path("/sys/fs/cgroup")
OWN_GROUPS = Path("/proc/self/cgroup")
# file of the limit, of the use, and of the inactive file cache within that use, by version of the control groups
V2 = "memory.max", "memory.current", "inactive_file"
V1 = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"


@dataclass(frozen=True)
class MachineMemory:
    """Memory, bytes.

    total : what processes can have in all
    free  : what they can still have now; pages of files that can be dropped are free
    """

    total: int
    free: int


def machine_memory(groups: Path = GROUPS, own: Path = OWN_GROUPS) -> MachineMemory:
    """The memory of this machine, within the limits of its control groups.

    groups, own : where the control groups are mounted, and the list of those of this process
    """
    known = psutil.virtual_memory()
    total, free = int(known.total), int(known.available)
    for folder, names in _groups(groups, own):
        limit, used, dropped = (_number(folder / names[0]), _number(folder / names[1]), _cache(folder, names[2]))
        if limit is None:
            continue
        total = min(total, limit)
        if used is not None:
            free = min(free, max(limit - used + dropped, 0))
    return MachineMemory(total, free)


def _groups(mounted: Path, own: Path) -> Iterator[tuple[Path, tuple[str, str, str]]]:
    """Folders of the memory groups of this process and of those above them, with the names of their files."""
    try:
        lines = own.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            root, names = mounted, V2
        elif "memory" in controllers.split(","):
            root, names = mounted / "memory", V1
        else:
            continue
        # a container sees its own group at the root, under the path that it has outside
        folder = root / path.lstrip("/")
        while folder != root:
            yield folder, names
            folder = folder.parent
        yield root, names


def _number(path: Path) -> int | None:
    """The number in a file; None where there is none, as in a group without a limit."""
    try:
        text = path.read_text().strip()
    except OSError:
        return None
    return int(text) if text.isdecimal() else None


def _cache(folder: Path, name: str) -> int:
    """Bytes of files in memory that a group can drop."""
    try:
        lines = (folder / "memory.stat").read_text().splitlines()
    except OSError:
        return 0
    return next((int(value) for key, _, value in (line.partition(" ") for line in lines) if key == name), 0)


__all__ = ["MachineMemory", "machine_memory"]
