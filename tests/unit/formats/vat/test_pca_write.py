"""Folders of PCA textures, as a player of the files sees them."""

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


def written(sequence, folder, **options):
    """The files of a folder, and what was said of them."""
    notes = []
    files = save(sequence, folder, options=WriteOptions(layout="pca", **options), notes=notes)
    return files, notes


def played(files):
    """Positions of every frame, of shape (T, V, 3): vertices of the file find their texels."""
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
def test_files_play_within_the_error_that_was_asked_for_and_is_stated(flag, tmp_path, max_error):
    files, notes = written(flag, tmp_path / "walk.vat", max_error=max_error)
    extent = flag.extent
    far = np.linalg.norm(played(files) - flag.vertices, axis=2).max()
    percent = 100 * far / np.linalg.norm(extent.high - extent.low)
    [stated] = [one for one in (re.search(r"largest error is (\S+) %", n) for n in notes) if one]
    assert percent <= max_error
    assert float(stated[1]) == pytest.approx(percent, rel=0.01)
    told = json.loads(files[2].read_text())["largest_error"]
    assert told == pytest.approx(far, rel=1e-3)


def test_a_sequence_that_stands_still_is_its_mesh(flag, tmp_path):
    still = replace(flag, vertices=np.repeat(flag.vertices[:1], 3, axis=0))
    files, _ = written(still, tmp_path / "still.vat")
    np.testing.assert_array_equal(played(files), still.vertices.astype(np.float32))


def test_a_single_frame_is_written(flag, tmp_path):
    files, _ = written(replace(flag, vertices=flag.vertices[:1]), tmp_path / "one.vat")
    assert np.linalg.norm(played(files) - flag.vertices[:1], axis=2).max() < 1e-6


def test_normals_are_left_out_or_stated(flag, tmp_path):
    files, notes = written(flag, tmp_path / "without.vat", normals=False)
    assert json.loads(files[2].read_text())["normals"] is False
    assert not any("normals" in note for note in notes)
    files, notes = written(flag, tmp_path / "with.vat")
    assert json.loads(files[2].read_text())["normals"] is True
    [angle] = [one for one in (re.search(r"normals are off by (\S+) deg", n) for n in notes) if one]
    assert float(angle[1]) < 6


def test_normals_that_turn_have_fields_and_others_none(flag, tmp_path):
    angles = np.linspace(0, np.pi / 2, 24)
    turns = np.array(
        [[[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]] for a in angles]
    )
    turned = replace(flag, vertices=np.einsum("tij,vj->tvi", turns, flag.vertices[0]))
    files, notes = written(turned, tmp_path / "turned.vat")
    assert read_header(read_texture(files[1])).normals.n_slices > 0
    [angle] = [one for one in (re.search(r"normals are off by (\S+) deg", n) for n in notes) if one]
    assert float(angle[1]) < 6
    files, _ = written(replace(flag, vertices=flag.vertices[:1]), tmp_path / "one.vat")
    assert read_header(read_texture(files[1])).normals.n_slices == 0


def test_kinds_of_textures_are_refused_for_there_is_one(flag, tmp_path):
    with pytest.raises(InvalidInputError, match="no effect on the layout pca"):
        written(flag, tmp_path / "walk.vat", textures="exr")
    assert not (tmp_path / "walk.vat").exists()


def test_an_error_that_cannot_be_kept_is_refused(flag, tmp_path):
    with pytest.raises(InvalidInputError, match="PCA textures"):
        written(flag, tmp_path / "walk.vat", max_error=1e-7)
    assert not (tmp_path / "walk.vat").exists()
