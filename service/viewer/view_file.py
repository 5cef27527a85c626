"""view.bin: one immutable file with the data that a page needs to show a job, in the order in which it needs them.

    8 bytes    ZMVIEW1 and a line break
    4 bytes    length of the head, little endian
    head       JSON, deflated (zlib): facts, and under 'chunks' the list of what follows
    chunks     deflated, one behind the other; 'at' and 'size' count bytes from the end of the head

A chunk is a table of whole numbers, column after column. A column of n rows and k values of w bytes is stored as k * w
planes of n bytes, value by value, the lowest byte first; equal high bytes deflate to nothing. A column of the form
'steps' stores each row as its difference from the row before, the first from 0. The forms 'steps' and 'signed' store
0, -1, 1, -2 as 0, 1, 2, 3. The page reads the file in web/src/shared/view-file.ts.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InternalError

MAGIC = b"ZMVIEW1\n"
LEVEL = 6  # of zlib
I64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a chunk.

    values : (n,) or (n, k) whole numbers
    width  : bytes of each as stored, 1 to 4
    form   : 'plain' (not negative), 'signed', or 'steps' (differences from row to row)
    """

    values: NDArray[Any]
    width: int
    form: str = "plain"

    def rows(self) -> I64:
        """The values as a table, (n, k) int64, count of the unit of the column."""
        values = np.asarray(self.values, dtype=np.int64)
        return values[:, None] if values.ndim == 1 else values

    def planes(self, name: str) -> bytes:
        """The bytes as stored.

        Raises
        ------
        InternalError
            Code 'view_width': a value does not fit its width.
        """
        rows = self.rows()
        if self.form == "steps":
            rows = np.diff(rows, axis=0, prepend=np.zeros((1, rows.shape[1]), np.int64))
        if self.form != "plain":
            rows = np.where(rows < 0, -2 * rows - 1, 2 * rows)
        if len(rows) and (rows.min() < 0 or rows.max() >= 1 << 8 * self.width):
            raise InternalError(f"column '{name}' of the view does not fit {self.width} bytes", code="view_width",
                                subjects=(name,), measured=int(rows.max()), limit=1 << 8 * self.width)
        bytes_ = np.ascontiguousarray(rows.T).astype("<u4").view(np.uint8).reshape(rows.shape[1], len(rows), 4)
        return np.ascontiguousarray(bytes_[:, :, :self.width].transpose(0, 2, 1)).tobytes()


@dataclass(frozen=True, eq=False)
class Chunk:
    """A table with its description.

    kind    : 'mesh', 'edges', 'path' or 'field'
    about   : further keys of its entry in the head, for example {'label': 3, 'lod': 0}
    columns : by name, in the order of the file
    """

    kind: str
    about: Mapping[str, Any]
    columns: Mapping[str, Column]

    def packed(self) -> bytes:
        """The bytes in the file."""
        return zlib.compress(b"".join(c.planes(name) for name, c in self.columns.items()), LEVEL)

    def listed(self, at: int, size: int) -> dict[str, Any]:
        """Its entry in the head."""
        columns = []
        for name, c in self.columns.items():
            n, k = c.rows().shape
            columns.append([name, n, k, c.width, c.form])
        return {"kind": self.kind, **self.about, "at": at, "size": size, "columns": columns}


def write_view(head: Mapping[str, Any], chunks: Sequence[Chunk]) -> bytes:
    """The bytes of a view file.

    head   : plain data without the key 'chunks'
    chunks : in the order in which the page needs them

    Raises
    ------
    InternalError
        Code 'view_width': a value does not fit its column.
    """
    parts: list[bytes] = []
    listed: list[dict[str, Any]] = []
    at = 0
    for chunk in chunks:
        data = chunk.packed()
        listed.append(chunk.listed(at, len(data)))
        parts.append(data)
        at += len(data)
    text = json.dumps({**head, "chunks": listed}, sort_keys=True, ensure_ascii=False, allow_nan=False,
                      separators=(",", ":"))
    first = zlib.compress(text.encode(), LEVEL)
    return b"".join([MAGIC, struct.pack("<I", len(first)), first, *parts])


def read_view(data: bytes) -> tuple[dict[str, Any], list[dict[str, I64]]]:
    """Head and chunks of a view file; each chunk holds its columns by name, (n, k) int64, count of the unit of each.

    Raises
    ------
    ValueError
        The bytes are no view file, or the file is cut off.
    """
    if data[:8] != MAGIC or len(data) < 12:
        raise ValueError("no view file")
    start = 12 + struct.unpack("<I", data[8:12])[0]
    head = json.loads(zlib.decompress(data[12:start]))
    out = []
    for chunk in head["chunks"]:
        at = start + chunk["at"]
        if at + chunk["size"] > len(data):
            raise ValueError("the view file is cut off")
        out.append(_columns(zlib.decompress(data[at:at + chunk["size"]]), chunk["columns"]))
    return head, out


def _columns(raw: bytes, listed: Sequence[Sequence[Any]]) -> dict[str, I64]:
    out: dict[str, I64] = {}
    at = 0
    for name, n, k, width, form in listed:
        planes = np.frombuffer(raw, np.uint8, n * k * width, at).reshape(k, width, n).astype(np.int64)
        at += n * k * width
        rows = np.sum(planes << 8 * np.arange(width)[:, None], axis=1).T
        if form != "plain":
            rows = np.where(rows & 1, -(rows + 1) // 2, rows // 2)
        out[name] = np.cumsum(rows, axis=0) if form == "steps" else rows
    return out


__all__ = ["MAGIC", "Chunk", "Column", "read_view", "write_view"]
