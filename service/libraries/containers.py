"""The containers of libraries: text, JSON, XML without entities, and zip files within limits."""

from __future__ import annotations

import codecs
import io
import json
import lzma
import re
import zipfile
import zlib
from typing import Any
from xml.etree import ElementTree

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from geometry.errors import LibraryError
from service.libraries.entry import shown

MAX_LIBRARY_BYTES = 64_000_000
MAX_UNPACKED_BYTES = 256_000_000
MAX_ZIP_MEMBERS = 25_000
MAX_ZIP_RATIO = 200
"""Unpacked size of a member over its packed size, where it unpacks to more than ``MIN_BOMB_BYTES``."""
MIN_BOMB_BYTES = 1_000_000
MAX_XML_DEPTH = 64
MAX_SEARCHED = 4000
"""Characters of a broken entry in which its name is searched."""
ENCODINGS = ("utf-8", "utf-16", "windows-1252", "iso-8859-1")
_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_ELEMENT = re.compile(r"<(?:\w+:)?(tool|Tool)[\s>/]")
_FIRST_LIST = re.compile(r'"(?:data|tools|items)"\s*:\s*\[|^\s*\[')
_NAMED = re.compile(r'"(?:description|name|guid|id)"\s*:\s*"([^"]{1,200})')
_XML_NAMED = re.compile(r'(?:name|UserType|guid)="([^"]{1,200})"|'
                        r"<(?:description|PrimaryId|ID21002)[^>]{0,200}>([^<]{1,200})")


def text_of(data: bytes, encoding: str | None = None) -> str:
    """Text of a library: by its byte order mark, else as stated, else UTF-8.

    encoding : one of ``ENCODINGS``, or None

    Raises
    ------
    LibraryError
        library_encoding: the bytes are no text of that encoding; the subject is the line.
    """
    name = next((n for mark, n in _MARKS if data.startswith(mark)), encoding or "utf-8")
    try:
        return data.decode(name).removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        near = shown(data[max(0, data.rfind(b"\n", 0, error.start) + 1):error.end + 20].decode("latin-1"))
        raise LibraryError(f"line {line} is not {name} text: {near}", code="library_encoding",
                           subjects=(f"line {line}",), measured=near, limit=list(ENCODINGS),
                           remedy="save the library as UTF-8, or state its encoding: --encoding windows-1252, over "
                                  "HTTP encoding=windows-1252") from None


def json_of(data: bytes, encoding: str | None = None) -> Any:
    """The JSON value of a library.

    Raises
    ------
    LibraryError
        library_cut_off, library_not_json: the subject is the entry at which reading stopped; or as ``text_of``.
    """
    text = text_of(data, encoding)
    try:
        return json.loads(text, parse_constant=_no_constant)
    except RecursionError:
        raise LibraryError("the JSON of the library is nested too deeply", code="library_not_json",
                           remedy="send the library as its program wrote it") from None
    except ValueError as error:
        where = _broken_json_entry(text)
        ended = isinstance(error, json.JSONDecodeError) and error.pos >= len(text.rstrip()) - 1
        cut = ended or text.rstrip()[-1:] not in ("]", "}")
        what = "ends in the middle of" if cut else "cannot be read at"
        raise LibraryError(f"the library {what} {where}: {error}", code="library_cut_off" if cut else
                           "library_not_json", subjects=(where,), remedy="export the library once more, and send the "
                           "whole file") from None


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not a number")


def _broken_json_entry(text: str) -> str:
    """The entry of a list of entries at which JSON breaks off."""
    start = _FIRST_LIST.search(text)
    if start is None:
        return "its first entry"
    decoder, at, count = json.JSONDecoder(), start.end(), 0
    while True:
        at += len(text[at:at + 10_000]) - len(text[at:at + 10_000].lstrip(" \t\r\n,"))
        try:
            at = decoder.raw_decode(text, at)[1]
        except (ValueError, RecursionError):
            named = _NAMED.search(text, at, at + MAX_SEARCHED)
            return f"entry {count + 1}" + (f" '{shown(named.group(1), 40)}'" if named else "")
        count += 1


class _Shallow(ElementTree.TreeBuilder):
    """Builds elements up to ``MAX_XML_DEPTH`` deep."""

    depth = 0

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self.depth += 1
        if self.depth > MAX_XML_DEPTH:
            raise LibraryError(f"the XML of the library is nested more than {MAX_XML_DEPTH} deep",
                               code="library_not_xml", measured=self.depth, limit=MAX_XML_DEPTH,
                               remedy="send the library as its program wrote it")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Any:
        self.depth -= 1
        return super().end(tag)


def xml_of(data: bytes, encoding: str | None = None) -> ElementTree.Element:
    """Root element of an XML library. Names lose their namespaces; a document type is read over, entities are refused.

    Raises
    ------
    LibraryError
        xml_entities: the document defines or uses entities of its own. library_cut_off, library_not_xml: the subject
        is the entry at which reading stopped.
    """
    parser = DefusedXMLParser(target=_Shallow(), encoding=encoding, forbid_dtd=False, forbid_entities=True,
                              forbid_external=True)
    try:
        parser.feed(data)
        root: ElementTree.Element = parser.close()
    except DefusedXmlException as error:
        raise LibraryError(f"the XML of the library defines entities: {shown(error)}", code="xml_entities",
                           remedy="export the library without a document type that defines entities") from None
    except ElementTree.ParseError as error:
        line, column = error.position
        where = _broken_xml_entry(data, line, column)
        cut = "no element found" in str(error) or "unclosed" in str(error)
        raise LibraryError(f"the library {'ends in the middle of' if cut else 'cannot be read at'} {where}: {error}",
                           code="library_cut_off" if cut else "library_not_xml", subjects=(where,),
                           remedy="export the library once more, and send the whole file") from None
    except (LookupError, ValueError) as error:
        raise LibraryError(f"the XML of the library states an encoding that cannot be read: {shown(error)}",
                           code="library_encoding", remedy="save the library as UTF-8") from None
    for element in root.iter():
        if isinstance(element.tag, str) and "}" in element.tag:
            element.tag = element.tag.rpartition("}")[2]
    return root


def _broken_xml_entry(data: bytes, line: int, column: int) -> str:
    """The tool element at which XML breaks off."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"<\x00" in data[:40]
    text = data.decode("utf-16" if wide else "utf-8", "replace")
    lines = text.splitlines(keepends=True)
    before = "".join(lines[:line - 1]) + (lines[line - 1][:column] if line <= len(lines) else "")
    found = list(_ELEMENT.finditer(before))
    if not found:
        return f"line {line}"
    named = _XML_NAMED.search(before, found[-1].start(), found[-1].start() + MAX_SEARCHED)
    words = shown(next(g for g in named.groups() if g), 40) if named else ""
    return f"entry {len(found)}" + (f" '{words}'" if words else "") + f", line {line}"


def is_zip(data: bytes) -> bool:
    """Whether the bytes begin as a zip file does."""
    return data.startswith((b"PK\x03\x04", b"PK\x05\x06"))


class Archive:
    """A zip file within the limits of this module.

    Raises LibraryError: library_cut_off where it is damaged, zip_bomb where it unpacks to too much, zip_encrypted.
    """

    def __init__(self, data: bytes) -> None:
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data))
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
            raise LibraryError(f"the zip file is damaged or cut off: {error}", code="library_cut_off",
                               remedy="export the library once more, and send the whole file") from None
        members = [m for m in self._zip.infolist() if m.filename and not m.filename.endswith("/")]
        if len(members) > MAX_ZIP_MEMBERS:
            raise _bomb(f"the zip file has {len(members)} files", len(members), MAX_ZIP_MEMBERS)
        total = sum(m.file_size for m in members)
        if total > MAX_UNPACKED_BYTES:
            raise _bomb(f"the zip file unpacks to {total / 1e6:.0f} MB", total, MAX_UNPACKED_BYTES)
        for m in members:
            if m.flag_bits & 1:
                raise LibraryError(f"{shown(m.filename)} in the zip file is encrypted", code="zip_encrypted",
                                   subjects=(shown(m.filename),), remedy="send the library without a password")
            if m.file_size > MIN_BOMB_BYTES and m.file_size > MAX_ZIP_RATIO * max(m.compress_size, 1):
                raise _bomb(f"{shown(m.filename)} in the zip file unpacks to "
                            f"{m.file_size / max(m.compress_size, 1):.0f} times its size",
                            m.file_size / max(m.compress_size, 1), MAX_ZIP_RATIO)
        self._members = {m.filename: m for m in members}
        self.names = list(self._members)

    def read(self, name: str) -> bytes:
        """Bytes of a member.

        Raises
        ------
        LibraryError
            library_cut_off: the member is damaged. zip_bomb: it is larger than the directory of the file states.
        """
        member = self._members[name]
        try:
            with self._zip.open(member) as file:
                data = file.read(member.file_size + 1)
        except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, ValueError, NotImplementedError,
                RuntimeError) as error:
            raise LibraryError(f"{shown(name)} in the zip file is damaged: {error}", code="library_cut_off",
                               subjects=(shown(name),), remedy="export the library once more, and send the whole "
                               "file") from None
        if len(data) > member.file_size:
            raise _bomb(f"{shown(name)} is larger than the zip file states", len(data), member.file_size)
        return data


def _bomb(message: str, measured: float, limit: float) -> LibraryError:
    return LibraryError(f"{message}, more than is read", code="zip_bomb", measured=measured, limit=limit,
                        remedy="split the library, or send it unpacked")


def zipped(files: dict[str, bytes]) -> bytes:
    """A zip file of files by name, with the same bytes for the same content."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, data)
    return out.getvalue()


def xml_bytes(root: ElementTree.Element) -> bytes:
    """An XML document in UTF-8, indented."""
    ElementTree.indent(root, space=" ")
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def json_bytes(value: Any) -> bytes:
    """A JSON document in UTF-8, indented."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
