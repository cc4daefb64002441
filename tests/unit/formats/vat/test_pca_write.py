"""Writing folders of PCA textures, and playing their files."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.options import WriteOptions
from meshreel.formats.save import save
from meshreel.formats.vat.pca.texture import read_header, section_offsets
from meshreel.formats.vat.textures import read_texture
from samples.vat_player import read_glb

pytest.importorskip("imagecodecs")


def saved(sequence, folder, **options):
    """Return the files of a folder, and the notes of writing it."""
    notes = []
    files = save(sequence, folder, options=WriteOptions(layout="pca", **options), notes=notes)
    return files, notes


def played_positions(files):
    """Return the positions of all frames, of shape (T, V, 3), from the files alone."""
    mesh, texture, _ = files
    texels = read_texture(texture)
    header = read_header(texels)
    attributes, _, _ = read_glb(mesh)
    rest = attributes["POSITION"]
    column, row = attributes["TEXCOORD_1"].T.astype(int)
    slice_texels = texels.shape[1] * header.slice_rows
    offsets = section_offsets(texels, header, header.positions, slice_texels)
    verts = row * texels.shape[1] + column
    return np.stack([rest + offsets.frame(t)[verts] for t in range(header.n_frames)])


@pytest.fixture(scope="module")
def flag():
    return meshreel.simulate_flag(24, n_rows=9, n_columns=12)


@pytest.mark.parametrize("max_error", [1.0, 0.05])
def test_files_play_within_the_bound_and_state_their_error(flag, tmp_path, max_error):
    files, notes = saved(flag, tmp_path / "walk.vat", max_error=max_error)
    extent = flag.extent
    error = np.linalg.norm(played_positions(files) - flag.vertices, axis=2).max()
    percent = 100 * error / np.linalg.norm(extent.high - extent.low)
    [stated] = [one for one in (re.search(r"largest error is (\S+) %", n) for n in notes) if one]
    assert percent <= max_error
    assert float(stated[1]) == pytest.approx(percent, rel=0.01)
    stored = json.loads(files[2].read_text())["largest_error"]
    assert stored == pytest.approx(error, rel=1e-3)


def test_static_sequence_is_its_rest_mesh(flag, tmp_path):
    static = replace(flag, vertices=np.repeat(flag.vertices[:1], 3, axis=0))
    files, _ = saved(static, tmp_path / "static.vat")
    np.testing.assert_array_equal(played_positions(files), static.vertices.astype(np.float32))


def test_single_frame_is_written(flag, tmp_path):
    files, _ = saved(replace(flag, vertices=flag.vertices[:1]), tmp_path / "one.vat")
    assert np.linalg.norm(played_positions(files) - flag.vertices[:1], axis=2).max() < 1e-6


def test_normals_are_left_out_or_their_error_is_noted(flag, tmp_path):
    files, notes = saved(flag, tmp_path / "without.vat", normals=False)
    assert json.loads(files[2].read_text())["normals"] is False
    assert not any("normals" in note for note in notes)
    files, notes = saved(flag, tmp_path / "with.vat")
    assert json.loads(files[2].read_text())["normals"] is True
    [angle] = [
        one for one in (re.search(r"error of normals is (\S+) deg", n) for n in notes) if one
    ]
    assert float(angle[1]) < 6


def test_only_animated_normals_have_fields(flag, tmp_path):
    angles = np.linspace(0, np.pi / 2, 24)
    rotations = np.array(
        [[[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]] for a in angles]
    )
    rotated = replace(flag, vertices=np.einsum("tij,vj->tvi", rotations, flag.vertices[0]))
    files, notes = saved(rotated, tmp_path / "rotated.vat")
    assert read_header(read_texture(files[1])).normals.n_slices > 0
    [angle] = [
        one for one in (re.search(r"error of normals is (\S+) deg", n) for n in notes) if one
    ]
    assert float(angle[1]) < 6
    files, _ = saved(replace(flag, vertices=flag.vertices[:1]), tmp_path / "one.vat")
    assert read_header(read_texture(files[1])).normals.n_slices == 0


def test_choice_of_textures_is_rejected_for_pca(flag, tmp_path):
    with pytest.raises(InvalidInputError, match="no effect on the layout pca"):
        saved(flag, tmp_path / "walk.vat", textures="exr")
    assert not (tmp_path / "walk.vat").exists()


def test_error_bound_below_float32_is_rejected(flag, tmp_path):
    with pytest.raises(InvalidInputError, match="PCA textures"):
        saved(flag, tmp_path / "walk.vat", max_error=1e-7)
    assert not (tmp_path / "walk.vat").exists()
