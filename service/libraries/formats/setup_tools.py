"""Tools as this program writes them: a setup, a list of tools, or the answer of GET /v1/tools, as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from geometry.errors import LibraryError
from schemas.tools import Tool
from service.libraries.containers import json_bytes, json_of
from service.libraries.entry import Entry, Source, check_count
from service.libraries.tool_entry import tool_entry


def items_of(value: Any) -> list[Any] | None:
    """The objects of tools in a JSON value; None where it holds none."""
    if isinstance(value, dict):
        value = value.get("tools", value.get("items"))
    if not isinstance(value, list):
        return None
    return [v["entry"] if isinstance(v, dict) and isinstance(v.get("entry"), dict) else v for v in value]


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of the tools of a setup or list.

    Raises
    ------
    LibraryError
        no_tools: the value holds no list of tools; or as ``json_of``.
    """
    items = items_of(json_of(data, source.encoding))
    if items is None:
        raise LibraryError("the file holds no list of tools", code="no_tools",
                           remedy="send a setup, or a list of tools as in a setup")
    check_count(len(items))
    out = []
    for k, item in enumerate(items, start=1):
        entry = Entry(f"entry {k}", stated_kind="")
        try:
            tool = Tool.model_validate(item)
            entry = tool_entry(tool, f"entry {k}")
            entry.tool = tool
        except ValidationError as error:
            problem = error.errors(include_url=False, include_context=False, include_input=False)[0]
            at = ".".join(str(p) for p in problem["loc"])
            entry.leave_out(f"{at}: {problem['msg']}" if at else problem["msg"].removeprefix("Value error, "))
        out.append(entry)
    return out


def write(tools: Sequence[Tool]) -> bytes:
    """The tools as a setup takes them."""
    return json_bytes([t.model_dump(mode="json", exclude_defaults=True, exclude_none=True) for t in tools])


__all__ = ["items_of", "read", "write"]
