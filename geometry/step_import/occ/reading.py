"""STEP file -> kernel shape, in mm whatever the file's unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_Reader
from OCP.TColStd import TColStd_SequenceOfAsciiString

from geometry.errors import StepError
from geometry.step_import.occ.solid.products import Product, assembly_reader, placed_products
from geometry.step_import.occ.topology import Shape, faces_of
from geometry.step_import.text_checks import StepText, check_text

# Name the kernel gives a unit -> (name used here, mm in one of it).
UNITS = {
    "millimetre": ("mm", 1.0), "centimetre": ("cm", 10.0), "metre": ("m", 1000.0), "kilometre": ("km", 1e6),
    "micrometre": ("um", 1e-3), "inch": ("inch", 25.4), "foot": ("foot", 304.8), "mil": ("mil", 0.0254),
    "mile": ("mile", 1609344.0), "microinch": ("microinch", 2.54e-5),
}
CODEPAGES = {"utf-8": "UTF8", "cp1252": "CP1252"}  # names the kernel gives to encodings


@dataclass(frozen=True)
class StepShape:
    """A shape as the kernel read it.

    shape    : kernel shape of the whole file, mm
    products : the uses of its products, at their places; one where the file has no assembly
    unit     : length unit of the file, a key word such as 'mm' or 'inch'
    factor   : mm in one unit of the file
    text     : facts read from the bytes
    warnings : sentences for the report
    """

    shape: Shape
    products: tuple[Product, ...]
    unit: str
    factor: float
    text: StepText
    warnings: tuple[str, ...]


def read_shape(path: str | Path) -> StepShape:
    """Read a STEP file into a kernel shape in mm.

    Raises StepError: the codes of ``check_text``, ``unreadable_step`` and ``no_solid``.
    """
    text = check_text(path)
    placing = assembly_reader() if text.product_count > 1 else None
    reader = placing.ChangeReader() if placing else STEPControl_Reader()
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    Interface_Static.SetCVal_s("read.step.codepage", CODEPAGES[text.encoding])
    if (placing or reader).ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise StepError("the CAD kernel cannot parse the STEP file", code="unreadable_step",
                        remedy="export the part again, as AP214 or AP242")
    unit, factor, warnings = _unit(reader, text)
    products: list[Product] = []
    if placing:
        products = [p for p in placed_products(placing) if faces_of(p.shape)]
    else:
        reader.TransferRoots()
    shape = reader.OneShape() if reader.NbShapes() else None
    if shape is None or shape.IsNull() or not (faces := faces_of(shape)):
        raise StepError("the STEP file holds no solid and no surface", code="no_solid", measured=0, limit=1,
                        remedy="export the solid body, not a drawing, a sketch or an empty assembly")
    if len(faces) < text.faces:
        warnings.append(f"only {len(faces)} of the {text.faces} faces in the file could be read")
    if not products:
        products = [Product(text.products[0] if text.products else "", shape)]
    return StepShape(shape, tuple(products), unit, factor, text, tuple(warnings))


def _unit(reader: STEPControl_Reader, text: StepText) -> tuple[str, float, list[str]]:
    names = TColStd_SequenceOfAsciiString()
    reader.FileUnits(names, TColStd_SequenceOfAsciiString(), TColStd_SequenceOfAsciiString())
    found = list(dict.fromkeys(names.Value(i + 1).ToCString().lower() for i in range(names.Length())))
    warnings = []
    if not found or not text.has_unit:
        warnings.append("the file names no length unit; millimetres are assumed")
    if len(found) > 1:
        warnings.append(f"the file mixes length units ({', '.join(found)}); each shape is converted by its own")
    name = found[0] if found else "millimetre"
    if name not in UNITS:
        # the kernel has converted already; only the word and the hint about likely factors are lost
        warnings.append(f"the length unit '{name}' of the file is an uncommon one")
    word, factor = UNITS.get(name, (name, 1.0))
    return word, factor, warnings
