"""Contents of VTK files: arrays that VTK reads, and further elements of XML."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from contents.items import Item, Sort, merged, timed

EXTENSIONS = (".vtu", ".vtp", ".vtk", ".pvd")
POLYGONS, LINES = (5, 6, 7, 8, 9, 22, 23, 28, 34, 36), (1, 2, 3, 4, 21)
"""VTK types of flat cells, and of points and lines."""
CLOCKS = ("TimeValue", "TIME")
"""Field data with the time of a file."""
UV_NAMES = {"uv", "uvmap", "st", "tcoords", "texturecoordinates", "texture coordinates"}
COLOR_NAMES = {"color", "colors", "colour", "colours", "rgb", "rgba", "cd"}


def to_numpy(array: Any) -> Any:
    """Return the values of a numeric array of VTK."""
    from vtkmodules.util import numpy_support

    convert: Any = numpy_support.vtk_to_numpy
    return convert(array)


def walk(path: Path) -> Iterator[Item]:
    """Yield the contents of a file, or of all files of a collection."""
    files = [path]
    if is_collection := path.suffix.lower() == ".pvd":
        entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
        files = [path.parent / entry.get("file", "") for entry in entries]
        yield from timed(sorted({float(entry.get("timestep", 0)) for entry in entries}))
    for file in [file for file in files if file.suffix.lower() in (".pvtu", ".pvtp")]:
        pieces = ElementTree.parse(file).getroot().iter("Piece")
        files += [file.parent / piece.get("Source", "") for piece in pieces]
        files.remove(file)
    items = (item for file in dict.fromkeys(files) for item in walk_file(file))
    yield from merged(item for item in items if not is_collection or item.sort is not Sort.TIMES)


def walk_file(path: Path) -> Iterator[Item]:
    """Yield the contents of a file with one mesh."""
    from vtkmodules import all as vtk

    names = {".vtk": "GenericDataObjectReader", ".vtu": "XMLUnstructuredGridReader",
             ".vtp": "XMLPolyDataReader"}  # fmt: skip
    reader = getattr(vtk, f"vtk{names[path.suffix.lower()]}")()
    reader.SetFileName(str(path))
    reader.Update()
    mesh, elements = reader.GetOutput(), _elements(path)
    declared = {
        element.get("Name"): element.get("track_kind", element.get("attribute_kind"))
        for element in elements
    }
    points = to_numpy(mesh.GetPoints().GetData())
    yield Item(Sort.POSITIONS, "points", points, ("node", "nodes"))
    kinds = [mesh.GetCellType(index) for index in range(mesh.GetNumberOfCells())]
    if all(kind in POLYGONS and kind != 6 for kind in kinds):
        yield Item(Sort.FACES, "cells", len(kinds), ("ghost", "ghosts"))
    elif not all(kind in POLYGONS + LINES for kind in kinds):
        yield Item(Sort.FACES, "cells", None)
    elif any(kind in LINES for kind in kinds):
        yield Item(Sort.OTHER, "points and lines")
    for data in (mesh.GetPointData(), mesh.GetCellData()):
        for index in range(data.GetNumberOfArrays()):
            array = data.GetAbstractArray(index)
            for item in _items(array, data.GetNormals() is array, data.GetTCoords() is array):
                is_color = item.sort is Sort.COLOR or declared.get(item.name) == "color"
                are_kept = data is mesh.GetPointData() or not {*kinds} & {0, *LINES}
                values = item.values if are_kept and is_color == (item.sort is Sort.COLOR) else None
                yield replace(item, sort=Sort.COLOR if is_color else item.sort, values=values)
    for index in range(mesh.GetFieldData().GetNumberOfArrays()):
        array = mesh.GetFieldData().GetAbstractArray(index)
        if array.GetName() in CLOCKS and array.GetNumberOfValues() < 2:
            yield from timed(to_numpy(array))
        else:
            yield Item(Sort.OTHER, array.GetName())
    for element in elements:
        for key in element.findall("InformationKey"):
            if key.get("name") == "UNITS_LABEL":
                name = f"{element.get('Name')}:{(key.text or '').strip()}"
                yield Item(Sort.UNIT, name, words=("units",))
            elif "RANGE" not in key.get("name", ""):
                yield Item(Sort.OTHER, key.get("name", ""))


def _elements(path: Path) -> list[ElementTree.Element]:
    """Return the XML elements of a file before appended data; none of a legacy file."""
    if path.suffix.lower() == ".vtk":
        return []
    parser: Any = ElementTree.XMLPullParser(["end"])
    parser.feed(re.split(rb"<AppendedData", path.read_bytes())[0])
    return [element for _, element in parser.read_events()]


def item_of(
    name: str, values: Any, width: int, words: tuple[str, ...], *, is_uv: bool = False
) -> Item:
    """Return the item of a numeric array, of colors and texture coordinates by name and type."""
    is_color = width in (3, 4) and (values.dtype == np.uint8 or name.lower() in COLOR_NAMES)
    is_uv = width == 2 and values.dtype.kind == "f" and (is_uv or name.lower() in UV_NAMES)
    sort = Sort.COLOR if is_color else Sort.UV if is_uv else Sort.DATA
    is_plain = not is_color or values.dtype == np.uint8
    return Item(sort, name, (values / 255 if is_color else values) if is_plain else None, words)


def _items(array: Any, is_normals: bool, is_uv: bool) -> Iterator[Item]:
    """Yield an array; text as the labels of groups."""
    name, width = array.GetName() or "", array.GetNumberOfComponents()
    if name == "vtkGhostType":
        yield Item(Sort.DATA, name, words=("ghost", "ghosts"))
    elif not array.IsNumeric():
        labels = {array.GetValue(index) for index in range(array.GetNumberOfValues())}
        yield from (Item(Sort.GROUP, label, words=(name,)) for label in labels if label)
    else:
        words = ("normals",) if is_normals else ("inside",)
        yield item_of(name, to_numpy(array), width, words, is_uv=is_uv)
    components = map(array.GetComponentName, range(width))
    yield from (Item(Sort.OTHER, f"{name}:{component}") for component in components if component)
