"""Real sequences round-trip through files of every format, and as other programs read them."""

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.operations.save import save
from samples.opening import open_source

pytestmark = pytest.mark.real

FRAMES = ("obj", "ply", "off", "stl")
"""Formats of single frames, without a frame rate."""

WHOLE = ("npz", "h5", "vtkhdf", "pc2", "mdd")
SCENES = ("abc", "usd", "usda", "usdc", "usdz")


@pytest.fixture(scope="module", params=["horse_gallop", "chicken", "samba"])
def sequence(request, sequence_named):
    return sequence_named(request.param, 40).replace(fps=29.97, start_s=1.5)


@pytest.mark.parametrize("extension", [*FRAMES, *WHOLE])
def test_sequences_round_trip_exactly(tmp_path, sequence, extension):
    name = f"a_%04d.{extension}" if extension in FRAMES else f"a.{extension}"
    path, *_ = save(sequence, tmp_path / name)
    for read in (load, open_source):
        result = read(tmp_path / "*" if extension in FRAMES else path)
        vertices = result.read(0, 40)
        if extension == "stl":
            assert result.n_verts <= sequence.n_verts
            corners = sequence.vertices[:, sequence.faces]
            np.testing.assert_array_equal(vertices[:, result.faces], corners)
            continue
        assert (vertices.dtype, vertices.tobytes()) == (sequence.dtype, sequence.vertices.tobytes())
        np.testing.assert_array_equal(result.faces, sequence.faces)
        assert result.fps == (0 if extension in (*FRAMES, "pc2") else 29.97)
        if extension in ("npz", "h5", "vtkhdf"):
            assert (result.start_s, result.name) == (1.5, sequence.name)


@pytest.mark.parametrize("extension", SCENES)
@pytest.mark.parametrize("name", ["bone.abc", "balloons.abc", "cesium_man.usdz"])
def test_scenes_of_other_programs_round_trip_exactly(tmp_path, existing, name, extension):
    given, notes = load(existing(f"native/{name}")), []
    save(given, tmp_path / f"x.{extension}", notes=notes)
    loaded = load(tmp_path / f"x.{extension}")
    np.testing.assert_array_equal(loaded.vertices, given.vertices)
    np.testing.assert_array_equal(loaded.faces, given.faces)
    np.testing.assert_array_equal(loaded.surface.face_sizes, given.surface.face_sizes)
    assert (loaded.fps, loaded.start_s) == (given.fps, given.start_s)
    assert name.endswith("abc") or extension == "abc" or notes == []
    for back, attribute in zip(loaded.surface.attributes, given.surface.attributes, strict=True):
        assert back.domain == attribute.domain
        np.testing.assert_array_equal(back.per_item(), attribute.per_item())


@pytest.mark.parametrize("name", ["cesium_man.glb", "cesium_man.usdz"])
def test_walks_are_sampled_between_their_frames_and_read_on_demand(existing, name):
    path = existing(f"native/{name}")
    walk, finer = load(path), load(path, fps=48)
    assert (finer.n_frames, finer.fps, finer.start_s) == (95, 48, walk.start_s)
    np.testing.assert_array_equal(finer.vertices[::2], walk.vertices)
    opened = open_source(path)
    assert opened.read(0, walk.n_frames).tobytes() == walk.vertices.tobytes()
    assert opened.read(30, 31).tobytes() == walk.vertices[30:31].tobytes()


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
