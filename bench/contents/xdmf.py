"""Contents of XDMF files: elements of the XML, and the numbers that they hold or refer to."""

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, cast
from xml.etree.ElementTree import Element, fromstring

import numpy as np

from contents.items import Item, Sort, merged, timed
from contents.vtk import item_of

EXTENSIONS = (".xdmf", ".xmf")
CENTERS = ("node", "cell")


def walk(path: Path) -> Iterator[Item]:
    """Yield the geometry, attributes, times and other elements of all grids."""
    root = fromstring(path.read_bytes().replace(b"<xi:include", b"<include"))  # often undeclared
    grids = [grid for grid in root.iter("Grid") if grid.find("Topology") is not None]
    includes = any(element.tag.endswith("include") for element in root.iter())
    temporal = [grid for grid in root.iter("Grid") if grid.get("CollectionType") == "Temporal"]
    of_points = [one for one in temporal if all(map(is_points, one.findall("Grid")))]
    yield from [Item(Sort.OTHER, "grids of points")] * bool(of_points)
    temporal = [one for one in temporal if one not in of_points]
    animated = [grid for one in temporal for grid in one.iter("Grid")]
    other_grids = [grid for one in of_points for grid in one.iter("Grid")]
    for grid in root.iter("Grid"):
        is_used = grid in animated or grid in temporal or (includes and grid is grids[0])
        if temporal and not is_used and grid not in other_grids:
            yield Item(Sort.OTHER, grid.get("Name", ""))
    yield from merged(
        item for grid in animated or root.iter("Grid") for item in items_of_grid(path, root, grid)
    )
    for information in root.iterfind("Domain/Information"):
        yield Item(Sort.OTHER, information.get("Name", ""))
    times = {float(time.get("Value", "nan")) for grid in animated or root.iter("Grid")
             for time in grid.findall("Time")} - {math.nan}  # fmt: skip
    yield from timed(sorted(filter(math.isfinite, times)))


def is_points(grid: Element) -> bool:
    """Return whether a grid has only points."""
    topology = grid.find("Topology")
    return topology is not None and topology.get("TopologyType", "").lower() == "polyvertex"


def items_of_grid(path: Path, root: Element, grid: Element) -> Iterator[Item]:
    """Yield the attributes, geometry and other elements of a grid."""
    for element in grid:
        name, values = element.get("Name", ""), cast(Any, None)
        if element.tag in ("Attribute", "Geometry"):
            values = numbers(path, root, element)
        if element.tag == "Attribute" and element.get("Center", "Node").lower() not in CENTERS:
            yield Item(Sort.OTHER, name)
        elif element.tag == "Attribute" and values is None:
            yield Item(Sort.DATA, name, words=("inside",))
        elif element.tag == "Attribute":
            width = values.shape[-1] if values.ndim > 1 else 1
            yield item_of(name, values, width, ("inside",))
        elif element.tag in ("Set", "Information"):
            yield Item(Sort.OTHER, name or element.tag)
        elif element.tag == "Geometry":
            is_flat = values is not None and grid_type(grid) == "XY"
            yield Item(Sort.POSITIONS, "geometry", np.append(values, 0) if is_flat else values)


def grid_type(grid: Element) -> str:
    """Return the type of the geometry of a grid."""
    geometry = grid.find("Geometry")
    return "" if geometry is None else geometry.get("GeometryType", geometry.get("Type", ""))


def numbers(path: Path, root: Element, element: Element) -> Any:
    """Return the numbers of an element; None if it takes more than one plain DataItem."""
    items = element.findall("DataItem")
    item = items[0] if len(items) == 1 else None
    if item is not None and item.get("Reference"):
        target = (item.text or "").strip().removeprefix("/Xdmf/")
        item = root.find(target) if item.get("Reference") == "XML" else None
    if item is None or item.get("ItemType", "Uniform") != "Uniform" or "|" in (item.text or ""):
        return None
    text = (item.text or "").strip()
    if item.get("Format", "XML") == "XML":
        shape = [int(size) for size in item.get("Dimensions", "-1").split()]
        kind = item.get("NumberType", item.get("DataType", "")).lower()
        is_byte = kind == "uchar" or (kind == "uint" and item.get("Precision") == "1")
        with suppress(ValueError):
            return np.array(text.split(), np.uint8 if is_byte else float).reshape(shape)
    if item.get("Format") != "HDF":
        return None
    import h5py

    file, _, name = text.partition(":")
    try:
        with h5py.File(path.parent / file, "r") as stored:
            return stored[name][()]
    except (OSError, KeyError):
        return None
