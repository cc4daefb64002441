import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import PLAIN
from samples.datasets import (
    assert_same_positions,
    plain_sequence,
    positions_of,
    read_damaged,
    surfaced_sequence,
)
from samples.meshes import assert_same_surface
from samples.opening import open_source

h5py = pytest.importorskip("h5py")

FACES = np.array([[0, 1, 2], [2, 3, 4]], np.uint32)
POSITIONS = np.random.default_rng(0).random((7, 5, 3)).astype(np.float32)


def store(path, **datasets):
    with h5py.File(path, "w") as file:
        for name, data in datasets.items():
            file[name] = data
    return path


@pytest.mark.parametrize("extension", ["h5", "hdf5", "hdf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_frames", [1, 5])
@pytest.mark.parametrize("read", [load, open_source])
def test_hdf_round_trips_exactly(tmp_path, extension, dtype, n_frames, read):
    sequence = surfaced_sequence(n_frames, dtype, 29.97, 1 / 3, name="Ödipus/1")
    notes = []
    [path] = save(sequence, tmp_path / f"a.{extension}", notes=notes)
    result = read(path, notes=notes)
    assert_same_positions(result, sequence)
    assert_same_surface(result.surface, sequence.surface)
    assert (result.fps, result.start_s, result.name) == (29.97, 1 / 3, "Ödipus/1")
    assert notes == []


@pytest.mark.parametrize("fps", [0.0, 24.0, 23.98765])
def test_hdf_without_surface_round_trips(tmp_path, fps):
    [path] = save(plain_sequence(fps=fps), tmp_path / "a.h5")
    loaded = load(path)
    assert_same_surface(loaded.surface, PLAIN)
    assert (loaded.fps, loaded.start_s) == (fps, 0.0)
    assert load(path, fps=60).fps == 60


def test_open_source_leaves_many_frames_in_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.frames.stored_frames.BLOCK_BYTES", 300)
    sequence = plain_sequence(n_frames=9)
    [path] = save(sequence, tmp_path / "a.h5")
    opened = open_source(path)
    assert isinstance(opened, StoredFrames)
    for start, stop in [(0, 9), (3, 4), (5, 20), (4, 4), (-2, 9)]:
        assert opened.read(start, stop).tobytes() == sequence.vertices[start:stop].tobytes()


def test_save_writes_frames_as_they_are_produced(tmp_path):
    vertices = np.random.default_rng(0).standard_normal((3, 9000, 3)).astype(np.float32)
    sequence = MeshSequence(vertices, np.arange(9000).reshape(-1, 3))
    [path] = save(sequence, tmp_path / "a.h5")
    with h5py.File(path) as file:
        assert file["vertices"].chunks == (1, 9000, 3)
    assert load(path).vertices.tobytes() == vertices.tobytes()


@pytest.mark.parametrize("read", [load, open_source])
def test_body_scan_with_frames_last_is_read(tmp_path, read):
    scans = {"50002_hips": POSITIONS.transpose(1, 2, 0), "50004_hips": np.zeros((5, 3, 2))}
    path = store(tmp_path / "registrations_f.hdf5", faces=FACES, **scans)
    result = read(path, dataset="50002_hips")
    assert positions_of(result).tobytes() == POSITIONS.tobytes()
    assert (result.name, result.fps) == ("50002_hips", 0)
    np.testing.assert_array_equal(result.faces, FACES)


def test_load_lists_ambiguous_datasets(tmp_path):
    scans = {f"scan_{index:02}": np.zeros((5, 3, 2)) for index in range(22)}
    path = store(tmp_path / "a.h5", faces=FACES, **scans)
    message = r"a\.h5: holds positions in 22 datasets: scan_00, .*, scan_19 and 2 more; choose one"
    with pytest.raises(InvalidInputError, match=message):
        load(path)
    with pytest.raises(InvalidInputError, match=r"has no dataset 'x'; it holds positions in 22"):
        load(path, dataset="x")


def test_load_finds_the_only_dataset_of_positions(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["body/left/points"] = POSITIONS.astype(">f4")
        file["body/faces"] = FACES
        file["body/left/fps"] = 30
        file["weights"] = np.zeros((5, 4))
    loaded = load(path)
    assert loaded.vertices.tobytes() == POSITIONS.tobytes()
    assert (loaded.fps, loaded.name) == (30, "points")
    assert load(path, dataset="points").vertices.tobytes() == POSITIONS.tobytes()
    assert load(path, dataset="/body/left/points").vertices.tobytes() == POSITIONS.tobytes()


def test_load_follows_links_within_the_file(tmp_path):
    path = store(tmp_path / "a.h5", faces=FACES, here=POSITIONS)
    with h5py.File(path, "a") as file:
        file["vertices"] = h5py.SoftLink("/here")
    assert load(path).vertices.tobytes() == POSITIONS.tobytes()


def external_link(file):
    file["vertices"] = h5py.ExternalLink("other.h5", "/vertices")


def circular_link(file):
    file["vertices"] = h5py.SoftLink("/vertices")


def virtual(file):
    layout = h5py.VirtualLayout((7, 5, 3), np.float32)
    layout[:] = h5py.VirtualSource("other.h5", "vertices", (7, 5, 3))
    file.create_virtual_dataset("vertices", layout)


def external_storage(file):
    external = [("other.bin", 0, h5py.h5f.UNLIMITED)]
    file.create_dataset("vertices", (7, 5, 3), np.float32, external=external)


def never_written(file):
    file.create_dataset("vertices", (1 << 30, 1 << 20, 3), np.float32, chunks=(1, 1024, 3))


def huge_faces(file):
    file["vertices"] = POSITIONS
    del file["faces"]
    file.create_dataset("faces", (1 << 40, 3), np.int32, chunks=(1024, 3))


def huge_chunks(file):
    file.create_dataset("vertices", (1, 5, 3), "f8", maxshape=(None,) * 3, chunks=(999, 9999, 3))


def pairs(file):
    file["vertices"] = np.zeros((2, 5, 3), [("a", "f4"), ("b", "f4")])


def lists(file):
    kind = h5py.vlen_dtype(np.float32)
    file.create_dataset("vertices", (2, 5, 3), kind)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (external_link, r"'vertices' links to another file \(other.h5\), which is not read"),
        (circular_link, "has circular links from '/vertices'"),
        (virtual, "dataset /vertices is in other files, which are not read"),
        (external_storage, "dataset /vertices is in other files, which are not read"),
        (never_written, r"dataset /vertices declares \d+ bytes .* more than the file contains"),
        (huge_faces, r"dataset /faces declares \d+ bytes .* more than the file contains"),
        (huge_chunks, r"dataset /vertices (declares|has chunks of) .* more than the file contains"),
        (pairs, r"dataset /vertices has type .*; numbers and text are supported"),
        (lists, "dataset /vertices contains lists; numbers and text are supported"),
    ],
)
def test_load_rejects_external_and_oversized_datasets(tmp_path, change, message):
    store(tmp_path / "other.h5", vertices=POSITIONS)
    path = store(tmp_path / "a.h5", faces=FACES)
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(FormatError, match=rf"a\.h5: {message}"):
        load(path)


@pytest.mark.parametrize(
    ("datasets", "error", "message"),
    [
        ({}, FormatError, "has no dataset of positions: float32"),
        (
            {"vertices": POSITIONS},
            FormatError,
            r"has no dataset 'faces' of shape \(M, 3\) next to /vertices",
        ),
        (
            {"vertices": POSITIONS.astype(np.float16), "faces": FACES},
            InvalidInputError,
            "/vertices must be float32 or float64; got float16",
        ),
        (
            {"vertices": POSITIONS[0], "faces": FACES},
            InvalidInputError,
            r"/vertices must have shape \(T, V, 3\) or \(V, 3, T\); got \(5, 3\)",
        ),
        (
            {"vertices": POSITIONS[:0], "faces": FACES},
            InvalidInputError,
            "/vertices is empty",
        ),
        (
            {"vertices": POSITIONS, "faces": FACES + 1},
            InvalidInputError,
            r"face 1 is \[3, 4, 5\]; indices must be in 0..4",
        ),
        (
            {"vertices": POSITIONS, "faces": FACES, "fps": "fast"},
            FormatError,
            "fps must be one number",
        ),
        (
            {"scan": np.zeros((3, 3, 3)), "faces": FACES[:1]},
            InvalidInputError,
            r"/scan has shape \(3, 3, 3\) .* store it as \(T, V, 3\)",
        ),
    ],
)
@pytest.mark.parametrize("read", [load, open_source])
def test_errors_explain_invalid_datasets(tmp_path, datasets, error, message, read):
    with pytest.raises(error, match=rf"a\.h5: .*{message}"):
        read(store(tmp_path / "a.h5", **datasets))


def test_error_names_the_vertex_of_a_non_finite_position(tmp_path):
    positions = POSITIONS.copy()
    positions[3, 2, 1] = np.nan
    path = store(tmp_path / "a.h5", vertices=positions, faces=FACES)
    with pytest.raises(InvalidInputError, match=r"a\.h5: .*vertex 2 of frame 3 has y = nan"):
        load(path)


@pytest.mark.parametrize("keep", [0, 4, 100, 2000, -100])
def test_load_rejects_truncated_files(tmp_path, keep):
    [path] = save(surfaced_sequence(), tmp_path / "a.h5")
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(FormatError, match=r"a\.h5: is not an HDF5 file, or is damaged"):
        load(path)


def test_load_rejects_heaps_with_empty_objects(tmp_path):
    [path] = save(surfaced_sequence(), tmp_path / "a.h5")
    data = bytearray(path.read_bytes())
    heap = data.index(b"GCOL")
    data[heap + 400 : heap + 460] = bytes(60)
    path.write_bytes(data)
    with pytest.raises(FormatError, match=f"heap at byte {heap} has an empty object"):
        load(path)


@pytest.mark.slow
def test_damaged_files_raise_only_meshreel_errors(tmp_path):
    [path] = save(surfaced_sequence(), tmp_path / "a.h5")
    read_damaged(
        path, 150, n_header=3000, readers=(load, lambda file: positions_of(open_source(file)))
    )
