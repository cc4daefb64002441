"""Contents of VTK files: arrays that VTK reads, and further elements of XML."""

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from contents.items import Item, Sort, range_of

EXTENSIONS = (".vtu", ".vtp", ".vtk", ".pvd")
POLYGONS, LINES = (5, 6, 7, 8, 9, 22, 23, 28, 34, 36), (1, 2, 3, 4, 21)
"""VTK types of flat cells, and of points and lines."""
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
        times = sorted({float(entry.get("timestep", 0)) for entry in entries})
        if len(times) > 1 or times[0]:
            yield Item(Sort.TIMES, "times", times, ("frame rate",))
    values: dict[tuple[Sort, str], list[Any]] = defaultdict(list)
    for file in dict.fromkeys(files):
        for item in walk_file(file):
            is_time = is_collection and item.name in ("TimeValue", "TIME")
            if not is_time:
                values[item.sort, item.name].append(item)
    for (sort, name), items in values.items():
        is_known = all(item.values is not None for item in items)
        is_known &= sort is not Sort.FACES or len(items) == 1
        ranges = [range_of(item.values) for item in items] if is_known else None
        yield Item(sort, name, ranges, items[0].words)


def walk_file(path: Path) -> Iterator[Item]:
    """Yield the contents of a file with one mesh."""
    from vtkmodules import all as vtk

    names = {".vtk": "GenericDataObjectReader", ".vtu": "XMLUnstructuredGridReader",
             ".vtp": "XMLPolyDataReader", ".pvtu": "XMLPUnstructuredGridReader",
             ".pvtp": "XMLPPolyDataReader"}  # fmt: skip
    reader = getattr(vtk, f"vtk{names[path.suffix.lower()]}")()
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
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
            yield from _items(array, data.GetNormals() is array, data.GetTCoords() is array)
    for index in range(mesh.GetFieldData().GetNumberOfArrays()):
        yield Item(Sort.OTHER, mesh.GetFieldData().GetAbstractArray(index).GetName())
    if path.suffix.lower() == ".vtk":
        return
    parser: Any = ElementTree.XMLPullParser(["end"])
    parser.feed(re.split(rb"<AppendedData", path.read_bytes())[0])
    for _, element in parser.read_events():
        for key in element.findall("InformationKey"):
            if key.get("name") == "UNITS_LABEL":
                name = f"{element.get('Name')}:{(key.text or '').strip()}"
                yield Item(Sort.UNIT, name, words=("units",))
            elif "RANGE" not in key.get("name", ""):
                yield Item(Sort.OTHER, key.get("name", ""))


def _items(array: Any, is_normals: bool, is_uv: bool) -> Iterator[Item]:
    """Yield an array; text as the labels of groups."""
    name, width = array.GetName() or "", array.GetNumberOfComponents()
    if name == "vtkGhostType":
        yield Item(Sort.DATA, name, words=("ghost", "ghosts"))
    elif not array.IsNumeric():
        labels = {array.GetValue(index) for index in range(array.GetNumberOfValues())}
        yield from (Item(Sort.GROUP, label, words=(name,)) for label in labels if label)
    else:
        values, is_float = to_numpy(array), array.GetDataType() in (10, 11)
        is_color = width in (3, 4) and (values.dtype == np.uint8 or name.lower() in COLOR_NAMES)
        is_uv = width == 2 and is_float and (is_uv or name.lower() in UV_NAMES)
        sort = Sort.COLOR if is_color else Sort.UV if is_uv else Sort.DATA
        words = ("normals",) if is_normals else ("inside",)
        is_plain = not is_color or values.dtype == np.uint8
        yield Item(sort, name, (values / 255 if is_color else values) if is_plain else None, words)
    if array.HasAComponentName():
        yield Item(Sort.OTHER, f"{name}:names of components", words=(name,))
