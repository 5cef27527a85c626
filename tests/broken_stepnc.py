"""Every attribute of a STEP-NC file of ours broken once, in the ways a value can be: left out, of another type, leading
nowhere, another word."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from verify.stepnc.attribute_checks import Attributes
from verify.stepnc.part21 import DERIVED, EnumItem, Part21File, Ref, Typed

NOWHERE, WORD = "#999999", ".NO_SUCH_WORD."


@dataclass(frozen=True)
class Broken:
    """One attribute broken: number and entity of its instance, the attribute, how, and the text of the file."""

    number: int
    entity: str
    attribute: str
    how: str
    text: str


def written(value: object) -> str:
    """A value as Part 21 has it."""
    if value is None:
        return "$"
    if value is DERIVED:
        return "*"
    if isinstance(value, Ref):
        return f"#{int(value)}"
    if isinstance(value, EnumItem):
        return f".{value!s}."
    if isinstance(value, Typed):
        return f"{value.name}({written(value.value)})"
    if isinstance(value, str):
        return "'" + value.replace("\\", "\\\\").replace("'", "''") + "'"
    if isinstance(value, list):
        return "(" + ",".join(map(written, value)) + ")"
    if isinstance(value, float):
        text = f"{value:.12f}".rstrip("0")
        return text
    return str(value)


def ways(value: object, names: bool) -> Iterator[tuple[str, str]]:
    """How a value can be broken, and the text it then has; names: strings stand for enumerations too."""
    yield "left out", "$"
    if isinstance(value, list) and value:
        yield "of another type", "'text'"
        yield "empty", "()"
        for how, text in ways(value[0], names):
            yield f"first of it {how}", "(" + ",".join([text, *map(written, value[1:])]) + ")"
        return
    if isinstance(value, Typed):
        yield "of another type", written(value.value)
        yield "under another name", f"NO_SUCH_TYPE({written(value.value)})"
        for how, text in ways(value.value, names):
            yield f"inside it {how}", f"{value.name}({text})"
        return
    yield "of another type", "7" if isinstance(value, str) and not isinstance(value, EnumItem) else "'text'"
    if isinstance(value, Ref):
        yield "leading nowhere", NOWHERE
    if isinstance(value, EnumItem):
        yield "another word", WORD
    if names and isinstance(value, str) and not isinstance(value, EnumItem):
        yield "another word", "'no such word'"


def broken(text: str, tables: dict[str, Attributes], *, names: bool, most: int | None = None,
           without: frozenset[str] = frozenset()) -> Iterator[Broken]:
    """All ways to break a file, one at a time.

    tables : attributes by entity, those of records of complex instances with a + before it
    names  : strings stand for enumerations too; most : so many instances of an entity, None all
    without : entities, with blanks between the records of complex ones, that are left alone
    """
    file = Part21File(text, "job")
    lines = text.split("\n")
    seen: dict[str, int] = {}
    numbers = sorted({n for of in file.entities().values() for n in of} | set(file._point_ids.tolist()))
    for number in numbers:
        records = file.records(number)
        key = " ".join(name for name, _ in records)
        seen[key] = seen.get(key, 0) + 1
        if key in without or (most is not None and seen[key] > most):
            continue
        at = file.line(number) - 1
        end = at
        while not lines[end].endswith(";"):
            end += 1
        for which, (entity, values) in enumerate(records):
            kinds = tables.get(("+" if len(records) > 1 else "") + entity, ())
            for place, value in enumerate(values):
                attribute = kinds[place][0] if place < len(kinds) else str(place)
                for how, word in ways(value, names):
                    if word == written(value):
                        continue  # it is so already
                    body = [(n, [written(v) for v in vs]) for n, vs in records]
                    body[which][1][place] = word
                    inner = " ".join(f"{n}({','.join(vs)})" for n, vs in body)
                    record = f"#{number}={f'({inner})' if len(records) > 1 else inner};"
                    yield Broken(number, entity, attribute, how, "\n".join([*lines[:at], record, *lines[end + 1:]]))
