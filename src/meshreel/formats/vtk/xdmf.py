"""Reader for XDMF: grids described in XML, with numbers inline or in separate HDF5 files.

Supports unstructured grids, single or in collections: a temporal collection is an animation, and
each grid of a spatial collection is a mesh. Referenced files must be in the folder of the file.
"""

from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, Keyword, Message
from meshreel.formats.file_errors import read_bytes
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import ascending_times
from meshreel.formats.vtk.xdmf_grid import GridFrames
from meshreel.formats.vtk.xdmf_items import DataItems
from meshreel.formats.vtk.xml_arrays import local_name, parse_xml, unread
from meshreel.runtime.extras import HDF


def read_xdmf(path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the meshes of an XDMF file: each animation, or each grid if there is none.

    Raises
    ------
    FormatError
        If the file is not XDMF, contains unsupported grids, or refers to files elsewhere.
    """
    root = parse_xml(read_bytes(path))
    if root.tag != "Xdmf":
        raise FormatError(f"is {root.tag}; expected Xdmf")
    items = DataItems(path, root, reading)
    grids = [items.dereference(grid) for grid in root.findall("Domain/Grid")]
    temporal = [grid for grid in grids if _is_collection(grid, "temporal")]
    meshes: list[tuple[str, npt.NDArray[np.float64], list[Element]]] = []
    for grid in temporal or grids:
        steps = _children(grid, items) if temporal else [grid]
        if not steps:
            raise FormatError(f"has a collection {grid.get('Name', '')!r} without grids")
        is_timed = bool(temporal) or next(grid.iter("Time"), None) is not None
        times = _times(grid, steps, items, reading) if is_timed else np.zeros(1)
        meshes += _meshes(grid.get("Name", ""), times, steps, items)
    if all(are_points := [all(map(_is_points, steps)) for _, _, steps in meshes]):
        raise FormatError("has only grids of points" if meshes else "has no Grid in a Domain")
    items.taken -= {*grids} - {*temporal} if temporal else set()
    _note_unread(root, temporal or grids, items, reading)
    names = [meshes[0][0] or path.stem]
    if len(meshes) > 1:
        paths = [f"/{name or 'grid'}" for name, _, _ in meshes]
        names = [
            name if paths.count(name) == 1 else f"{name}_{paths[:index].count(name)}"
            for index, name in enumerate(paths)
        ]
    reading.notes.left_out("grids of points", compress(names, are_points))
    return [
        GridFrames(steps, items, root, reading.notes).scene_mesh(name, times)
        for name, (_, times, steps), is_left_out in zip(names, meshes, are_points, strict=True)
        if not is_left_out
    ]


def _note_unread(root: Element, grids: list[Element], items: DataItems, reading: Reading) -> None:
    """Note what the file contains besides grids; `StepFrames` note what each grid contains."""
    domains = root.findall("Domain")
    references = (element for element in root.iter() if "Reference" in element.attrib)
    paths = " ".join(f"{element.get('Reference')} {element.text}" for element in references)
    names = (item.get("Name", "DataItem") for item in root.findall("Domain/DataItem"))
    unused = (name for name in names if name not in paths)
    reading.notes.left_out("data to which no grid refers", unused)
    collections = [grid for grid in grids if _is_collection(grid)]
    if any(local_name(element) == "include" for element in root.iter()):
        included = [grid for grid in root.iter("Grid") if grid.find("Topology") is not None][:1]
        mesh = (part for grid in included for part in grid if part.tag in ("Topology", "Geometry"))
        items.taken.update((*included, *mesh))
        collections += included
    for subject, name in unread([root, *domains, *collections], {*domains, *items.taken}):
        reading.notes.left_out(subject, [name])


def _is_points(grid: Element) -> bool:
    topology = grid.find("Topology")
    return topology is not None and topology.get("TopologyType", "").lower() == "polyvertex"


def _is_collection(grid: Element, kind: str = "") -> bool:
    is_collection = grid.get("GridType", "Uniform").lower() == "collection"
    return is_collection and grid.get("CollectionType", "Spatial").lower().endswith(kind)


def _children(grid: Element, items: DataItems) -> list[Element]:
    return [items.dereference(child) for child in grid.findall("Grid")]


def _meshes(
    name: str, times: npt.NDArray[np.float64], steps: list[Element], items: DataItems
) -> list[tuple[str, npt.NDArray[np.float64], list[Element]]]:
    """Return one animation, or one for each grid if the steps are spatial collections."""
    if not _is_collection(steps[0], "spatial"):
        return [(name, times, steps)]
    rows = [_children(step, items) for step in steps]
    if len({len(row) for row in rows}) != 1 or not rows[0]:
        raise FormatError("has steps with different numbers of grids")
    columns = [list(column) for column in zip(*rows, strict=True)]
    return [(column[0].get("Name", ""), times, column) for column in columns]


def _times(
    collection: Element, steps: list[Element], items: DataItems, reading: Reading
) -> npt.NDArray[np.float64]:
    """Return the times of all steps, from the steps or else the collection; one per second if none.

    Times that are not ascending are replaced by the frame rate of the options, if given.
    """
    tags = [next(step.iter("Time"), None) for step in steps]
    for step, tag in zip((*steps, collection), (*tags, collection.find("Time")), strict=True):
        if tag is not None:
            items.taken.update(time for time in step.iter("Time") if time.attrib == tag.attrib)
    if tags and all(time is not None and time.get("Value") is not None for time in tags):
        texts = [str(time.get("Value")) for time in tags if time is not None]
        times = _numbers(texts)
    elif (collection_time := collection.find("Time")) is not None:
        times = _shared_times(collection_time, len(steps), items)
    else:
        text = Message(
            "has no times; read as one frame per second: set the rate with ", Keyword("fps")
        )
        reading.notes.unknown("frame rate", text)
        times = np.arange(len(steps), dtype=np.float64)
    if len(times) != len(steps):
        raise FormatError(f"has {len(times)} times for {len(steps)} grids; each grid needs one")
    if not np.isfinite(times).all():
        raise FormatError("has a Time that is not finite")
    return ascending_times(times, "grid", reading)


def _shared_times(time: Element, n_steps: int, items: DataItems) -> npt.NDArray[np.float64]:
    if (item := time.find("DataItem")) is not None:
        numbers = items.read(item).ravel().astype(np.float64)
    else:
        numbers = _numbers((time.get("Value") or time.text or "").split())
    match time.get("TimeType", "Single").lower():
        case "list":
            return numbers
        case "range" if len(numbers) == 2:
            return np.linspace(numbers[0], numbers[1], n_steps)
        case "hyperslab" if len(numbers) >= 2:
            return float(numbers[0]) + float(numbers[1]) * np.arange(n_steps, dtype=np.float64)
        case kind:
            raise FormatError(f"has times of type {kind[:40]!r} with {len(numbers)} numbers")


def _numbers(texts: list[str]) -> npt.NDArray[np.float64]:
    try:
        return np.array(texts, np.float64)
    except ValueError as error:
        raise FormatError(f"has a Time that is not a number ({error})") from error


FORMATS = tuple(
    SequenceFormat(extension, "XDMF", read_meshes=read_xdmf, extra=HDF, refers_to_files=True)
    for extension in (".xdmf", ".xmf")
)
