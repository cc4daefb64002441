"""Sample meshes built with VTK, for tests of files that VTK writes."""

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

CORNERS = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0.5), (5, 0), (4, 1), (3, 1), (3, -1), (4, -1)]
POINTS = 0.1 * np.random.default_rng(5).standard_normal((10, 3)) + np.pad(CORNERS, ((0, 0), (0, 1)))
POLYGONS = ([0, 1, 2, 3], [1, 4, 2], [5, 6, 7, 8, 9])
UV = np.random.default_rng(6).random((10, 2)).astype(np.float32)
COLORS = np.arange(40, dtype=np.uint8).reshape(10, 4)
HEAT = np.array([0.1, 0.2, 0.3])


def vtk_points(points):
    result = vtkPoints()
    result.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    return result


def add_arrays(data, **arrays):
    """Add arrays by name to the data of points or cells of a VTK mesh."""
    for name, values in arrays.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        data.AddArray(array)


def add_data(mesh):
    """Add UV coordinates and colors to the points, and heat to the cells."""
    add_arrays(mesh.GetPointData(), **{"uv set": UV, "paint": COLORS})
    mesh.GetPointData().SetActiveTCoords("uv set")
    add_arrays(mesh.GetCellData(), heat=HEAT)
    return mesh


def poly_data(points=POINTS, polygons=POLYGONS):
    """A vtkPolyData with sample arrays."""
    cells = vtkCellArray()
    for polygon in polygons:
        cells.InsertNextCell(len(polygon), polygon)
    mesh = vtkPolyData()
    mesh.SetPoints(vtk_points(points))
    mesh.SetPolys(cells)
    return add_data(mesh)


CELLS = [(7, polygon) for polygon in POLYGONS]


def grid(points=POINTS, cells=CELLS):
    """A vtkUnstructuredGrid of (cell type, point ids) pairs."""
    mesh = vtkUnstructuredGrid()
    mesh.SetPoints(vtk_points(points))
    for kind, ids in cells:
        id_list = vtkIdList()
        for number in ids:
            id_list.InsertNextId(number)
        mesh.InsertNextCell(kind, id_list)
    return add_data(mesh) if len(cells) == len(HEAT) and len(points) == len(UV) else mesh


def write_mesh(writer, mesh, path):
    """Write a mesh with a VTK writer; return the path."""
    writer.SetInputData(mesh)
    writer.SetFileName(str(path))
    assert writer.Write() == 1
    return path


STEP_S = 0.5


class TimeSeries(VTKPythonAlgorithmBase):
    """A VTK source with a mesh for each time step."""

    def __init__(self, meshes):
        kind = meshes[0].GetClassName()
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType=kind)
        self.meshes = meshes

    def RequestInformation(self, request, inputs, outputs):  # noqa: N802
        times = [STEP_S * number for number in range(len(self.meshes))]
        info = outputs.GetInformationObject(0)
        info.Set(Pipeline.TIME_STEPS(), times, len(times))
        info.Set(Pipeline.TIME_RANGE(), [times[0], times[-1]], 2)
        return 1

    def RequestData(self, request, inputs, outputs):  # noqa: N802
        info = outputs.GetInformationObject(0)
        time_s = info.Get(Pipeline.UPDATE_TIME_STEP()) or 0.0
        mesh = self.meshes[round(time_s / STEP_S)]
        result = self.GetOutputData(outputs, 0)
        result.ShallowCopy(mesh)
        result.GetInformation().Set(result.DATA_TIME_STEP(), time_s)
        return 1
