"""Sequences and tracks among the arrays of NumPy archives and HDF5 files."""

import contextlib
import pickle
from dataclasses import replace

import numpy as np
import pytest

import samples.arrays
from meshreel.errors import FormatError, InvalidInputError, MeshReelError
from meshreel.formats.arrays.named_arrays import Layout, find_layout, has_positions
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.formats.save import save_part
from meshreel.model.surface import PLAIN, Domain
from meshreel.model.tracks import Track, TrackKind
from meshreel.operations.save import save
from samples.arrays import store
from samples.datasets import (
    assert_same_positions,
    damaged_versions,
    plain_sequence,
    positions_of,
    surfaced_sequence,
)
from samples.meshes import assert_same_surface, quad_sheet, waving_grid
from samples.opening import open_source
from samples.tracks import assert_same_tracks, tracked_sheet

FIRST, LAST = Layout.FRAMES_FIRST, Layout.FRAMES_LAST


@pytest.mark.parametrize(
    ("shape", "largest", "is_documented", "expected"),
    [
        ((7, 5, 3), 4, False, FIRST),
        ((5, 3, 7), 4, False, LAST),
        ((5, 3, 3), 4, False, LAST),  # vertex 4 needs more than three vertices
        ((5, 3, 3), 4, True, LAST),
        ((5, 3, 3), 2, False, FIRST),  # exactly three vertices, all used
        ((3, 3, 3), 2, True, FIRST),
        ((2, 3, 3), 2, False, FIRST),
    ],
)
def test_axis_of_three_or_faces_decide_the_layout(shape, largest, is_documented, expected):
    faces = np.array([[0, 1, largest]])
    assert find_layout(shape, faces, "x", is_documented=is_documented) is expected


@pytest.mark.parametrize(("shape", "largest"), [((3, 3, 3), 2), ((9, 3, 3), 1), ((2, 3, 3), 5)])
def test_ambiguous_layout_is_rejected(shape, largest):
    with pytest.raises(InvalidInputError, match=rf"up to {largest}: it may be \(T, V, 3\) or"):
        find_layout(shape, np.array([[0, 1, largest]]), "x", is_documented=False)


@pytest.mark.parametrize("shape", [(), (3,), (5, 3), (3, 5, 4), (5, 4, 2), (2, 5, 3, 3)])
def test_layout_without_an_axis_of_three_is_rejected(shape):
    with pytest.raises(
        InvalidInputError, match=r"x must have shape \(T, V, 3\) or \(V, 3, T\); got \("
    ):
        find_layout(shape, np.array([[0, 1, 2]]), "x", is_documented=True)
    assert not has_positions(shape)


FACES = np.array([[0, 1, 2], [2, 3, 4]], np.uint32)
POSITIONS = np.random.default_rng(0).random((7, 5, 3)).astype(np.float32)
NOT_FINITE = POSITIONS.copy()
NOT_FINITE[3, 2, 1] = np.nan
LIBRARY_FILE = {"npz": "a numpy archive", "h5": "an HDF5 file"}


@pytest.mark.parametrize("extension", ["npz", "h5", "hdf5", "hdf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_frames", [1, 5])
def test_sequence_round_trips_exactly(tmp_path, extension, dtype, n_frames, read, notes):
    if extension != "npz":
        pytest.importorskip("h5py")
    sequence = surfaced_sequence(n_frames, dtype, 29.97, 1 / 3, name="Ödipus/1")
    [path] = save(sequence, tmp_path / f"a.{extension}", notes=notes)
    result = read(path, notes=notes)
    assert_same_positions(result, sequence)
    assert_same_surface(result.surface, sequence.surface)
    assert (result.fps, result.start_s, result.name) == (29.97, 1 / 3, "Ödipus/1")
    assert notes == []


@pytest.mark.parametrize("fps", [0.0, 24.0, 23.98765])
def test_sequence_without_surface_round_trips(tmp_path, extension, fps):
    [path] = save(plain_sequence(fps=fps), tmp_path / f"a.{extension}")
    loaded = load(path)
    assert_same_surface(loaded.surface, PLAIN)
    assert (loaded.fps, loaded.start_s) == (fps, 0.0)
    assert load(path, fps=60).fps == 60


def test_default_name_is_the_file_stem(tmp_path, extension):
    loaded = load(store(tmp_path / f"walk.{extension}", vertices=POSITIONS, faces=FACES))
    assert (loaded.name, loaded.fps) == ("walk", 0.0)


@pytest.mark.parametrize(
    ("name", "options"), [("vertices", {}), ("50002_hips", {"dataset": "50002_hips"})]
)
def test_positions_with_frames_last_are_transposed(tmp_path, extension, read, name, options):
    scans = {name: POSITIONS.transpose(1, 2, 0), "50004_hips": np.zeros((5, 3, 2))}
    path = store(tmp_path / f"registrations_f.{extension}", faces=FACES, fps=30, **scans)
    result = read(path, **options)
    assert positions_of(result).tobytes() == POSITIONS.tobytes()
    expected = name if extension == "h5" and options else "registrations_f"
    assert (result.name, result.fps) == (expected, 30)
    np.testing.assert_array_equal(result.faces, FACES)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"vertices": POSITIONS[0]}, r"vertices must have shape \(T, V, 3\).*; got \(5, 3\)"),
        ({"vertices": POSITIONS[:0]}, "is empty|needs at least one frame; got none"),
        ({"vertices": POSITIONS.astype(np.float16)}, "vertices must be float32 or float64"),
        ({"vertices": NOT_FINITE}, "vertex 2 of frame 3 has y = nan"),
        ({"faces": FACES + 1}, r"face 1 is \[3, 4, 5\]; indices must be in 0..4"),
        ({"fps": "fast"}, "fps must be one number"),
        ({"fps": np.ones(2)}, "fps must be one number"),
    ],
)
def test_errors_explain_invalid_arrays(tmp_path, extension, arrays, message, read):
    path = store(tmp_path / f"a.{extension}", **{"vertices": POSITIONS, "faces": FACES, **arrays})
    with pytest.raises((FormatError, InvalidInputError), match=rf"a\.{extension}: .*({message})"):
        read(path)


@pytest.mark.parametrize("keep", [4, 100, 2000, -30])
def test_load_rejects_truncated_files(tmp_path, extension, keep):
    [path] = save(surfaced_sequence(), tmp_path / f"a.{extension}")
    path.write_bytes(path.read_bytes()[:keep])
    message = rf"a\.{extension}: is not {LIBRARY_FILE[extension]}, or is damaged"
    with pytest.raises(FormatError, match=message):
        load(path)


GRID = waving_grid(5)  # 99 vertices, 160 faces, 480 corners
RNG = np.random.default_rng(1)


def store_grid(path, **arrays):
    """Write the grid and other named arrays."""
    grid = {"vertices": GRID.vertices, "faces": GRID.faces, "fps": 25.0}
    return samples.arrays.store(path, **grid | arrays)


@pytest.mark.parametrize("n_frames", [1, 6])
def test_tracks_round_trip_exactly(tmp_path, extension, n_frames, read, notes):
    sheet = tracked_sheet(n_frames)
    [path] = save(sheet, tmp_path / f"a.{extension}", notes=notes)
    result = read(path, notes=notes)
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert_same_tracks(result.tracks, sheet.tracks)
    assert notes == []


@pytest.mark.slow
def test_save_part_writes_the_tracks_of_its_frames(tmp_path, extension):
    sheet = tracked_sheet()
    [path] = save_part(sheet, range(2, 5), tmp_path / f"a.{extension}")
    result = load(path).tracks["step_corner"].values
    assert result.tobytes() == sheet.tracks["step_corner"].values[2:5].tobytes()


def test_sequence_without_tracks_adds_nothing_to_the_file(tmp_path, extension):
    h5py = pytest.importorskip("h5py")
    [path] = save(GRID, tmp_path / f"a.{extension}")
    names = set(np.load(path).files) if extension == "npz" else set(h5py.File(path))
    assert names == {"vertices", "faces", "fps", "name"}


def test_numpy_reads_a_track_by_name(tmp_path):
    heat = RNG.normal(size=(5, 99))
    sequence = type(GRID)(GRID.vertices, GRID.faces, tracks={"heat": heat})
    [path] = save(sequence, tmp_path / "a.npz")
    with np.load(path) as arrays:
        assert np.array_equal(arrays["tracks/heat"], heat[..., None])


def test_h5py_reads_a_track_and_its_unit(tmp_path):
    h5py = pytest.importorskip("h5py")
    heat = Track(RNG.normal(size=(5, 99)), unit="K")
    [path] = save(type(GRID)(GRID.vertices, GRID.faces, tracks={"heat": heat}), tmp_path / "a.h5")
    with h5py.File(path) as file:
        assert file["tracks/heat"].attrs["unit"] == "K"
        assert np.array_equal(file["tracks/heat"], heat.values)


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
def test_array_size_selects_the_track_domain(tmp_path, extension, read, shape, domain, kind):
    values = RNG.normal(size=shape).astype(">f4")
    path = store_grid(tmp_path / f"a.{extension}", stress=values)
    track = read(path).tracks["stress"]
    assert (track.domain, track.kind, track.dtype) == (domain, kind, np.dtype("=f4"))
    assert np.array_equal(track.read(0, 5), values.reshape(5, shape[1], -1))


@pytest.mark.parametrize(("given", "read_as"), [(np.float16, np.float32), (np.bool_, np.uint8)])
def test_unsupported_types_are_widened_without_loss(tmp_path, given, read_as):
    values = RNG.integers(0, 2, (5, 99)).astype(given)
    track = open_source(store_grid(tmp_path / "a.npz", flag=values)).tracks["flag"]
    assert track.dtype == read_as
    assert np.array_equal(track.read(1, 3)[..., 0], values[1:3])


@pytest.mark.parametrize(
    ("shape", "dtype"),
    [((4, 99), "f4"), ((5, 98), "f4"), ((5, 99, 257), "f4"), ((99,), "f4"), ((5, 99), "S3")],
)
def test_note_on_an_unsuitable_array_lists_the_requirements(tmp_path, extension, shape, dtype):
    notes = []
    loaded = load(store_grid(tmp_path / f"a.{extension}", odd=np.zeros(shape, dtype)), notes=notes)
    assert not loaded.tracks
    assert notes == [
        "left out: arrays: odd; tracks are numbers of shape (5, N) or (5, N, C), C up to 256, "
        "for 99 vertices, 160 faces and 480 corners"
    ]


def test_duplicate_track_names_are_an_error(tmp_path, extension):
    heat = np.zeros((5, 99))
    path = store_grid(tmp_path / f"a.{extension}", heat=heat, **{"tracks/heat": heat})
    with pytest.raises(InvalidInputError, match="'heat' twice, as 'heat' and 'tracks/heat'"):
        load(path)


def test_dataset_option_selects_among_arrays_of_one_shape(tmp_path):
    values = RNG.normal(size=(5, 99, 3))
    path = store_grid(tmp_path / "a.npz", other=values)
    loaded = load(path, dataset="other")
    assert np.array_equal(loaded.vertices, values)
    assert np.array_equal(loaded.tracks["vertices"].values, GRID.vertices)


def test_units_attribute_of_other_programs_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = store_grid(tmp_path / "a.h5", heat=np.zeros((5, 99)))
    with h5py.File(path, "a") as file:
        file["heat"].attrs["units"] = "K"
        file["heat"].attrs["kind"] = "velocity"  # which needs three numbers
    track = load(path).tracks["heat"]
    assert (track.unit, track.kind) == ("K", TrackKind.SCALAR)


def test_datasets_in_the_track_group_are_not_positions(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["scan"], file["faces"] = GRID.vertices, GRID.faces
        file["tracks/flow"] = RNG.normal(size=GRID.vertices.shape)
    loaded = load(tmp_path / "a.h5")
    assert np.array_equal(loaded.vertices, GRID.vertices)
    assert list(loaded.tracks) == ["flow"]


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_npz_track_can_be_read_in_another_process(tmp_path, write):
    heat = RNG.normal(size=(5, 99))
    write(tmp_path / "heat.npz", heat=heat)
    path = store_grid(tmp_path / "a.npz", heat=heat)
    sent = pickle.loads(pickle.dumps(open_source(path)))
    assert np.array_equal(sent.tracks["heat"].read(3, 5)[..., 0], heat[3:5])


def test_size_of_tracks_counts_towards_the_load_limit(tmp_path, extension):
    path = store_grid(tmp_path / f"a.{extension}", heat=np.zeros((5, 99, 20), np.float32))
    most = GRID.vertices.nbytes + 100
    assert isinstance(open_source(path, max_loaded_bytes=most), StoredFrames)
    assert not isinstance(open_source(path, max_loaded_bytes=10 * most), StoredFrames)


def test_reading_a_track_fails_if_its_file_has_changed(tmp_path, extension):
    path = store_grid(tmp_path / f"a.{extension}", heat=np.full((5, 99, 200), 1.25))
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


def test_error_names_a_missing_track_array(tmp_path):
    [path] = save(tracked_sheet(), tmp_path / "a.npz")
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays.files if name != "tracks/flow_face"}
    np.savez(path, **kept)
    with pytest.raises(
        FormatError, match="no array 'tracks/flow_face', which other arrays refer to"
    ):
        load(path)
    np.savez(path, **kept | {"track_kinds": np.array(["scalar"])})
    with pytest.raises(FormatError, match="the numbers must be equal"):
        load(path)


@pytest.mark.slow
def test_damaged_files_with_tracks_raise_only_meshreel_errors(tmp_path, extension):
    [path] = save(tracked_sheet(2), tmp_path / f"a.{extension}")
    for data in damaged_versions(path.read_bytes(), n_damaged=40):
        path.write_bytes(data)
        for read in (load, open_source):
            with contextlib.suppress(MeshReelError):
                result = read(path)
                for track in result.tracks.values():
                    assert track.read(0, result.n_frames).shape == (
                        result.n_frames,
                        *track.shape[1:],
                    )


@pytest.mark.parametrize("name", ["a_%d.off", "a_%d.stl", "a.glb", "a.pc2", "a.mdd"])
def test_notes_list_tracks_that_a_format_cannot_store(tmp_path, name, notes):
    sheet = tracked_sheet(2, ("vertex",))
    extension = name[name.index(".") :]
    save(sheet, tmp_path / name, notes=notes)
    names = "heat of vertex/s, flow_vertex, shade_vertex, step_vertex, tensor_vertex"
    assert f"tracks left out: {names}: {extension} cannot store them" in notes
    assert not any("tracks left out" in note for note in notes_of(quad_sheet(2), tmp_path / name))


@pytest.mark.parametrize("domain", ["vertex", "corner"])
def test_glb_keeps_uvs_and_colors_that_never_change(tmp_path, domain, notes):
    sheet = quad_sheet(3)
    n_items = {"vertex": sheet.n_verts, "corner": int(sheet.surface.sizes(0).sum())}[domain]
    rng = np.random.default_rng(0)
    values = {"uv": rng.random((n_items, 2)), "color": rng.random((n_items, 4))}
    tracks = {
        name: Track(np.repeat(array[None].astype("f4"), 3, axis=0), domain=domain, kind=name)
        for name, array in values.items()
    }
    changing = Track(rng.random((3, n_items, 2), dtype="f4"), domain=domain, kind="uv")
    surface = replace(sheet.surface, attributes=())
    sheet = sheet.replace(surface=surface, tracks=tracks | {"moving": changing})
    save(sheet, tmp_path / "a.glb", notes=notes)
    assert "tracks left out: moving: .glb cannot store them" in notes
    kinds = {str(one.kind) for one in load(tmp_path / "a.glb").surface.attributes}
    assert kinds == {"uv", "color"}


def notes_of(sequence, output):
    notes = []
    save(sequence, output, notes=notes, overwrite=True)
    return notes
