"""The frames of a grid of an XDMF file."""

from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.notes import note_kinds, note_moving
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.cells import Cells, CellSurface, find_surface
from meshreel.formats.vtk.data_arrays import DataArray, surface_of_arrays
from meshreel.formats.vtk.xdmf_cells import read_cells
from meshreel.formats.vtk.xdmf_items import DataItems
from meshreel.formats.vtk.xml_tree import local_name
from meshreel.sequence import Vertices
from meshreel.surface import Surface


class GridFrames:
    """An animated mesh, each frame of which is a uniform grid.

    Parameters
    ----------
    steps : list of Element
        Its grids.
    items : DataItems
    root : Element
        Of the document, in which grids may include parts of others.
    notes : list of str
        Gains a sentence on data that change from step to step, which are left out.
    """

    def __init__(
        self, steps: list[Element], items: DataItems, root: Element, notes: list[str]
    ) -> None:
        for step in steps:
            if step.get("GridType", "Uniform").lower() != "uniform":
                raise FormatError(f"has a grid of type {step.get('GridType', '')[:40]!r} in a step")
        self._steps, self._items, self._root, self._notes = steps, items, root, notes
        self._cached: tuple[Any, Cells, CellSurface] | None = None

    def frame(self, index: int) -> PolygonMesh:
        """The surface of a step."""
        points = self._points(index)
        return self._surface(index, len(points))[1].mesh(points)

    def surface(self, index: int) -> Surface:
        """The data of a step that all steps say alike."""
        n_points = len(self._points(index))
        cells, surface = self._surface(index, n_points)
        n_cells = len(cells.types)
        moving: list[str] = []
        at_points, at_cells = (
            list(self._arrays(index, center, moving)) for center in ("node", "cell")
        )
        note_moving(self._notes, moving)
        self._note_left_out(index)
        return surface_of_arrays(at_points, at_cells, n_points, n_cells, surface, self._notes)

    def _note_left_out(self, index: int) -> None:
        attributes = self._steps[index].findall("Attribute")
        others = [one for one in attributes if _center(one) not in ("node", "cell")]
        note_kinds(
            self._notes,
            "data that are not of nodes or cells",
            (one.get("Name", "") for one in others),
        )
        sets = (one.get("Name", "(unnamed)") for one in self._steps[index].findall("Set"))
        note_kinds(self._notes, "sets", sets)

    def _element(self, index: int, tag: str) -> Element:
        """Geometry or topology of a step, which may be that of another grid, included."""
        step = self._steps[index]
        found = step.find(tag)
        include = [child for child in step if local_name(child) == "include"]
        if found is None and include:
            if include[0].get("href"):
                raise FormatError(f"includes {include[0].get('href')!r}, which is not read")
            found = self._root.find(f".//Grid/{tag}")
        if found is None:
            raise FormatError(f"has a grid {step.get('Name', '')!r} without {tag}")
        return self._items.resolved(found)

    def _points(self, index: int) -> Vertices:
        geometry = self._element(index, "Geometry")
        kind = (geometry.get("GeometryType") or geometry.get("Type") or "XYZ").upper()
        if kind == "X_Y_Z":
            columns = [self._items.read(item).ravel() for item in geometry.findall("DataItem")]
            if len(columns) != 3 or len({len(column) for column in columns}) != 1:
                raise FormatError("has a Geometry of X_Y_Z without three columns of one length")
            values = np.stack(columns, axis=1)
        elif kind in ("XYZ", "XY"):
            values = self._items.read(self._items.item_of(geometry))
            if values.size % len(kind):
                raise FormatError(f"has a Geometry of {values.size} numbers, of type {kind}")
            values = values.reshape(-1, len(kind))
        else:
            raise FormatError(f"has a Geometry of type {kind[:40]!r}; XYZ, XY and X_Y_Z are read")
        if values.dtype not in (np.float32, np.float64):
            values = values.astype(np.float64)
        return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))

    def _surface(self, index: int, n_points: int) -> tuple[Cells, CellSurface]:
        """The cells of a step and their surface; those of the step before are kept."""
        topology = self._element(index, "Topology")
        item = self._items.item_of(topology)
        key = self._items.key(item), tuple(topology.attrib.items()), n_points
        if self._cached is None or self._cached[0] != key:
            name = topology.get("TopologyType") or topology.get("Type") or ""
            width = topology.get("NodesPerElement", "0")
            cells = read_cells(name, self._items.read(item), int(width) if width.isdecimal() else 0)
            self._cached = key, cells, find_surface(cells, n_points)
        return self._cached[1:]

    def _arrays(self, index: int, center: str, moving: list[str]) -> Iterator[DataArray]:
        """Data that all steps have alike; names of others are added to `moving`."""
        for attribute in self._steps[index].findall("Attribute"):
            name = attribute.get("Name", "")
            if _center(attribute) != center:
                continue
            key = self._key(index, name)
            if any(self._key(other, name) != key for other in range(len(self._steps))):
                moving.append(name)
                continue
            values = self._items.read(self._items.item_of(attribute))
            yield DataArray(name, values)

    def _key(self, index: int, name: str) -> Any:
        attributes = self._steps[index].findall("Attribute")
        return [
            self._items.key(self._items.item_of(a)) for a in attributes if a.get("Name") == name
        ]


def _center(attribute: Element) -> str:
    """The domain of the values of an Attribute."""
    return attribute.get("Center", "Node").lower()
