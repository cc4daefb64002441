"""Writing folders of vertex animation textures: file names, options and existing files."""

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
def test_files_are_named_after_the_folder(tmp_path, layout, output):
    options = WriteOptions(layout=layout)
    written = meshreel.save(waving_grid(), f"{tmp_path}/{output}", options=options)
    assert sorted(one.name.lower() for one in written) == sorted(NAMES[layout])
    assert sorted(written) == sorted(tmp_path.glob("*/*"))


def test_existing_files_are_replaced_only_with_overwrite(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    before = {one: one.read_bytes() for one in (tmp_path / "walk.vat").iterdir()}
    with pytest.raises(InvalidInputError, match="already exists"):
        meshreel.save(waving_grid(3), tmp_path / "walk.vat")
    assert {one: one.read_bytes() for one in (tmp_path / "walk.vat").iterdir()} == before
    meshreel.save(waving_grid(3), tmp_path / "walk.vat", overwrite=True)
    after = (tmp_path / "walk.vat" / "walk_vat.exr").read_bytes()
    assert after != before[tmp_path / "walk.vat" / "walk_vat.exr"]


def test_textures_of_another_kind_are_not_added_to_a_folder(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(
        InvalidInputError, match=r"must not be mixed with the output: walk_vat\.exr"
    ):
        meshreel.save(
            waving_grid(), tmp_path / "walk.vat", overwrite=True,
            options=WriteOptions(textures="png"),
        )  # fmt: skip
    (tmp_path / "walk.vat" / "walk_vat.exr.import").touch()  # files that engines add are ignored
    meshreel.save(waving_grid(), tmp_path / "walk.vat", overwrite=True)


@pytest.mark.parametrize(
    ("output", "options", "message"),
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
def test_invalid_options_are_rejected_before_writing(tmp_path, output, options, message):
    with pytest.raises(InvalidInputError, match=message):
        check_output(tmp_path / output, overwrite=False, options=WriteOptions(**options))
    assert not list(tmp_path.iterdir())


def test_start_number_and_a_file_at_the_folder_path_are_rejected(tmp_path):
    with pytest.raises(InvalidInputError, match="--start-number"):
        check_output(tmp_path / "a.vat", overwrite=False, start_number=3)
    (tmp_path / "a.vat").touch()
    with pytest.raises(InvalidInputError, match="is a file; name a folder"):
        check_output(tmp_path / "a.vat", overwrite=True)


def test_folder_cannot_be_loaded(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(FormatError, match=r"contains no frames .* it contains walk\.glb"):
        meshreel.load(tmp_path / "walk.vat")


def test_folder_without_normals_has_no_normal_texture(tmp_path):
    options = WriteOptions(layout="labs", normals=False)
    meshreel.save(waving_grid(), tmp_path / "walk.vat", options=options)
    assert not list((tmp_path / "walk.vat").glob("*_rot*"))


def test_lost_tracks_and_the_assumed_frame_rate_are_noted(tmp_path):
    grid = waving_grid()
    heat = Track(np.zeros((12, grid.n_verts), np.float32))
    sequence = MeshSequence(grid.vertices, grid.faces, 0.0, "walk", tracks={"heat": heat})
    notes = []
    meshreel.save(sequence, tmp_path / "walk.vat", notes=notes)
    assert "tracks left out: heat: .vat cannot store them" in notes
    assert "the frame rate is unknown; written as 24 fps" in notes


@pytest.mark.slow
def test_textures_of_a_stream_use_the_rest_of_its_error_bound(tmp_path):
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
