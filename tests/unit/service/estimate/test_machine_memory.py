"""The memory of a machine within its control groups, from folders like those of the system."""

import psutil

from service.estimate.machine_memory import machine_memory

WHOLE = psutil.virtual_memory().total


def group(folder, limit, used, cache, names=("memory.max", "memory.current", "inactive_file")):
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in zip(names, (limit, used), strict=False):
        (folder / name).write_text(f"{value}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{names[2]} {cache}\n")


def own(tmp_path, text):
    path = tmp_path / "own"
    path.write_text(text)
    return path


def test_a_group_of_version_2_bounds_what_there_is_and_what_is_free(tmp_path):
    group(tmp_path / "a", 3_000_000, 2_000_000, 500_000)
    found = machine_memory(tmp_path, own(tmp_path, "0::/a\n"))
    assert (found.total, found.free) == (3_000_000, 1_500_000)


def test_the_groups_above_count_too_and_max_is_no_limit(tmp_path):
    group(tmp_path / "a", 2_000_000, 1_000_000, 0)
    group(tmp_path / "a" / "b", "max", 1_000_000, 0)
    assert machine_memory(tmp_path, own(tmp_path, "0::/a/b\n")).total == 2_000_000


def test_a_container_that_sees_its_group_at_the_root_under_the_path_outside(tmp_path):
    names = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"
    group(tmp_path / "memory", 4_000_000, 1_000_000, 0, names)
    found = machine_memory(tmp_path, own(tmp_path, "5:cpu,cpuacct:/docker/x\n4:memory:/docker/x\n"))
    assert (found.total, found.free) == (4_000_000, 3_000_000)


def test_without_groups_the_machine_itself_counts(tmp_path):
    found = machine_memory(tmp_path, tmp_path / "nothing")
    assert found.total == WHOLE and 0 < found.free <= WHOLE
    group(tmp_path, 2**63 - 4096, 1, 0)
    assert machine_memory(tmp_path, own(tmp_path, "0::/\n")).total == WHOLE
