"""Tools, machines and materials to which setups refer. Each write is a new version; versions are never overwritten.

An entry belongs to a principal, or to all of them (shared, written by admins only). A name means the principal's own
entry where there is one, else the shared one. ``lib:NAME`` is the newest version, ``lib:NAME@3`` the third. A deleted
name cannot be used any more. Written again, it continues its numbers, so that ``@3`` never means two things.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine, RowMapping
from sqlalchemy.exc import IntegrityError

from schemas.base import split_reference
from service.errors import NotFoundError
from service.jobs.database import entries

SHELVES = ("tools", "machines", "materials")
SHARED = ""


@dataclass(frozen=True)
class Entry:
    """One version of an entry. value : plain JSON data, validated when it was written."""

    shelf: str
    name: str
    version: int
    shared: bool
    created: float
    value: Any


class LibraryStore:
    """The table of entries."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine

    def all(self, principal: str, shelf: str) -> list[Entry]:
        """The newest version of every entry that a principal can use, by name."""
        query = (sa.select(entries).where(_seen_by(principal), entries.c.shelf == shelf, entries.c.deleted.is_(None))
                 .order_by(entries.c.name, entries.c.owner, entries.c.version))
        with self.engine.connect() as c:
            # Shared entries come first, and old ones before new ones, so the last entry of a name is valid.
            return list({row["name"]: _entry(row) for row in c.execute(query).mappings()}.values())

    def get(self, principal: str, shelf: str, name: str, version: int | None = None) -> Entry:
        """One entry, in its newest version unless a version is given.

        Raises
        ------
        NotFoundError
            There is no such name or version.
        """
        query = (sa.select(entries).where(_seen_by(principal), entries.c.shelf == shelf, entries.c.name == name,
                                          entries.c.deleted.is_(None))
                 .order_by(entries.c.owner.desc(), entries.c.version.desc()))
        with self.engine.connect() as c:
            rows = list(c.execute(query).mappings())
        rows = [r for r in rows if r["owner"] == rows[0]["owner"]]
        for row in rows:
            if version in (None, row["version"]):
                return _entry(row)
        what = f"no entry '{name}'" if not rows else f"no version {version} of '{name}'"
        raise NotFoundError(f"the library of {shelf} has {what}", code="no_such_entry", subjects=(name,),
                            measured=version, limit=[r["version"] for r in rows] or None,
                            remedy=f"GET /v1/{shelf} lists the entries")

    def put(self, owner: str, shelf: str, name: str, value: Any) -> tuple[Entry, bool]:
        """Write an entry as the next version, unless it equals the newest. Returns it and whether the name is new."""
        text = json.dumps(value, sort_keys=True)
        at = sa.and_(entries.c.owner == owner, entries.c.shelf == shelf, entries.c.name == name)
        while True:
            with self.engine.connect() as c:
                newest = c.execute(sa.select(entries).where(at).order_by(entries.c.version.desc()).limit(1)
                                   ).mappings().one_or_none()
            live = newest is not None and newest["deleted"] is None
            if newest is not None and live and newest["entry_json"] == text:
                return _entry(newest), False
            row = {"owner": owner, "shelf": shelf, "name": name, "version": newest["version"] + 1 if newest else 1,
                   "entry_json": text, "created": time.time()}
            try:
                with self.engine.begin() as c:
                    made = c.execute(entries.insert().values(row).returning(entries)).mappings().one()
                return _entry(made), not live
            except IntegrityError:
                continue  # another request wrote that version meanwhile

    def put_all(self, owner: str, shelf: str, values: Mapping[str, Any]) -> dict[str, Entry]:
        """Write several entries in one transaction, each as ``put`` does.

        values : the entries by name

        Returns the entries as they now are, by name.
        """
        texts = {name: json.dumps(value, sort_keys=True) for name, value in values.items()}
        of_shelf = sa.and_(entries.c.owner == owner, entries.c.shelf == shelf)
        while True:
            with self.engine.connect() as c:
                rows = c.execute(sa.select(entries).where(of_shelf).order_by(entries.c.version)).mappings()
                newest = {row["name"]: row for row in rows if row["name"] in texts}
            same = {n: row for n, row in newest.items() if row["deleted"] is None and row["entry_json"] == texts[n]}
            fresh: list[dict[str, Any]] = [
                {"owner": owner, "shelf": shelf, "name": n, "entry_json": text, "created": time.time(),
                 "version": newest[n]["version"] + 1 if n in newest else 1}
                for n, text in texts.items() if n not in same]
            try:
                with self.engine.begin() as c:
                    if fresh:
                        c.execute(entries.insert(), fresh)
            except IntegrityError:
                continue  # another request wrote one of the versions meanwhile
            written = {r["name"]: Entry(shelf, r["name"], r["version"], owner == SHARED, r["created"],
                                        values[r["name"]]) for r in fresh}
            return {n: written[n] if n in written else _entry(same[n]) for n in texts}

    def delete(self, owner: str, shelf: str, name: str) -> None:
        """Delete a name from the library; jobs keep the versions that they used.

        Raises
        ------
        NotFoundError
            This owner has no entry with that name.
        """
        change = entries.update().where(entries.c.owner == owner, entries.c.shelf == shelf, entries.c.name == name,
                                        entries.c.deleted.is_(None)).values(deleted=time.time())
        with self.engine.begin() as c:
            if not c.execute(change).rowcount:
                raise NotFoundError(f"the library of {shelf} has no entry '{name}' of this owner", subjects=(name,),
                                    code="no_such_entry", remedy=f"GET /v1/{shelf} lists the entries")

    def view(self, principal: str) -> LibraryView:
        """The library as a setup of this principal sees it."""
        return LibraryView(self, principal)


class LibraryView(Mapping[str, Mapping[str, Any]]):
    """The library by shelf and by the text after ``lib:``; ``used`` collects the entries that were read."""

    def __init__(self, store: LibraryStore, principal: str) -> None:
        self.used: dict[tuple[str, str, int], Entry] = {}
        self._shelves = {shelf: _Shelf(store, principal, shelf, self.used) for shelf in SHELVES}

    def __getitem__(self, shelf: str) -> Mapping[str, Any]:
        return self._shelves[shelf]

    def __iter__(self) -> Iterator[str]:
        return iter(self._shelves)

    def __len__(self) -> int:
        return len(self._shelves)

    def as_json(self) -> str | None:
        """The used entries, for the row of the job; None where there is none."""
        found = [{"shelf": e.shelf, "name": e.name, "version": e.version, "shared": e.shared}
                 for _, e in sorted(self.used.items())]
        return json.dumps(found) if found else None


class _Shelf(Mapping[str, Any]):
    """Entries of one shelf by reference; each is read on demand."""

    def __init__(self, store: LibraryStore, principal: str, shelf: str,
                 used: dict[tuple[str, str, int], Entry]) -> None:
        self.store, self.principal, self.shelf, self.used = store, principal, shelf, used

    def __getitem__(self, reference: str) -> Any:
        name, version = split_reference(reference)
        try:
            found = self.store.get(self.principal, self.shelf, name, version)
        except NotFoundError as error:
            raise KeyError(reference) from error
        self.used[found.shelf, found.name, found.version] = found
        return found.value

    def __iter__(self) -> Iterator[str]:
        return iter([e.name for e in self.store.all(self.principal, self.shelf)])

    def __len__(self) -> int:
        return len(self.store.all(self.principal, self.shelf))


def _seen_by(principal: str) -> sa.ColumnElement[bool]:
    return entries.c.owner.in_((SHARED, principal))


def _entry(row: RowMapping) -> Entry:
    return Entry(row["shelf"], row["name"], row["version"], row["owner"] == SHARED, row["created"],
                 json.loads(row["entry_json"]))
