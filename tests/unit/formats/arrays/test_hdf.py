import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.model.sequence import MeshSequence
from meshreel.operations.save import save
from samples.arrays import store
from samples.datasets import plain_sequence, surfaced_sequence
from samples.opening import open_source

h5py = pytest.importorskip("h5py")

FACES = np.array([[0, 1, 2], [2, 3, 4]], np.uint32)
POSITIONS = np.random.default_rng(0).random((7, 5, 3)).astype(np.float32)


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
    ("datasets", "message"),
    [
        ({}, "has no dataset of positions: float32"),
        ({"vertices": POSITIONS}, r"no dataset 'faces' of shape \(M, 3\) next to /vertices"),
        (
            {"scan": np.zeros((3, 3, 3)), "faces": FACES[:1]},
            r"/scan has shape \(3, 3, 3\) .* store",
        ),
    ],
)
def test_errors_explain_missing_and_ambiguous_datasets(tmp_path, datasets, message, read):
    with pytest.raises((FormatError, InvalidInputError), match=rf"a\.h5: .*{message}"):
        read(store(tmp_path / "a.h5", **datasets))


def test_load_rejects_heaps_with_empty_objects(tmp_path):
    [path] = save(surfaced_sequence(), tmp_path / "a.h5")
    data = bytearray(path.read_bytes())
    heap = data.index(b"GCOL")
    data[heap + 400 : heap + 460] = bytes(60)
    path.write_bytes(data)
    with pytest.raises(FormatError, match=f"heap at byte {heap} has an empty object"):
        load(path)
