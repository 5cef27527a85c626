"""The text of a program file as shops store it: encodings, line ends, tape codes."""

from __future__ import annotations

import codecs
import re

_TAPE = "\x00\x11\x12\x13\x14\x1a\x7f"
_LINE_END = re.compile(r"\r*\n|\r+\Z")
_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


def decoded(data: bytes) -> str:
    """The text of a file in UTF-8 or UTF-16 with a byte order mark, in UTF-8, or else in Windows-1252 or Latin-1.

    >>> decoded(b"(Fr\\xe4ser)"), decoded("(Fräser)".encode()), decoded(b"\\xef\\xbb\\xbfG0")
    ('(Fräser)', '(Fräser)', 'G0')
    """
    for mark, name in _BOMS:
        if data.startswith(mark):
            return data[len(mark):].decode(name, errors="replace")
    for name in ("utf-8", "cp1252"):
        try:
            return data.decode(name)
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1")


def cleaned(text: str) -> str:
    """The text with the line ends of this program, without a byte order mark and the tape codes at its ends.

    A carriage return (CR) ends a line where the text has no line feed (LF). Elsewhere one that no line feed follows
    stays: controls that end lines at LF run on there, or drop what stands behind a comment.

    >>> cleaned("\\ufeff%\\r\\nG0 X1\\nM30\\r\\r\\n%\\x1a\\x00"), cleaned("G0 X1\\rM30\\r")
    ('%\\nG0 X1\\nM30\\n%', 'G0 X1\\nM30\\n')
    >>> cleaned("(up)\\rG0 X1\\r\\n")
    '(up)\\rG0 X1\\n'
    """
    text = text.removeprefix("\ufeff").strip(_TAPE)
    if "\r" not in text:
        return text
    return _LINE_END.sub("\n", text) if "\n" in text else text.replace("\r", "\n")
