"""Library entries: owners, versions, and what a reference means."""

import threading

import pytest

from schemas.base import split_reference
from service.errors import NotFoundError
from service.jobs.database import connect, migrate
from service.jobs.library import SHARED, LibraryStore


@pytest.fixture
def library(tmp_path):
    url = f"sqlite:///{tmp_path / 'jobs.db'}"
    migrate(url)
    return LibraryStore(connect(url))


def test_each_write_that_changes_something_is_a_version(library):
    first, new = library.put("ada", "tools", "a", {"x": 1})
    assert new and (first.version, first.shared, first.value) == (1, False, {"x": 1})
    assert library.put("ada", "tools", "a", {"x": 1}) == (first, False)
    second, new = library.put("ada", "tools", "a", {"x": 2})
    assert not new and second.version == 2
    assert library.get("ada", "tools", "a") == second and library.get("ada", "tools", "a", 1) == first
    assert library.all("ada", "tools") == [second] and library.all("ada", "machines") == []
    for version in (0, 3):
        with pytest.raises(NotFoundError, match="no version") as caught:
            library.get("ada", "tools", "a", version)
        assert caught.value.limit == [2, 1]


def test_a_name_is_ones_own_before_the_shared_one_and_never_anothers(library):
    library.put(SHARED, "tools", "a", {"of": "all"})
    library.put(SHARED, "tools", "b", {"of": "all"})
    library.put("ada", "tools", "a", {"of": "ada"})
    library.put("bob", "tools", "c", {"of": "bob"})
    assert {e.name: e.value["of"] for e in library.all("ada", "tools")} == {"a": "ada", "b": "all"}
    assert {e.name: e.value["of"] for e in library.all("bob", "tools")} == {"a": "all", "b": "all", "c": "bob"}
    with pytest.raises(NotFoundError):
        library.get("ada", "tools", "c")
    with pytest.raises(NotFoundError):
        library.delete("bob", "tools", "a")  # the shared one is not his
    library.delete("ada", "tools", "a")
    assert library.get("ada", "tools", "a").shared


def test_a_deleted_name_goes_on_counting_when_it_is_written_again(library):
    for x in (1, 2):
        library.put("ada", "tools", "a", {"x": x})
    library.delete("ada", "tools", "a")
    with pytest.raises(NotFoundError):
        library.get("ada", "tools", "a", 1)
    with pytest.raises(NotFoundError):
        library.delete("ada", "tools", "a")
    again, new = library.put("ada", "tools", "a", {"x": 2})
    assert new and again.version == 3
    with pytest.raises(NotFoundError):
        library.get("ada", "tools", "a", 2)


def test_writers_at_the_same_time_get_a_version_each(library):
    got = []

    def write(k):
        got.append(library.put("ada", "tools", "a", {"x": k})[0].version)

    threads = [threading.Thread(target=write, args=(k,)) for k in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert sorted(got) == list(range(1, 9))


def test_a_view_reads_what_is_asked_for_and_remembers_it(library):
    for x in (1, 2):
        library.put("ada", "tools", "a", {"x": x})
    library.put(SHARED, "machines", "m", {"y": 1})
    view = library.view("ada")
    assert view.as_json() is None and list(view) == ["tools", "machines", "materials"] and len(view) == 3
    assert view["tools"]["a"] == {"x": 2} and view["tools"]["a@1"] == {"x": 1} and view["machines"]["m@1"] == {"y": 1}
    assert "a@3" not in view["tools"] and "m" not in view["tools"] and "a@01" not in view["tools"]
    assert list(view["tools"]) == ["a"] and len(view["tools"]) == 1 and "nonesuch" not in view
    assert [(e.shelf, e.name, e.version) for _, e in sorted(view.used.items())] == [
        ("machines", "m", 1), ("tools", "a", 1), ("tools", "a", 2)]


@pytest.mark.parametrize(("text", "want"), [
    ("a", ("a", None)), ("a@1", ("a", 1)), ("a@999999999", ("a", 999999999)), ("a@0", ("a@0", None)),
    ("a@", ("a@", None)), ("a@-1", ("a@-1", None)), ("a@1e3", ("a@1e3", None)), ("a@²", ("a@²", None)),
    ("a@1@2", ("a@1", 2)), ("a@" + "9" * 20, ("a@" + "9" * 20, None))])
def test_references_are_taken_apart(text, want):
    assert split_reference(text) == want


def test_several_entries_at_once_are_written_as_one_by_one(library):
    first = library.put_all("ada", "tools", {"a": {"x": 1}, "b": {"x": 1}})
    assert {n: (e.version, e.shared, e.value) for n, e in first.items()} == {
        "a": (1, False, {"x": 1}), "b": (1, False, {"x": 1})}
    library.delete("ada", "tools", "b")
    again = library.put_all("ada", "tools", {"a": {"x": 1}, "b": {"x": 1}, "c": {"x": 3}})
    assert {n: e.version for n, e in again.items()} == {"a": 1, "b": 2, "c": 1}
    assert library.all("ada", "tools") == [again["a"], again["b"], again["c"]]
    assert library.put_all("ada", "tools", {}) == {}
    assert library.put_all(SHARED, "tools", {"a": {"x": 9}})["a"].shared is True
    assert library.get("bob", "tools", "a").value == {"x": 9} and library.get("ada", "tools", "a").value == {"x": 1}


def test_writers_of_the_same_names_at_once_each_get_a_version(library):
    def work(k):
        library.put_all("ada", "tools", {f"t{n}": {"by": k} for n in range(20)})

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert all(len({library.get("ada", "tools", f"t{n}", v).value["by"] for v in range(1, e.version + 1)}) == e.version
               for n, e in enumerate(library.get("ada", "tools", f"t{n}") for n in range(20)))
