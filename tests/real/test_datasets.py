"""Real sequences round-trip through point caches, HDF5 and VTKHDF."""

import os
from pathlib import Path

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from samples.opening import open_source

pytestmark = pytest.mark.real


@pytest.fixture(scope="module", params=["horse_gallop", "chicken"])
def sequence(request):
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA is not set")
    whole = load(Path(folder) / f"{request.param}.npz")
    return MeshSequence(whole.vertices[:40], whole.faces, 29.97, whole.name, 1.5)


@pytest.mark.parametrize("extension", ["npz", "h5", "vtkhdf"])
def test_single_file_formats_round_trip_exactly(tmp_path, sequence, extension):
    [path] = save(sequence, tmp_path / f"a.{extension}")
    for found in (load(path), open_source(path)):
        assert found.read(0, 40).tobytes() == sequence.vertices.tobytes()
        np.testing.assert_array_equal(found.faces, sequence.faces)
        assert (found.fps, found.start_s, found.name) == (29.97, 1.5, sequence.name)


@pytest.mark.parametrize("extension", ["pc2", "mdd"])
def test_point_caches_round_trip_positions_exactly(tmp_path, sequence, extension):
    path, topology = save(sequence, tmp_path / f"a.{extension}")
    for found in (load(path, topology=topology), open_source(path, topology=topology)):
        assert found.read(0, 40).tobytes() == sequence.vertices.tobytes()
        np.testing.assert_array_equal(found.faces, sequence.faces)
        assert found.fps == {"pc2": 0, "mdd": 29.97}[extension]


def test_vtk_reads_exact_positions_from_our_vtkhdf(tmp_path, sequence):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    save(sequence, tmp_path / "a.vtkhdf")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    for step in (0, 17, 39):
        reader.UpdateInformation()
        reader.SetStep(step)
        reader.Update()
        points = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
        assert points.tobytes() == sequence.vertices[step].tobytes()
