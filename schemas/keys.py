"""API keys in the HTTP interface. A secret appears only in the answer that creates its key."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from schemas.base import Number, ReportModel, WireModel

KeyScope = Literal["submit", "read", "admin", "metrics"]


class NewKey(WireModel):
    """Request for a new key."""

    principal: Annotated[str, Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._@-]{0,63}$",
        description="Principal: the owner of the key. Jobs and library entries belong to the "
                    "principal.", examples=["mes"])]
    scopes: Annotated[list[KeyScope], Field(
        min_length=1, max_length=4, description="submit: post and cancel jobs, write library entries. read: read jobs, "
                                                "files and libraries. admin: manage keys and shared library entries, "
                                                "read /metrics. metrics: read /metrics only.")] = ["submit", "read"]
    days: Annotated[Number | None, Field(gt=0, le=36500, description="Days until the key "
                                                                     "expires; null: never.")] = 365.0
    note: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$", description="Purpose of the key.")] = ""


class Key(ReportModel):
    """A key without its secret."""

    id: Annotated[str, Field(description="The part of the key between zm_ and the secret.", examples=["0a1b2c3d4e5f"])]
    principal: str
    scopes: list[KeyScope]
    note: str = ""
    created_at: Annotated[str, Field(description="UTC, ISO 8601.")]
    expires_at: Annotated[str | None, Field(description="UTC, ISO 8601; null: never.")] = None
    revoked_at: Annotated[str | None, Field(description="UTC, ISO 8601; null while the key is valid.")] = None
    last_used_at: Annotated[str | None, Field(description="UTC, ISO 8601, rounded to the hour; null before the first "
                                                          "use.")] = None


class MadeKey(ReportModel):
    """A new key with its secret text. No later answer shows this text."""

    key: Annotated[str, Field(description="The key. Send it in the header Authorization: Bearer KEY.")]
    about: Key


class KeyList(ReportModel):
    """All keys, oldest first."""

    items: list[Key]
