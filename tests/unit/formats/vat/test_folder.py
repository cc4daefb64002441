"""Folders of vertex animation textures as outputs: names, options, and what stays untouched."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.options import WriteOptions
from meshreel.formats.outputs import check_output
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import waving_grid

NAMES = {
    "openvat": ["walk.glb", "walk_vat.exr", "walk-remap_info.json"],
    "labs": ["walk_mesh.glb", "walk_pos.exr", "walk_rot.exr", "walk_data.json"],
}


@pytest.mark.parametrize("layout", NAMES)
@pytest.mark.parametrize("output", ["walk.vat", "walk.vat/", "WALK.VAT/"])
def test_files_are_named_after_the_folder_when_saved(tmp_path, layout, output):
    options = WriteOptions(layout=layout)
    written = meshreel.save(waving_grid(), f"{tmp_path}/{output}", options=options)
    assert sorted(one.name.lower() for one in written) == sorted(NAMES[layout])
    assert sorted(written) == sorted(tmp_path.glob("*/*"))


def test_existing_files_are_kept_unless_they_may_be_replaced(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    before = {one: one.read_bytes() for one in (tmp_path / "walk.vat").iterdir()}
    with pytest.raises(InvalidInputError, match="exists and is kept"):
        meshreel.save(waving_grid(3), tmp_path / "walk.vat")
    assert {one: one.read_bytes() for one in (tmp_path / "walk.vat").iterdir()} == before
    meshreel.save(waving_grid(3), tmp_path / "walk.vat", overwrite=True)
    after = (tmp_path / "walk.vat" / "walk_vat.exr").read_bytes()
    assert after != before[tmp_path / "walk.vat" / "walk_vat.exr"]


def test_textures_of_another_kind_are_not_mixed_with_those_that_are_there(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(InvalidInputError, match=r"not to be mixed with: walk_vat\.exr"):
        meshreel.save(
            waving_grid(), tmp_path / "walk.vat", overwrite=True,
            options=WriteOptions(textures="png"),
        )  # fmt: skip
    (tmp_path / "walk.vat" / "walk_vat.exr.import").touch()  # what engines add is no matter
    meshreel.save(waving_grid(), tmp_path / "walk.vat", overwrite=True)


@pytest.mark.parametrize(
    ("output", "options", "said"),
    [
        (
            "a.vat",
            {"layout": "opengl"},
            r"--layout .* openvat, .* labs, .*; got 'opengl'",
        ),
        ("a.vat", {"textures": "tga"}, r"--textures .* exr, png; got 'tga'"),
        ("a.vat", {"targets": 3}, r"--targets .* no effect on a \.vat folder"),
        ("a.vat", {"lossless": True}, r"--lossless .* no effect on a \.vat folder"),
        ("a.vat", {"max_error": "far"}, "max_error= takes"),
        ("a.glb", {"layout": "labs"}, r"--layout .* no effect on a \.glb file; it is for \.vat"),
        ("a.npz", {"textures": "png"}, r"--textures .* it is for \.vat"),
        ("a_%d.vat", {}, "has a number field"),
    ],
)
def test_options_that_choose_nothing_there_is_are_refused_before_the_work(
    tmp_path, output, options, said
):
    with pytest.raises(InvalidInputError, match=said):
        check_output(tmp_path / output, overwrite=False, options=WriteOptions(**options))
    assert not list(tmp_path.iterdir())


def test_start_number_and_files_in_place_of_folders_are_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="--start-number"):
        check_output(tmp_path / "a.vat", overwrite=False, start_number=3)
    (tmp_path / "a.vat").touch()
    with pytest.raises(InvalidInputError, match="is a file; name a folder"):
        check_output(tmp_path / "a.vat", overwrite=True)


def test_folder_is_not_read(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(FormatError, match=r"holds no frames .* it holds walk\.glb"):
        meshreel.load(tmp_path / "walk.vat")


def test_folder_without_normals_has_no_texture_of_them(tmp_path):
    options = WriteOptions(layout="labs", normals=False)
    meshreel.save(waving_grid(), tmp_path / "walk.vat", options=options)
    assert not list((tmp_path / "walk.vat").glob("*_rot*"))


def test_tracks_and_what_is_not_known_are_said(tmp_path):
    grid = waving_grid()
    heat = Track(np.zeros((12, grid.n_verts), np.float32))
    sequence = MeshSequence(grid.vertices, grid.faces, 0.0, "walk", tracks={"heat": heat})
    notes = []
    meshreel.save(sequence, tmp_path / "walk.vat", notes=notes)
    assert "tracks left out: heat: .vat does not hold them" in notes
    assert "the frame rate is not known; written as 24 fps" in notes


@pytest.mark.slow
def test_decoded_frames_are_measured_against_what_the_stream_promises(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.reel", options=WriteOptions(max_error=0.05))
    notes = []
    with meshreel.open(tmp_path / "walk.reel") as reel:
        options = WriteOptions(max_error=0.2)
        meshreel.save(reel, tmp_path / "walk.vat", options=options, notes=notes)
        [total] = [one for one in notes if one.startswith("against the original")]
        assert float(total.split(" % ")[0].split()[-1]) <= 0.2
        options = WriteOptions(max_error=0.04)
        with pytest.raises(InvalidInputError, match="leaves nothing for textures"):
            meshreel.save(reel, tmp_path / "b.vat", options=options)
