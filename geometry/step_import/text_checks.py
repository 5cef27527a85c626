"""Checks of the text of a STEP file before any CAD kernel reads it.

On a truncated or foreign file a kernel may return an empty shape, a partial one, or crash. These checks read the
clear-text encoding [ISO10303-21] itself: header, sections, end mark, dangling references.

The text is untrusted and may be built to be slow to read, so every search here passes over it once. A pattern that
starts again at many places and runs to the end from each takes hours for a few megabytes.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import re
import zlib
from dataclasses import dataclass
from pathlib import Path

from geometry.errors import StepError

MAX_BYTES = 512 * 1024 * 1024
# The search for dangling references takes about 0.1 s a MB. Above this size the kernel's own check must suffice.
REFERENCE_CHECK_BYTES = 64 * 1024 * 1024

_STRING = re.compile(rb"'[^']*'")
_DEFINED = re.compile(rb"#(\d+)\s*=")
_REFERENCE = re.compile(rb"#(\d+)")
_FACE = re.compile(rb"=\s*(?:ADVANCED_FACE|FACE_SURFACE)\s*\(")
_UNCERTAINTY = re.compile(rb"UNCERTAINTY_MEASURE_WITH_UNIT\s*\(\s*LENGTH_MEASURE\s*\(\s*([-+0-9.Ee]+)\s*\)")
_PRODUCT = re.compile(rb"=\s*PRODUCT\s*\(\s*'([^']*)'\s*,\s*'([^']*)'")
_PRODUCT_START = re.compile(rb"=\s*PRODUCT\s*\(")
# NAN and INF as C printf writes them, 1.#QNAN as older Windows did; a STEP enumeration stands between dots.
_NOT_FINITE = re.compile(rb"[(,]\s*([-+]?(?:nan|inf|infinity|1\.#(?:inf|ind|[qs]nan))(?:\([^()]*\))?)\s*(?=[,)])",
                         re.IGNORECASE)
# No coordinate has a three-digit exponent. Kernels write such numbers for "unbounded", but not into points.
_POINT = re.compile(rb"CARTESIAN_POINT\s*\(", re.IGNORECASE)
_HUGE = re.compile(rb"(?<=[0-9.])E\+?[1-9][0-9]{2,}", re.IGNORECASE)
_SHOWN = 60  # characters of a number that an error shows
_START = b"ISO-10303-21;"
_END = b"END-ISO-10303-21"


@dataclass(frozen=True)
class StepText:
    """Facts read from the text alone.

    sha256      : hex digest of the bytes
    faces       : number of faces the text defines (instances of an assembly are counted once)
    uncertainty : length uncertainty in units of the file, None when the file names none
    has_unit    : the text declares a length unit
    products    : names of products
    encoding    : of its text: 'utf-8', or 'cp1252' where it is none; some systems write no escapes
    product_count : statements that define a product
    """

    sha256: str
    faces: int
    uncertainty: float | None
    has_unit: bool
    products: tuple[str, ...]
    product_count: int
    encoding: str


def check_text(path: str | Path, *, max_bytes: int = MAX_BYTES) -> StepText:
    """Read a STEP file as text and refuse files that no kernel should read [ISO10303-21].

    path      : file
    max_bytes : int, largest accepted size

    Returns StepText.
    Raises StepError with code ``no_file``, ``empty_file``, ``file_too_large``, ``not_step``, ``truncated_step``
    ``bad_number`` or ``dangling_reference``.
    """
    data = _read(Path(path), max_bytes)
    _check_frame(data)
    bare = _without_comments(_STRING.sub(b"''", data))
    _check_numbers(bare)
    if len(data) <= REFERENCE_CHECK_BYTES:
        _check_references(bare)
    uncertainty = [float(x) for x in _UNCERTAINTY.findall(bare) if _is_positive(x)]
    encoding = _encoding(data)
    products = tuple(dict.fromkeys(
        name.decode(encoding, "replace") for pair in _PRODUCT.findall(data) for name in pair if name.strip()))
    return StepText(
        sha256=hashlib.sha256(data).hexdigest(),
        faces=len(_FACE.findall(bare)),
        uncertainty=max(uncertainty) if uncertainty else None,
        has_unit=b"LENGTH_UNIT" in bare,
        products=products,
        product_count=len(_PRODUCT_START.findall(bare)),
        encoding=encoding,
    )


def _encoding(data: bytes) -> str:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _read(path: Path, max_bytes: int) -> bytes:
    try:
        size = path.stat().st_size
        if size > max_bytes:
            raise StepError(f"the STEP file has {size} bytes, more than the limit of {max_bytes}",
                            code="file_too_large", subjects=(path.name,), measured=size, limit=max_bytes,
                            remedy="export the part alone, without product data and drawings")
        data = path.read_bytes()
    except OSError as problem:
        raise StepError(f"the STEP file cannot be read: {problem.strerror}", code="no_file", subjects=(path.name,),
                        remedy="check the path and the permissions") from problem
    if not data.strip():
        raise StepError("the STEP file is empty", code="empty_file", subjects=(path.name,), measured=len(data),
                        limit=1, remedy="export the part again; the transfer may have been cut off")
    return data


def _check_frame(data: bytes) -> None:
    head = data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    head = _without_comments(head).lstrip()
    if not head.upper().startswith(_START):
        raise StepError(f"the file is not a STEP file: it starts with {_shown(data)} instead of 'ISO-10303-21;'",
                        code="not_step", measured=_shown(data), limit="ISO-10303-21;", remedy=_format_hint(data))
    bare = _STRING.sub(b"''", data)
    for word in (b"HEADER;", b"DATA"):
        if word not in bare:
            raise StepError(f"the STEP file has no {word.decode().rstrip(';')} section", code="truncated_step",
                            measured="missing", limit=word.decode(), remedy="export the part again")
    sections = bare.count(b"ENDSEC")
    if _END not in bare[-4096:] or sections < 2:
        missing = "'END-ISO-10303-21;'" if _END not in bare[-4096:] else "'ENDSEC;'"
        raise StepError(f"the STEP file is cut off after {len(data)} bytes: its closing {missing} is missing",
                        code="truncated_step", measured=len(data), limit="END-ISO-10303-21;",
                        remedy="transfer or export the file again")


def _check_numbers(bare: bytes) -> None:
    """Refuse NaN, infinite and huge numbers: a CAD kernel may take such a point as valid and never return."""
    found = _NOT_FINITE.search(bare)
    place = found.span(1) if found else _huge_coordinate(bare)
    if place is None:
        return
    owners = _DEFINED.findall(bare, 0, place[0])
    name = f"#{owners[-1][:_SHOWN].decode()}" if owners else "the header"
    value = bare[place[0]:min(place[1], place[0] + _SHOWN)].decode("latin-1")
    raise StepError(f"{name} of the STEP file holds {value}, which is not a valid coordinate", code="bad_number",
                    subjects=(name,), measured=value, limit="a finite number below 1E100",
                    remedy=f"repair the shape that {name} belongs to in the CAD program and export the part again")


def _huge_coordinate(bare: bytes) -> tuple[int, int] | None:
    """Position of the first huge number between a point and the end of its statement."""
    at = 0 if _HUGE.search(bare) else len(bare)
    while point := _POINT.search(bare, at):
        end = bare.find(b";", point.end())
        at = end if end >= 0 else len(bare)
        if exponent := _HUGE.search(bare, point.end(), at):
            digits = bare[point.end():exponent.start()]
            number = len(digits) - len(digits.rstrip(b"0123456789."))
            start = exponent.start() - number
            return start - (bare[start - 1:start] in (b"-", b"+")), exponent.end()
    return None


def _without_comments(text: bytes) -> bytes:
    """The text without comments between ``/*`` and ``*/``; an unclosed comment stays."""
    kept, at = [], 0
    while (start := text.find(b"/*", at)) >= 0 and (end := text.find(b"*/", start + 2)) >= 0:
        kept.append(text[at:start])
        at = end + 2
    kept.append(text[at:])
    return b"".join(kept)


def _check_references(bare: bytes) -> None:
    defined = set(_DEFINED.findall(bare))
    used = set(_REFERENCE.findall(bare))
    lost = sorted(used - defined, key=lambda digits: (len(digits), digits))
    if lost:
        names = tuple(f"#{n[:_SHOWN].decode()}" for n in lost[:10])
        raise StepError(f"{len(lost)} entities are used but not defined, the first is {names[0]}; part of the file "
                        "is missing", code="dangling_reference", subjects=names, measured=len(lost), limit=0,
                        remedy="transfer or export the file again")


def _shown(data: bytes) -> str:
    return repr(data[:24].decode("latin-1"))


def _format_hint(data: bytes) -> str:
    if data[:2] == b"\x1f\x8b":
        try:
            inner = gzip.GzipFile(fileobj=io.BytesIO(data)).read(64)
        except (OSError, EOFError, zlib.error):  # a damaged archive is still an archive
            inner = b""
        return "unpack the gzip file first" + ("; it holds a STEP file" if _START in inner else "")
    if data[:2] == b"PK":
        return "unpack the zip file first"
    if data[:5].lower() == b"solid" or data[:80].lower().startswith(b"solid"):
        return "this looks like STL; a STEP file with a solid is needed"
    return "export the part as STEP (AP203, AP214 or AP242, clear text)"


def _is_positive(text: bytes) -> bool:
    try:
        return float(text) > 0
    except ValueError:
        return False
