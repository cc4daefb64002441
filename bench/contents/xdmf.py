"""Contents of XDMF files: elements of the XML, and the numbers that they hold or refer to."""

import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, parse

import numpy as np

from contents.items import Item, Sort, range_of

EXTENSIONS = (".xdmf", ".xmf")
CENTERS = ("node", "cell")


def walk(path: Path) -> Iterator[Item]:
    """Yield the geometry, attributes, times and other elements of all grids."""
    root = parse(path).getroot()
    grids = [grid for grid in root.iter("Grid") if grid.find("Topology") is not None]
    includes = any(element.tag.endswith("include") for element in root.iter())
    temporal = [grid for grid in root.iter("Grid") if grid.get("CollectionType") == "Temporal"]
    animated = [grid for one in temporal for grid in one.iter("Grid")]
    values: dict[tuple[Sort, str], list[Any]] = defaultdict(list)
    for grid in root.iter("Grid"):
        is_used = grid in animated or grid in temporal or (includes and grid is grids[0])
        if temporal and not is_used:
            values[Sort.OTHER, grid.get("Name", "")].append(None)
    for grid in animated or root.iter("Grid"):
        for element in grid:
            if element.tag == "Attribute":
                is_data = element.get("Center", "Node").lower() in CENTERS
                sort = Sort.DATA if is_data else Sort.OTHER
                values[sort, element.get("Name", "")].append(numbers(path, root, element))
            elif element.tag in ("Set", "Information"):
                values[Sort.OTHER, element.get("Name", element.tag)].append(None)
            elif element.tag == "Geometry":
                values[Sort.POSITIONS, "geometry"].append(numbers(path, root, element))
    for name in (element.get("Name", "") for element in root.iterfind("Domain/Information")):
        values[Sort.OTHER, name].append(None)
    for (sort, name), arrays in values.items():
        is_known = sort is not Sort.OTHER and all(array is not None for array in arrays)
        ranges = [range_of(array) for array in arrays] if is_known else None
        if sort is Sort.POSITIONS and any(grid_type(grid) == "XY" for grid in grids) and ranges:
            ranges.append((0.0, 0.0))
        yield Item(sort, name, ranges, ("inside",))
    times = {float(time.get("Value", "nan")) for grid in animated or root.iter("Grid")
             for time in grid.findall("Time")} - {math.nan}  # fmt: skip
    known_times = sorted(time for time in times if math.isfinite(time))
    if known_times and (len(known_times) > 1 or known_times[0]):
        yield Item(Sort.TIMES, "times", known_times, ("frame rate",))


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
        return np.array(text.split(), float)
    if item.get("Format") != "HDF":
        return None
    import h5py

    file, _, name = text.partition(":")
    try:
        with h5py.File(path.parent / file, "r") as stored:
            return stored[name][()]
    except (OSError, KeyError):
        return None
