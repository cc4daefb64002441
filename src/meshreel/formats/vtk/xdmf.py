"""XDMF: grids described in XML, whose numbers are in it or in HDF5 files beside.

Read are unstructured grids, by themselves or in collections: temporal ones are animations, each
grid of a spatial one is a mesh. What the file names must be in its folder.
"""

from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import file_order_times, note_file_order
from meshreel.formats.vtk.xdmf_grid import GridFrames
from meshreel.formats.vtk.xdmf_items import DataItems
from meshreel.formats.vtk.xml_tree import parse_xml
from meshreel.model.sequence import validate_fps


def read_xdmf(path: Path, options: ReadOptions) -> Sequence[SceneMesh]:
    """The meshes of an XDMF file: each animation, or each grid if there is none.

    Raises
    ------
    FormatError
        If it is no XDMF file, holds grids that are not read, or names files elsewhere.
    """
    with os_errors_naming(path):
        root = parse_xml(path.read_bytes())
    if root.tag != "Xdmf":
        raise FormatError(f"is {root.tag}; expected Xdmf")
    items = DataItems(path, root, allow_outside=options.allow_outside)
    grids = [items.resolved(grid) for domain in root.findall("Domain") for grid in domain]
    grids = [grid for grid in grids if grid.tag == "Grid"]
    temporal = [grid for grid in grids if _is_collection(grid, "temporal")]
    found: list[tuple[str, npt.NDArray[np.float64], list[Element]]] = []
    for grid in temporal or grids:
        steps = _children(grid, items) if temporal else [grid]
        if not steps:
            raise FormatError(f"has a collection {grid.get('Name', '')!r} of no grids")
        times = _times(grid, steps, items, options) if temporal else np.zeros(1)
        found += _meshes(grid.get("Name", ""), times, steps, items)
    if not found:
        raise FormatError("holds no Grid in a Domain")
    names = _names([name for name, _, _ in found], path.stem)
    return [
        _scene_mesh(name, times, GridFrames(steps, items, root, options.notes))
        for name, (_, times, steps) in zip(names, found, strict=True)
    ]


def _scene_mesh(name: str, times: npt.NDArray[np.float64], frames: GridFrames) -> SceneMesh:
    return SceneMesh(name, times, frames.frame, frames.surface, tracks=frames.tracks)


def _is_collection(grid: Element, kind: str) -> bool:
    is_one = grid.get("GridType", "Uniform").lower() == "collection"
    return is_one and grid.get("CollectionType", "Spatial").lower() == kind


def _children(grid: Element, items: DataItems) -> list[Element]:
    return [items.resolved(child) for child in grid.findall("Grid")]


def _meshes(
    name: str, times: npt.NDArray[np.float64], steps: list[Element], items: DataItems
) -> list[tuple[str, npt.NDArray[np.float64], list[Element]]]:
    """The animation of steps, or one for each grid of theirs if they are spatial collections."""
    if not _is_collection(steps[0], "spatial"):
        return [(name, times, steps)]
    rows = [_children(step, items) for step in steps]
    if len({len(row) for row in rows}) != 1 or not rows[0]:
        raise FormatError("has steps of different numbers of grids")
    columns = [list(column) for column in zip(*rows, strict=True)]
    return [(column[0].get("Name", ""), times, column) for column in columns]


def _times(
    collection: Element, steps: list[Element], items: DataItems, options: ReadOptions
) -> npt.NDArray[np.float64]:
    """Times of all steps, which say them each, or the collection for all; else seconds.

    Times that do not ascend are those of the frame rate in the options, if there is one.
    """
    own = [step.find("Time") for step in steps]
    if own and all(time is not None and time.get("Value") is not None for time in own):
        texts = [str(time.get("Value")) for time in own if time is not None]
        times = _numbers(texts)
    elif (shared := collection.find("Time")) is not None:
        times = _shared_times(shared, len(steps), items)
    else:
        options.notes.append(
            "has no times; taken as one frame a second: say the rate with --fps (fps=)"
        )
        times = np.arange(len(steps), dtype=np.float64)
    if len(times) != len(steps):
        raise FormatError(f"has {len(steps)} grids and {len(times)} times; it needs one for each")
    if not np.isfinite(times).all():
        raise FormatError("has a Time that is not finite")
    if len(behind := np.flatnonzero(np.diff(times) <= 0)):
        if fps := validate_fps(options.fps or 0.0):
            note_file_order(fps, options.notes)
            return file_order_times(len(steps), fps)
        index = int(behind[0])
        raise FormatError(
            f"has grid {index} at the time {times[index]:g} and grid {index + 1} at "
            f"{times[index + 1]:g}; times of the grids of a collection must ascend; take the grids "
            "in file order with --fps (fps=)"
        )
    return times


def _shared_times(time: Element, n_steps: int, items: DataItems) -> npt.NDArray[np.float64]:
    if (item := time.find("DataItem")) is not None:
        given = items.read(item).ravel().astype(np.float64)
    else:
        given = _numbers((time.get("Value") or time.text or "").split())
    match time.get("TimeType", "Single").lower():
        case "list":
            return given
        case "range" if len(given) == 2:
            return np.linspace(given[0], given[1], n_steps)
        case "hyperslab" if len(given) >= 2:
            return float(given[0]) + float(given[1]) * np.arange(n_steps, dtype=np.float64)
        case kind:
            raise FormatError(f"has times of type {kind[:40]!r} of {len(given)} numbers")


def _numbers(texts: list[str]) -> npt.NDArray[np.float64]:
    try:
        return np.array([float(text) for text in texts], np.float64)
    except ValueError as error:
        raise FormatError(f"has a Time that is no number ({error})") from error


def _names(given: list[str], stem: str) -> list[str]:
    """A name for each mesh that no other has."""
    if len(given) == 1:
        return [given[0] or stem]
    names = [f"/{name or 'grid'}" for name in given]
    return [
        name if names.count(name) == 1 else f"{name}_{names[:index].count(name)}"
        for index, name in enumerate(names)
    ]
