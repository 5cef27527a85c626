"""What an attempt keeps for the next one: whole or not at all."""

from __future__ import annotations

import os

import pytest

from service.checkpoint_store import Kept

NAME = "a" * 64


@pytest.fixture
def kept(tmp_path):
    return Kept(tmp_path / "ab" / NAME)


def test_what_was_put_is_there_for_the_next_one(kept):
    assert kept.get("plan", NAME) is None
    assert kept.put("plan", NAME, b"some bytes") and kept.put("proof", NAME, b"")
    again = Kept(kept.folder)
    assert again.get("plan", NAME) == b"some bytes" and again.get("proof", NAME) == b""
    assert again.get("plan", "b" * 64) is None
    assert sorted(p.name for p in kept.folder.iterdir()) == [f"plan-{NAME}", f"proof-{NAME}"]


def test_nothing_is_kept_without_a_folder():
    kept = Kept()
    assert not kept and not kept.put("plan", NAME, b"x") and kept.get("plan", NAME) is None
    kept.drop("plan", NAME)


@pytest.mark.parametrize("harm", [
    lambda data: data[:-1], lambda data: data[:20], lambda data: b"", lambda data: data + b"x",
    lambda data: data[:40] + bytes([data[40] ^ 1]) + data[41:], lambda data: bytes([data[0] ^ 1]) + data[1:],
    lambda data: bytes(len(data))],
    ids=["cut", "cut in the digest", "empty", "longer", "a bit", "a bit of the digest", "zeros"])
def test_what_is_torn_or_changed_is_thrown_away(kept, harm):
    kept.put("plan", NAME, b"some bytes of a plan")
    path = kept.folder / f"plan-{NAME}"
    path.write_bytes(harm(path.read_bytes()))
    assert kept.get("plan", NAME) is None and not path.exists()
    assert kept.put("plan", NAME, b"anew") and kept.get("plan", NAME) == b"anew"


def test_a_write_that_was_cut_off_is_not_seen(kept, monkeypatch):
    def crash(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", crash)
    with pytest.raises(KeyboardInterrupt):
        kept.put("plan", NAME, b"some bytes")
    assert kept.get("plan", NAME) is None and len(list(kept.folder.glob("*.part"))) == 1


def test_a_full_disk_is_no_reason_to_stop(kept, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert not kept.put("plan", NAME, b"x" * 1000)
    assert kept.get("plan", NAME) is None and not list(kept.folder.iterdir())


def test_a_folder_that_cannot_be_made_is_no_reason_to_stop(tmp_path):
    (tmp_path / "file").write_text("")
    kept = Kept(tmp_path / "file" / NAME)
    assert not kept.put("plan", NAME, b"x") and kept.get("plan", NAME) is None
    kept.drop("plan", NAME)


def test_what_was_taken_over_is_told_as_it_adds_up(tmp_path):
    told = []
    kept = Kept(tmp_path, told.append)
    for kind in ("plan", "plan", "proof"):
        kept.took(kind)
    assert told == [{"plan": 1}, {"plan": 2}, {"plan": 2, "proof": 1}]
