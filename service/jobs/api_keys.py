"""API keys, which identify the sender of a request.

A key is ``zm_<id>_<secret>``. The id names the row. The secret is 256 random bits, and the row has only its SHA-256: a
random secret needs no slow hash, and a copy of the database opens nothing. Rows are never deleted, so the service does
not become open when the last key is revoked.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Iterable
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy.engine import Engine, RowMapping

from service.errors import NotFoundError, RequestError, UnauthorizedError
from service.jobs.database import api_keys

SUBMIT, READ, ADMIN, METRICS = "submit", "read", "admin", "metrics"
SCOPES = (SUBMIT, READ, ADMIN, METRICS)
PRINCIPAL_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._@-]{0,63}$"
SEEN_EVERY_S = 3600.0
_KEY = re.compile(r"zm_([0-9a-f]{12})_([A-Za-z0-9_-]{43})")
_NOBODY = hashlib.sha256(b"").hexdigest()


@dataclass(frozen=True)
class Identity:
    """Owner of a request, and the allowed scopes. key_id : None where no key is required."""

    principal: str
    scopes: frozenset[str]
    key_id: str | None = None


def digest(secret: str) -> str:
    """SHA-256 of a secret, hex, as stored in the database."""
    return hashlib.sha256(secret.encode()).hexdigest()


class KeyStore:
    """The table of keys."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._exist = False

    def any(self) -> bool:
        """Whether a key was ever made; revoked and expired keys count."""
        if not self._exist:
            with self.engine.connect() as c:
                self._exist = c.execute(sa.select(api_keys.c.id).limit(1)).first() is not None
        return self._exist

    def usable(self) -> bool:
        """Whether some key is valid now."""
        with self.engine.connect() as c:
            return c.execute(sa.select(api_keys.c.id).where(_live(time.time())).limit(1)).first() is not None

    def make(self, principal: str, scopes: Iterable[str], days: float | None = None,
             note: str = "") -> tuple[str, RowMapping]:
        """Make a key; returns its text, which is not stored, and its row.

        days : days until it expires; None: never

        Raises
        ------
        RequestError
            ``bad_principal``, ``bad_scope``, ``bad_expiry``.
        """
        wanted = sorted(set(scopes), key=lambda s: SCOPES.index(s) if s in SCOPES else -1)
        if not re.fullmatch(PRINCIPAL_PATTERN, principal):
            raise RequestError("the name of a principal has 1 to 64 letters, digits, '.', '_', '@' and '-'",
                               code="bad_principal", measured=ascii(principal[:80]), limit=PRINCIPAL_PATTERN,
                               remedy="use a short name such as mes or ada@shop")
        if not wanted or any(s not in SCOPES for s in wanted):
            raise RequestError("a key has one or more of the scopes submit, read, admin, metrics", code="bad_scope",
                               measured=wanted, limit=list(SCOPES), remedy="for an MES use --scopes submit,read")
        if days is not None and not 0 < days <= 36500:
            raise RequestError("a key expires after more than 0 and at most 36500 days", code="bad_expiry",
                               measured=days, limit=36500, remedy="give a number of days, or 0 for no end")
        now, secret = time.time(), secrets.token_urlsafe(32)
        values = {"id": secrets.token_hex(6), "principal": principal, "scopes": ",".join(wanted),
                  "secret_sha256": digest(secret), "note": note[:200], "created": now,
                  "expires": None if days is None else now + days * 86400}
        with self.engine.begin() as c:
            row = c.execute(api_keys.insert().values(values).returning(api_keys)).mappings().one()
        return f"zm_{row['id']}_{secret}", row

    def all(self) -> list[RowMapping]:
        """Every key, oldest first."""
        with self.engine.connect() as c:
            return list(c.execute(sa.select(api_keys).order_by(api_keys.c.created, api_keys.c.id)).mappings())

    def revoke(self, key_id: str) -> None:
        """End a key now; a key that is already revoked stays so.

        Raises
        ------
        NotFoundError
            There is no key with that id.
        """
        change = api_keys.update().where(api_keys.c.id == key_id).values(
            revoked=sa.func.coalesce(api_keys.c.revoked, time.time()))
        with self.engine.begin() as c:
            if c.execute(change).rowcount != 1:
                raise NotFoundError(f"unknown key {ascii(key_id)}", code="no_such_key", subjects=(key_id,),
                                    remedy="zonemill keys list shows the ids")

    def is_live(self, key_id: str) -> bool:
        """Whether a key is still valid."""
        query = sa.select(api_keys.c.id).where(api_keys.c.id == key_id, _live(time.time()))
        with self.engine.connect() as c:
            return c.execute(query).first() is not None

    def identify(self, text: str) -> Identity:
        """Identity of a key.

        Raises
        ------
        UnauthorizedError
            ``unauthorized``: not a key of this service. ``key_revoked``, ``key_expired``: only with the right secret.
        """
        found = _KEY.fullmatch(text)
        key_id, secret = found.groups() if found else ("", "")
        with self.engine.connect() as c:
            row = c.execute(sa.select(api_keys).where(api_keys.c.id == key_id)).mappings().one_or_none()
        # Compare a digest in any case, so that the response time does not reveal which ids exist.
        same = hmac.compare_digest(row["secret_sha256"] if row else _NOBODY, digest(secret))
        if row is None or not same:
            raise UnauthorizedError("the bearer token is not a key of this service",
                                    remedy="send Authorization: Bearer with a key from zonemill keys create")
        now = time.time()
        if row["revoked"] is not None:
            raise UnauthorizedError(f"the key {key_id} was revoked", code="key_revoked", subjects=(key_id,),
                                    remedy="ask the operator of the service for a new key")
        if row["expires"] is not None and row["expires"] <= now:
            raise UnauthorizedError(f"the key {key_id} has expired", code="key_expired", subjects=(key_id,),
                                    remedy="ask the operator of the service for a new key")
        self._seen(row, now)
        return Identity(row["principal"], frozenset(row["scopes"].split(",")), key_id)

    def _seen(self, row: RowMapping, now: float) -> None:
        """Record the use of a key, at most once an hour, so that most reads need no write."""
        if row["last_used"] is not None and now - row["last_used"] < SEEN_EVERY_S:
            return
        with self.engine.begin() as c:
            c.execute(api_keys.update().where(api_keys.c.id == row["id"]).values(last_used=now))


def _live(now: float) -> sa.ColumnElement[bool]:
    return sa.and_(api_keys.c.revoked.is_(None), sa.or_(api_keys.c.expires.is_(None), api_keys.c.expires > now))
