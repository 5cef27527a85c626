"""The products of a STEP file [ISO10303-21], each at the place where its assembly puts it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label, TDF_LabelSequence
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from geometry.step_import.occ.topology import Shape

UNNAMED = "=>["  # how the kernel begins the name of a component that no statement of the file places


@dataclass(frozen=True)
class Product:
    """One use of a product of the file.

    name  : name of the product, '' where the file gives none; two uses of one product have the same name
    shape : kernel shape at its place, mm, STEP coordinates
    path  : numbers of the uses that lead to it from the top; two products have different paths
    """

    name: str
    shape: Shape
    path: tuple[int, ...] = ()

    def holds(self, other: Product) -> bool:
        """Whether this product places another one, directly or through others, beside bodies of its own."""
        return len(self.path) < len(other.path) and other.path[:len(self.path)] == self.path


def assembly_reader() -> STEPCAFControl_Reader:
    """A kernel reader that keeps the products of a file apart and reads their names, and nothing else about them."""
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    for left_out in (reader.SetColorMode, reader.SetLayerMode, reader.SetPropsMode, reader.SetSHUOMode,
                     reader.SetGDTMode, reader.SetMatMode, reader.SetViewMode):
        left_out(False)
    return reader


def placed_products(reader: STEPCAFControl_Reader) -> list[Product]:
    """The products with a shape in a file that the reader has parsed, in the order of the file.

    reader : of ``assembly_reader``, after ``ReadFile``

    A product that is placed several times comes several times. Bodies that a product has beside those it places come
    as a product with the path of that one.
    """
    document = TDocStd_Document(TCollection_ExtendedString("zonemill"))
    reader.Transfer(document)
    roots = TDF_LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(roots)
    return [p for i in range(roots.Length()) for p in _placed(roots.Value(i + 1), TopLoc_Location(), (i,), "")]


def _placed(label: TDF_Label, where: TopLoc_Location, path: tuple[int, ...], around: str) -> Iterator[Product]:
    """The products below a label that is itself placed by a location; around : name of the product that places it."""
    target = label
    if XCAFDoc_ShapeTool.IsReference_s(label):
        target = TDF_Label()
        XCAFDoc_ShapeTool.GetReferredShape_s(label, target)
        where = where.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(label))
    if XCAFDoc_ShapeTool.IsAssembly_s(target):
        parts = TDF_LabelSequence()
        XCAFDoc_ShapeTool.GetComponents_s(target, parts)
        for i in range(parts.Length()):
            own = _name(parts.Value(i + 1)).startswith(UNNAMED)
            yield from _placed(parts.Value(i + 1), where, path if own else (*path, i), _name(target))
        return
    shape = XCAFDoc_ShapeTool.GetShape_s(target)
    if not shape.IsNull():
        yield Product(around if _name(label).startswith(UNNAMED) else _name(target), shape.Moved(where), path)


def _name(label: TDF_Label) -> str:
    name = TDataStd_Name()
    return str(name.Get().ToExtString()).strip() if label.FindAttribute(TDataStd_Name.GetID_s(), name) else ""
