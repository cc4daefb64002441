"""Arrays beside the positions that are tracks, in NumPy archives and HDF5 files."""

import contextlib
import pickle

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError, MeshReelError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load, open_source
from meshreel.formats.save import save, save_part
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track, TrackKind
from samples.datasets import damaged_versions
from samples.meshes import quad_sheet, waving_grid
from samples.tracks import assert_same_tracks, tracked_sheet

GRID = waving_grid(5)  # 99 vertices, 160 faces, 480 corners
RNG = np.random.default_rng(1)


def store(path, **arrays):
    """A file of arrays by name, made by the owner of its format."""
    arrays = {"vertices": GRID.vertices, "faces": GRID.faces, "fps": 25.0} | arrays
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, array in arrays.items():
                file[name] = array
    return path


@pytest.mark.parametrize("ending", ["npz", "h5"])
@pytest.mark.parametrize("n_frames", [1, 6])
@pytest.mark.parametrize("read", [load, open_source])
def test_tracks_come_back_bit_for_bit_when_they_were_saved(tmp_path, ending, n_frames, read):
    pytest.importorskip("h5py")
    sheet, notes = tracked_sheet(n_frames), []
    [path] = save(sheet, tmp_path / f"a.{ending}", notes=notes)
    found = read(path, notes=notes)
    assert isinstance(found, StoredFrames) == (read is open_source)
    assert_same_tracks(found.tracks, sheet.tracks)
    assert notes == []


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_tracks_of_chosen_frames_are_saved_when_only_these_are(tmp_path, ending):
    pytest.importorskip("h5py")
    sheet = tracked_sheet()
    [path] = save_part(sheet, range(2, 5), tmp_path / f"a.{ending}")
    found = load(path).tracks["step_corner"].values
    assert found.tobytes() == sheet.tracks["step_corner"].values[2:5].tobytes()


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_file_has_no_more_in_it_when_a_sequence_has_no_tracks(tmp_path, ending):
    h5py = pytest.importorskip("h5py")
    [path] = save(GRID, tmp_path / f"a.{ending}")
    names = set(np.load(path).files) if ending == "npz" else set(h5py.File(path))
    assert names == {"vertices", "faces", "fps", "name"}


def test_plain_numpy_reads_a_track_by_its_name_when_it_was_saved(tmp_path):
    heat = RNG.normal(size=(5, 99))
    sequence = type(GRID)(GRID.vertices, GRID.faces, tracks={"heat": heat})
    [path] = save(sequence, tmp_path / "a.npz")
    with np.load(path) as arrays:
        assert np.array_equal(arrays["tracks/heat"], heat[..., None])


def test_h5py_reads_a_track_with_its_unit_when_it_was_saved(tmp_path):
    h5py = pytest.importorskip("h5py")
    heat = Track(RNG.normal(size=(5, 99)), unit="K")
    [path] = save(type(GRID)(GRID.vertices, GRID.faces, tracks={"heat": heat}), tmp_path / "a.h5")
    with h5py.File(path) as file:
        assert file["tracks/heat"].attrs["unit"] == "K"
        assert np.array_equal(file["tracks/heat"], heat.values)


@pytest.mark.parametrize("ending", ["npz", "h5"])
@pytest.mark.parametrize("read", [load, open_source])
@pytest.mark.parametrize(
    ("shape", "domain", "kind"),
    [
        ((5, 99), Domain.VERTEX, TrackKind.SCALAR),
        ((5, 160), Domain.FACE, TrackKind.SCALAR),
        ((5, 480, 2), Domain.CORNER, TrackKind.VECTOR),
        ((5, 99, 3), Domain.VERTEX, TrackKind.VECTOR),
        ((5, 99, 9), Domain.VERTEX, TrackKind.OTHER),
    ],
)
def test_array_is_a_track_when_its_size_is_that_of_vertices_faces_or_corners(
    tmp_path, ending, read, shape, domain, kind
):
    values = RNG.normal(size=shape).astype(">f4")
    path = store(tmp_path / f"a.{ending}", stress=values)
    track = read(path).tracks["stress"]
    assert (track.domain, track.kind, track.dtype) == (domain, kind, np.dtype("=f4"))
    assert np.array_equal(track.read(0, 5), values.reshape(5, shape[1], -1))


@pytest.mark.parametrize(("given", "read_as"), [(np.float16, np.float32), (np.bool_, np.uint8)])
def test_numbers_are_the_same_when_tracks_do_not_have_their_type(tmp_path, given, read_as):
    values = RNG.integers(0, 2, (5, 99)).astype(given)
    track = open_source(store(tmp_path / "a.npz", flag=values)).tracks["flag"]
    assert track.dtype == read_as
    assert np.array_equal(track.read(1, 3)[..., 0], values[1:3])


@pytest.mark.parametrize("ending", ["npz", "h5"])
@pytest.mark.parametrize(
    ("shape", "dtype"),
    [((4, 99), "f4"), ((5, 98), "f4"), ((5, 99, 257), "f4"), ((99,), "f4"), ((5, 99), "S3")],
)
def test_array_is_named_with_what_it_would_have_to_be_when_it_fits_nothing(
    tmp_path, ending, shape, dtype
):
    notes = []
    found = load(store(tmp_path / f"a.{ending}", odd=np.zeros(shape, dtype)), notes=notes)
    assert not found.tracks
    assert notes == [
        "left out: arrays: odd; tracks are numbers of shape (5, N) or (5, N, C), C up to 256, "
        "for 99 vertices, 160 faces and 480 corners"
    ]


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_error_names_both_arrays_when_two_have_the_name_of_one_track(tmp_path, ending):
    heat = np.zeros((5, 99))
    path = store(tmp_path / f"a.{ending}", heat=heat, **{"tracks/heat": heat})
    with pytest.raises(InvalidInputError, match="'heat' twice, as 'heat' and 'tracks/heat'"):
        load(path)


def test_positions_are_those_of_the_dataset_when_another_array_has_their_shape(tmp_path):
    values = RNG.normal(size=(5, 99, 3))
    path = store(tmp_path / "a.npz", other=values)
    found = load(path, dataset="other")
    assert np.array_equal(found.vertices, values)
    assert np.array_equal(found.tracks["vertices"].values, GRID.vertices)


def test_unit_is_that_of_the_file_when_another_program_says_units(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = store(tmp_path / "a.h5", heat=np.zeros((5, 99)))
    with h5py.File(path, "a") as file:
        file["heat"].attrs["units"] = "K"
        file["heat"].attrs["kind"] = "velocity"  # which needs three numbers
    track = load(path).tracks["heat"]
    assert (track.unit, track.kind) == ("K", TrackKind.SCALAR)


def test_positions_are_found_when_tracks_of_their_shape_are_in_the_folder_of_tracks(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["scan"], file["faces"] = GRID.vertices, GRID.faces
        file["tracks/flow"] = RNG.normal(size=GRID.vertices.shape)
    found = load(tmp_path / "a.h5")
    assert np.array_equal(found.vertices, GRID.vertices)
    assert list(found.tracks) == ["flow"]


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_track_is_read_in_another_process_when_its_file_is_an_archive(tmp_path, write):
    heat = RNG.normal(size=(5, 99))
    write(tmp_path / "heat.npz", heat=heat)
    path = store(tmp_path / "a.npz", heat=heat)
    sent = pickle.loads(pickle.dumps(open_source(path)))
    assert np.array_equal(sent.tracks["heat"].read(3, 5)[..., 0], heat[3:5])


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_positions_are_left_in_the_file_when_tracks_make_it_large(tmp_path, ending):
    path = store(tmp_path / f"a.{ending}", heat=np.zeros((5, 99, 20), np.float32))
    most = GRID.vertices.nbytes + 100
    assert isinstance(open_source(path, max_loaded_bytes=most), StoredFrames)
    assert not isinstance(open_source(path, max_loaded_bytes=10 * most), StoredFrames)


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_reading_says_that_the_file_changed_when_values_of_a_track_did(tmp_path, ending):
    path = store(tmp_path / f"a.{ending}", heat=np.full((5, 99, 200), 1.25))
    track = open_source(path).tracks["heat"]
    track.read(0, 5)
    data, number = path.read_bytes(), np.float64(1.25).tobytes()
    at = data.rindex(number)
    with path.open(
        "r+b"
    ) as file:  # in place, for the library holds the file open; too large for its buffer
        file.seek(at)
        file.write(np.float64(2.5).tobytes())
    with pytest.raises(InvalidInputError, match=r"a\.(npz|h5) \(frame 4\) changed"):
        track.read(0, 5)


def test_error_says_which_array_is_missing_when_a_described_track_is(tmp_path):
    [path] = save(tracked_sheet(), tmp_path / "a.npz")
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays.files if name != "tracks/flow_face"}
    np.savez(path, **kept)
    with pytest.raises(FormatError, match="no array 'tracks/flow_face', which others speak of"):
        load(path)
    np.savez(path, **kept | {"track_kinds": np.array(["scalar"])})
    with pytest.raises(FormatError, match="they must be as many"):
        load(path)


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_damaged_files_with_tracks_are_read_or_refused_when_bytes_are_wrong(tmp_path, ending):
    pytest.importorskip("h5py")
    [path] = save(tracked_sheet(2), tmp_path / f"a.{ending}")
    for data in damaged_versions(path.read_bytes(), n_damaged=40):
        path.write_bytes(data)
        for read in (load, open_source):
            with contextlib.suppress(MeshReelError):
                found = read(path)
                for track in found.tracks.values():
                    assert track.read(0, found.n_frames).shape == (found.n_frames, *track.shape[1:])


@pytest.mark.parametrize("ending", ["off", "stl", "glb", "pc2", "mdd"])
def test_writing_names_the_tracks_when_the_format_holds_none(tmp_path, ending):
    sheet, notes = tracked_sheet(1, ("vertex",)), []
    output = tmp_path / f"a.{ending}"
    save(sheet, output, notes=notes)
    names = "heat of vertex/s, flow_vertex, shade_vertex, step_vertex, tensor_vertex"
    assert f"tracks left out: {names}: .{ending} does not hold them" in notes
    assert not any("tracks left out" in note for note in notes_of(quad_sheet(1), output))


def notes_of(sequence, output):
    notes = []
    save(sequence, output, notes=notes, overwrite=True)
    return notes
