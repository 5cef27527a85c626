"""How test runs are cut into shares, and what they say of skipped tests."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tests.long_tests import LIST, long_tests, pytest_itemcollected
from tests.shards import pytest_collection_modifyitems, pytest_runtest_setup, shard_of, turned
from tests.skips import remedies


def item(module: str, slow: bool) -> SimpleNamespace:
    """A test as the hook sees it."""
    return SimpleNamespace(nodeid=f"{module}::test_x", get_closest_marker=lambda name: slow or None)


def test_every_slow_module_is_in_one_share_and_everyday_tests_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    config = SimpleNamespace(hook=SimpleNamespace(pytest_deselected=lambda items: None))
    names = [f"tests/e2e/test_{k}.py" for k in range(40)]
    seen: list[str] = []
    for k in range(4):
        items = [item(n, True) for n in names] + [item("tests/unit/test_quick.py", False)]
        monkeypatch.setenv("ZONEMILL_SHARD", f"{k}/4")
        pytest_collection_modifyitems(config, items)  # type: ignore[arg-type]
        assert items[-1].nodeid.startswith("tests/unit/test_quick")
        seen += [i.nodeid for i in items[:-1]]
    assert sorted(seen) == sorted(f"{n}::test_x" for n in names)
    assert {shard_of(n, 4) for n in names} == {0, 1, 2, 3}


def test_the_order_of_a_share_goes_round() -> None:
    assert [turned(["a", "b", "c"], k)[0] for k in range(4)] == ["a", "b", "c", "a"] and turned([], 5) == []


def test_a_slow_test_that_would_begin_too_late_is_skipped_and_an_everyday_one_is_not(monkeypatch) -> None:
    monkeypatch.setenv("ZONEMILL_SECONDS", "0")
    with pytest.raises(pytest.skip.Exception, match="time of this share"):
        pytest_runtest_setup(item("tests/e2e/test_a.py", True))  # type: ignore[arg-type]
    pytest_runtest_setup(item("tests/e2e/test_a.py", False))  # type: ignore[arg-type]
    monkeypatch.setenv("ZONEMILL_SECONDS", "1e9")
    pytest_runtest_setup(item("tests/e2e/test_a.py", True))  # type: ignore[arg-type]


def test_skips_for_want_of_programs_name_the_commands_once() -> None:
    reasons = ["rs274 is not installed", "needs Chromium", "no module opencamlib", "no rs274", "other"]
    assert remedies(reasons) == (4, ["apt-get install chromium", "apt-get install linuxcnc-uspace", "make peers"])


def test_a_test_of_the_list_is_marked_slow_and_no_other() -> None:
    marked: list[str] = []
    for name in (min(long_tests()), "tests/unit/house/test_runs.py::test_x"):
        pytest_itemcollected(SimpleNamespace(nodeid=name, add_marker=lambda mark: marked.append(mark.name)))  # type: ignore[arg-type]
    assert marked == ["slow"]


def test_the_list_of_long_tests_names_tests_that_are_there() -> None:
    root = LIST.parents[1]
    assert LIST.read_text(encoding="utf-8").splitlines() == sorted(long_tests())
    for name in long_tests():
        module, test = name.split("[")[0].split("::")
        assert f"def {test}(" in (root / module).read_text(encoding="utf-8"), name
