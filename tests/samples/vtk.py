"""Sample meshes built with VTK, for tests of files that VTK writes."""

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkUnstructuredGrid

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
