"""Files of whole sequences, which have one frame each, as the frames of one."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError
from meshreel.formats.inspection import inspect_source
from meshreel.formats.options import ReadOptions
from samples.meshes import waving_grid


def test_glb_files_of_one_frame_each_become_a_sequence(tmp_path):
    sequence = waving_grid(5)
    for number in range(5):
        meshreel.save(
            sequence[number : number + 1], tmp_path / f"f_{number}.glb", compression=False
        )
    loaded = meshreel.load(str(tmp_path / "f_*.glb"), fps=12)
    assert (loaded.n_frames, loaded.fps, loaded.name) == (5, 12, tmp_path.name)
    np.testing.assert_allclose(loaded.vertices, sequence.vertices, atol=1e-4)
    assert meshreel.load(str(tmp_path / "f_*.glb")).fps == 0
    info = inspect_source(str(tmp_path / "f_*.glb"), ReadOptions())
    assert (info.n_files, [mesh.n_frames for mesh in info.meshes]) == (5, [5])


def test_faces_may_differ_between_files(tmp_path):
    meshreel.save(waving_grid(1), tmp_path / "f_0.glb")
    meshreel.save(meshreel.simulate_flag(1, n_rows=4, n_columns=5), tmp_path / "f_1.glb")
    loaded = meshreel.load([tmp_path / "f_0.glb", tmp_path / "f_1.glb"])
    assert [segment.n_frames for segment in loaded.segments] == [1, 1]


def test_files_of_several_frames_are_refused_by_name(tmp_path):
    meshreel.save(waving_grid(1), tmp_path / "a.glb")
    meshreel.save(waving_grid(3).replace(fps=24.0), tmp_path / "b.glb")
    with pytest.raises(FormatError, match=r"b\.glb has 3 frames; files that are read together"):
        meshreel.load([tmp_path / "a.glb", tmp_path / "b.glb"])
