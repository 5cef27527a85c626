"""Range requests (RFC 9110, 14): checks before the framework sends parts of a file.

The framework answers in plain text to a range that it cannot read or satisfy, so this module handles both. A range that
cannot be read is ignored; a range that cannot be satisfied gives a problem document with 416.
"""

from __future__ import annotations

import re

from fastapi import Request

from service.errors import RangeError

MAX_RANGES = 16
_RANGES = re.compile(r"bytes=\s*(?:\d{1,18}-\d{0,18}|-\d{1,18})(?:\s*,\s*(?:\d{1,18}-\d{0,18}|-\d{1,18}))*\s*",
                     re.ASCII | re.IGNORECASE)
_ONE = re.compile(r"(\d*)-(\d*)", re.ASCII)


def check_range(request: Request, size: int, etag: str) -> None:
    """Check the Range of a request [RFC9110] and remove what must be ignored.

    size : of the file, bytes;  etag : as it will be sent

    Raises
    ------
    RangeError
        The range contains no byte of the file.
    """
    text = request.headers.get("range")
    if text is None:
        return
    condition = request.headers.get("if-range")
    parts = _ONE.findall(text) if _RANGES.fullmatch(text) else []
    backwards = any(a and b and int(b) < int(a) for a, b in parts)
    if not parts or backwards or len(parts) > MAX_RANGES or (condition is not None and condition != etag):
        request.scope["headers"] = [(k, v) for k, v in request.scope["headers"] if k not in (b"range", b"if-range")]
        return
    there = [(a, b) for a, b in parts if (int(a) < size if a else int(b) > 0 and size > 0)]
    if not there:
        raise RangeError(f"the file has {size} bytes, and the range begins after them", measured=text[:200], limit=size,
                         remedy="request existing bytes, or leave out the Range header")
    if len(there) < len(parts):  # send the ranges that exist (RFC 9110, 14.1.2); the framework would send none
        kept = b"bytes=" + b",".join(f"{a}-{b}".encode() for a, b in there)
        request.scope["headers"] = [(k, kept if k == b"range" else v) for k, v in request.scope["headers"]]
