"""API keys, as the HTTP interface shows them. No secret stands in them but in the answer that made one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from schemas.base import Number, ReportModel, WireModel

KeyScope = Literal["submit", "read", "admin", "metrics"]


class NewKey(WireModel):
    """A key that is wanted."""

    principal: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._@-]{0,63}$", examples=["mes"],
                                    description="Whose key it is; jobs and library entries belong to this name.")]
    scopes: Annotated[list[KeyScope], Field(
        min_length=1, max_length=4, description="submit: post and cancel jobs, write library entries; read: jobs, "
                                                "files, libraries; admin: keys and shared library entries; metrics: "
                                                "/metrics alone.")] = ["submit", "read"]
    days: Annotated[Number | None, Field(gt=0, le=36500, description="Days until it expires; null for never.")] = 365.0
    note: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$", description="What it is for.")] = ""


class Key(ReportModel):
    """A key without its secret."""

    id: Annotated[str, Field(description="Second part of the key's text.", examples=["0a1b2c3d4e5f"])]
    principal: str
    scopes: list[KeyScope]
    note: str = ""
    created_at: Annotated[str, Field(description="UTC, ISO 8601.")]
    expires_at: Annotated[str | None, Field(description="UTC, ISO 8601; null for never.")] = None
    revoked_at: Annotated[str | None, Field(description="UTC, ISO 8601; null while it is good.")] = None
    last_used_at: Annotated[str | None, Field(description="UTC, ISO 8601, to the hour; null before its first "
                                                          "use.")] = None


class MadeKey(ReportModel):
    """A new key: its text is told this once."""

    key: Annotated[str, Field(description="What goes behind Authorization: Bearer.")]
    about: Key


class KeyList(ReportModel):
    """All keys, oldest first."""

    items: list[Key]
