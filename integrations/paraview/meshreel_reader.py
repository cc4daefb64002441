"""A plug-in of ParaView that reads `.reel` files: Tools, Manage Plugins, Load New.

The output has the cells of the file, or its faces; tracks and attributes are arrays of points and
cells. Only the requested frame is decoded.
"""

# ruff: noqa: N802 - names of VTK
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

import meshreel
from meshreel.formats.surfaces.cells import written_cells


class _NoDecorators:
    """Decorators without effect."""

    def __getattr__(self, name: str) -> Any:
        return self

    def __call__(self, **_: Any) -> Any:
        return lambda item: item


decorators: Any = _NoDecorators()
with suppress(ImportError):  # VTK without ParaView
    decorators = import_module("paraview.util.vtkAlgorithm")

FILES = {"extensions": "reel", "file_description": "Meshreel"}


@decorators.smproxy.reader(name="MeshreelReader", label="Meshreel Reader", **FILES)
class MeshreelReader(VTKPythonAlgorithmBase):
    """Reads the frames of a `.reel` file as unstructured grids."""

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkUnstructuredGrid")
        self._path = ""
        self._reel: meshreel.ReelFile | None = None
        self._mesh: tuple[int, Any] | None = None

    @decorators.smproperty.stringvector(name="FileName")
    @decorators.smdomain.filelist()
    @decorators.smhint.filechooser(**FILES)
    def SetFileName(self, path: str) -> None:
        """Set the path of the file."""
        if path != self._path:
            if self._reel is not None:
                self._reel.close()
            self._path, self._reel, self._mesh = path, None, None
            self.Modified()

    @decorators.smproperty.doublevector(
        name="TimestepValues", information_only="1", si_class="vtkSITimeStepsProperty"
    )
    def GetTimestepValues(self) -> list[float]:
        """Return the time of each frame in seconds; its number if the frame rate is unknown."""
        if not self._path:
            return []
        if self._reel is None:
            self._reel = meshreel.open(self._path)
        times = self._reel.times
        return list(map(float, range(len(self._reel)) if times is None else times))

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the times."""
        times, info = self.GetTimestepValues(), outputs.GetInformationObject(0)
        if not times:
            return 0
        info.Set(Pipeline.TIME_STEPS(), times, len(times))
        info.Set(Pipeline.TIME_RANGE(), [times[0], times[-1]], 2)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Decode the last frame that is due at the requested time."""
        times, reel = self.GetTimestepValues(), self._reel
        assert reel is not None
        time = outputs.GetInformationObject(0).Get(Pipeline.UPDATE_TIME_STEP()) or 0.0
        frame = max(0, int(np.searchsorted(times, time, "right")) - 1)
        number = int(np.searchsorted(reel.starts, frame, "right")) - 1
        segment, at = reel.segments[number], frame - reel.starts[number]
        if self._mesh is None or self._mesh[0] != number:
            self._mesh = number, _mesh(segment)
        output, points = vtkUnstructuredGrid.GetData(outputs, 0), vtkPoints()
        output.ShallowCopy(self._mesh[1])
        points.SetData(numpy_to_vtk(segment.read(at, at + 1)[0], deep=True))
        output.SetPoints(points)
        for name, track in segment.tracks.items():
            _add_array(output, segment, track.domain, name, track[at])
        output.GetInformation().Set(output.DATA_TIME_STEP(), times[frame])
        return 1


def _mesh(segment: meshreel.ReelFile) -> vtkUnstructuredGrid:
    """Return the cells of a segment, or its faces, with the attributes; warn of all else."""
    mesh, lists, surface = vtkUnstructuredGrid(), vtkCellArray(), segment.surface
    cells = written_cells(segment.faces, surface)
    ends = np.concatenate([[0], np.cumsum(cells.counts)])
    lists.SetData(numpy_to_vtk(ends, deep=True), numpy_to_vtk(cells.points, deep=True))
    mesh.SetCells(numpy_to_vtk(cells.types.astype(np.uint8), deep=True), lists)
    for row in surface.attributes:
        _add_array(mesh, segment, row.domain, row.name, row.values)
    all_rows: tuple[Any, ...] = (*segment.tracks.values(), *surface.attributes)
    unread = [row.name for row in all_rows if row.domain not in _data(mesh, segment)]
    if names := [*unread, *(groups.name for groups in surface.groups)]:
        text = f"left out, as it fits neither points nor cells: {', '.join(names)}\n"
        vtkOutputWindow.GetInstance().DisplayWarningText(text)
    return mesh


def _data(mesh: Any, segment: meshreel.ReelFile) -> dict[str, Any]:
    """Return the arrays of each domain that a mesh has."""
    cell_domain = "face" if segment.surface.cells is None else "cell"
    return {"vertex": mesh.GetPointData(), cell_domain: mesh.GetCellData()}


def _add_array(mesh: Any, segment: meshreel.ReelFile, domain: str, name: str, values: Any) -> None:
    if (data := _data(mesh, segment).get(domain)) is not None:
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        data.AddArray(array)
