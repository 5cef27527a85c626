"""The import of a library as its wire model."""

from __future__ import annotations

from collections.abc import Mapping

from schemas.libraries import ImportedEntry, LibraryImport
from service.libraries.conversion import LEFT_OUT, NOTED, TAKEN, Converted
from service.libraries.entry import shown
from service.libraries.exchange import ImportedLibrary


def import_report(library: ImportedLibrary, *, dry_run: bool, versions: Mapping[str, int] | None = None
                  ) -> LibraryImport:
    """What became of each entry of a library.

    versions : that were written, by the name of the tool
    """
    counts = library.counts
    return LibraryImport(format=library.format.name, dry_run=dry_run, taken=counts[TAKEN], noted=counts[NOTED],
                         left_out=counts[LEFT_OUT], entries=[_entry(e, versions or {}) for e in library.entries])


def _entry(item: Converted, versions: Mapping[str, int]) -> ImportedEntry:
    entry, name = item.entry, item.tool.id if item.tool is not None else None
    return ImportedEntry(
        place=entry.place, verdict=item.verdict, reason=item.reason or None,
        notes=list(item.notes), library_id=shown(entry.library_id, 200), stated_kind=shown(entry.stated_kind, 200),
        description=shown(entry.description, 400), order_code=shown(entry.order_code, 200), t_number=entry.t_number,
        h_number=entry.h_number, d_number=entry.d_number, pocket=entry.pocket, name=name,
        version=versions.get(name or ""), tool=item.tool)
