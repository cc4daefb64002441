"""The frames of a grid of an XDMF file."""

from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import Field
from meshreel.formats.frames.steps import DataArray, Step, StepFrames
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.surfaces.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    Cells,
    CellSurface,
    cell_mesh,
)
from meshreel.formats.vtk.xdmf_items import DataItems
from meshreel.formats.vtk.xml_arrays import local_name, unread
from meshreel.model.notes import Notes
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain
from meshreel.runtime.counting import counted

CENTERS = {"node": Domain.VERTEX, "cell": Domain.FACE}

CELLS = {
    1: ("polyvertex", POLY_VERTEX, 0), 2: ("polyline", POLY_LINE, 0), 3: ("polygon", POLYGON, 0),
    4: ("triangle", 5, 3), 5: ("quadrilateral", 9, 4), 6: ("tetrahedron", 10, 4),
    7: ("pyramid", 14, 5), 8: ("wedge", 13, 6), 9: ("hexahedron", 12, 8),
    34: ("edge_3", 21, 3), 35: ("quadrilateral_9", 28, 9), 36: ("triangle_6", 22, 6),
    37: ("quadrilateral_8", 23, 8), 38: ("tetrahedron_10", 24, 10), 39: ("pyramid_13", 27, 13),
    40: ("wedge_15", 26, 15), 41: ("wedge_18", 32, 18), 48: ("hexahedron_20", 25, 20),
    49: ("hexahedron_24", 33, 24), 50: ("hexahedron_27", 29, 27),
}  # fmt: skip
"""Name, VTK type and point count of each XDMF cell type; count 0 is stored with each cell."""

SHORT_NAMES = {
    "tri": "triangle", "quad": "quadrilateral", "tet": "tetrahedron", "hex": "hexahedron",
}  # fmt: skip
BY_NAME = {name: (kind, n_points) for name, kind, n_points in CELLS.values()}


class GridFrames:
    """An animated mesh with a uniform grid for each frame.

    Parameters
    ----------
    steps : list of Element
        The grids, one for each frame.
    root : Element
        Root of the document: grids may include parts of other grids.
    notes : Notes
        Receives a sentence for each thing that is left out.
    """

    def __init__(self, steps: list[Element], items: DataItems, root: Element, notes: Notes) -> None:
        for step in steps:
            if step.get("GridType", "Uniform").lower() != "uniform":
                raise FormatError(f"has a grid of type {step.get('GridType', '')[:40]!r} in a step")
        self._steps, self._items, self._root, self._notes = steps, items, root, notes
        self._cached: tuple[Any, Cells, CellSurface] | None = None

    def scene_mesh(self, name: str, times: npt.NDArray[np.float64]) -> SceneMesh:
        """Return the animated mesh."""
        frames = StepFrames(self._step, self._notes)
        return SceneMesh(name, times, frames.frame, frames.surface, tracks=frames.tracks)

    def _step(self, index: int) -> Step:
        points = self._points(index)
        cells, surface = self._surface(index, len(points))
        counts = {Domain.VERTEX: len(points), Domain.FACE: len(cells.types)}
        arrays = [
            self._array(index, self._items.dereference(attribute), counts)
            for attribute in self._steps[index].findall("Attribute")
            if _center(attribute) in CENTERS
        ]
        parents = (child for child in self._steps[index].iter() if child in self._items.taken)
        left_out = [*unread(parents, self._items.taken)]
        return Step(len(points), len(cells.types), surface, lambda: points, arrays, left_out)

    def _array(self, index: int, attribute: Element, counts: Mapping[Domain, int]) -> DataArray:
        center = _center(attribute)
        n_items = counts[CENTERS[center]]

        def describe() -> Field:
            n_numbers, dtype = self._items.describe(self._items.item_of(attribute))
            if n_numbers == 0 or n_numbers % n_items:
                raise FormatError(
                    f"has {counted(n_numbers, 'number')} in step {index}; arrays of each {center} "
                    f"need {n_items} or a multiple of it"
                )
            return Field(dtype, n_numbers // n_items)

        def read() -> npt.NDArray[Any]:
            return self._items.read(self._items.item_of(attribute)).reshape(n_items, -1)

        def identify() -> object:
            return self._items.key(self._items.item_of(attribute))

        return DataArray(CENTERS[center], attribute.get("Name", ""), read, identify, describe)

    def _element(self, index: int, tag: str) -> Element:
        """Return the geometry or topology of a step, which it may include from another grid."""
        step = self._steps[index]
        element = step.find(tag)
        include = [child for child in step if local_name(child) == "include"]
        self._items.taken.update(include)
        if element is None and include:
            if include[0].get("href"):
                raise FormatError(
                    f"includes {include[0].get('href')!r}; other files cannot be included"
                )
            element = self._root.find(f".//Grid/{tag}")
        if element is None:
            raise FormatError(f"has a grid {step.get('Name', '')!r} without {tag}")
        return self._items.dereference(element)

    def _points(self, index: int) -> Vertices:
        geometry = self._element(index, "Geometry")
        kind = (geometry.get("GeometryType") or geometry.get("Type") or "XYZ").upper()
        if kind == "X_Y_Z":
            columns = [self._items.read(item).ravel() for item in geometry.findall("DataItem")]
            if len(columns) != 3 or len({len(column) for column in columns}) != 1:
                raise FormatError("has an X_Y_Z Geometry without three columns of equal length")
            values = np.stack(columns, axis=1)
        elif kind in ("XYZ", "XY"):
            values = self._items.read(self._items.item_of(geometry))
            if values.size % len(kind):
                raise FormatError(f"has a Geometry of type {kind} with {values.size} numbers")
            values = values.reshape(-1, len(kind))
        else:
            raise FormatError(
                f"has a Geometry of type {kind[:40]!r}; XYZ, XY and X_Y_Z are supported"
            )
        if values.dtype not in (np.float32, np.float64):
            values = values.astype(np.float64)
        return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))

    def _surface(self, index: int, n_points: int) -> tuple[Cells, CellSurface]:
        """Return the cells of a step and their surface, cached for steps that share them."""
        topology = self._element(index, "Topology")
        item = self._items.item_of(topology)
        key = self._items.key(item), tuple(topology.attrib.items()), n_points
        if self._cached is None or self._cached[0] != key:
            name = topology.get("TopologyType") or topology.get("Type") or ""
            width = topology.get("NodesPerElement", "0")
            cells = read_cells(name, self._items.read(item), int(width) if width.isdecimal() else 0)
            self._cached = key, cells, cell_mesh(cells, n_points)
        return self._cached[1:]


def _center(attribute: Element) -> str:
    """Center of an Attribute in lower case: node, cell, grid or another."""
    return attribute.get("Center", "Node").lower()


def read_cells(name: str, values: npt.NDArray[Any], n_points: int) -> Cells:
    """Return the cells of an XDMF topology.

    Parameters
    ----------
    name : str
        Topology type, such as "Triangle" or "Mixed".
    values : array of shape (N,) or (N, C)
        Integers, possibly as real numbers.
    n_points : int
        Points of each polygon or line, if the topology declares it; otherwise 0.

    Raises
    ------
    FormatError
        If the type is unsupported, or the numbers do not fit it.
    """
    with np.errstate(invalid="ignore"):
        integers = values.astype(np.int64)
    if (integers != values).any():  # programs store integers as real numbers
        raise FormatError("has a Topology with numbers that are not integers")
    head, _, tail = name.lower().partition("_")
    title = SHORT_NAMES.get(head, head) + (f"_{tail}" if tail else "")
    if title == "mixed":
        return _mixed(integers.ravel())
    if title not in BY_NAME:
        raise FormatError(f"has a Topology of unsupported type {name[:40]!r}")
    kind, n_fixed = BY_NAME[title]
    width = n_fixed or n_points or (values.shape[-1] if values.ndim > 1 else 1)
    if values.size % width:
        raise FormatError(f"has a Topology of {values.size} numbers; cells of {title} have {width}")
    n_cells = values.size // width
    counts = np.full(n_cells, width, np.int64)
    return Cells(np.full(n_cells, kind), counts, integers.ravel())


def _mixed(values: npt.NDArray[np.int64]) -> Cells:
    """Parse cells that each begin with their type, and with their point count if it varies."""
    numbers, offset = values.tolist(), 0
    kinds, counts, is_point = [], [], np.ones(len(values), bool)
    while offset < len(numbers):
        if numbers[offset] not in CELLS:
            raise FormatError(f"has a cell of unsupported type {numbers[offset]}")
        _, kind, count = CELLS[numbers[offset]]
        is_point[offset] = False
        offset += 1
        if count == 0:
            count = numbers[offset] if offset < len(numbers) else -1
            is_point[offset : offset + 1] = False
            offset += 1
        if count < 0 or offset + count > len(numbers):
            raise FormatError("has a Topology that ends within a cell")
        kinds.append(kind)
        counts.append(count)
        offset += count
    return Cells(np.array(kinds, np.int64), np.array(counts, np.int64), values[is_point])
