"""Datasets for PyTorch: windows, orders, workers. Needs the extra [torch]."""

import pickle
import sys
from collections import Counter
from itertools import chain

import numpy as np
import pytest

import meshreel
from meshreel.errors import CorruptStreamError, InvalidInputError
from samples.meshes import quad_sheet, waving_grid
from samples.pages import ROOT, snippets
from samples.tracks import tracked_sheet

torch = pytest.importorskip("torch", reason="the extra [torch] is not installed")

from torch.utils.data import DataLoader  # noqa: E402

from meshreel.model.sequence import MeshSequence  # noqa: E402
from meshreel.torch import ReelDataset, ReelStream, Window, collate  # noqa: E402

pytestmark = pytest.mark.filterwarnings(
    "ignore:This process .* is multi-threaded:DeprecationWarning"  # of forks, since Python 3.12
)
WORKERS = [("stream", "spawn"), ("map", "fork" if sys.platform == "linux" else "spawn")]
"""A stream is pickled with its dataset."""


def shifted(sequence, distance):
    """Return a sequence far from the origin, of the same motion."""
    vertices = sequence.vertices + np.array(distance, sequence.vertices.dtype)
    return meshreel.MeshSequence(vertices, sequence.faces, sequence.fps)


def with_spikes(sequence):
    """Return a sequence in which two vertices jump in one frame, which takes corrections."""
    vertices = sequence.vertices.copy()
    vertices[1, [5, 70]] += 0.1
    return meshreel.MeshSequence(vertices, sequence.faces, sequence.fps)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three files of 12, 20 (in blocks of 8) and 30 frames; the last has corrections."""
    folder = tmp_path_factory.mktemp("reels")
    (folder / "deeper").mkdir()
    files = {
        "a": meshreel.encode(waving_grid(12), effort=5),
        "b": meshreel.encode(shifted(waving_grid(20, 6, 7), (3, 0, -2)), block_frames=8, effort=5),
        "deeper/c": meshreel.encode(with_spikes(waving_grid(30, 12, 14)), max_error=1, effort=5),
    }
    for name, data in files.items():
        (folder / f"{name}.reel").write_bytes(data)
    return folder


@pytest.fixture(scope="module")
def wholes(folder):
    return [meshreel.decode(folder / f"{name}.reel").vertices for name in ("a", "b", "deeper/c")]


def place_of(window):
    return int(window.sequence), int(window.frames[0])


def test_windows_equal_decoded_frames(folder, wholes):
    dataset = ReelDataset(folder, 4)
    assert [one.n_frames for one in dataset.sequences] == [12, 20, 30]
    assert len(dataset) == 9 + 17 + 27
    places = []
    for window in (dataset[index] for index in range(len(dataset))):
        sequence, first = place_of(window)
        places.append((sequence, first))
        assert window.frames.tolist() == list(range(first, first + 4))
        np.testing.assert_allclose(window.vertices, wholes[sequence][first : first + 4], atol=1e-6)
    assert len(set(places)) == len(dataset)
    assert place_of(dataset[-1]) == (2, 26)


@pytest.mark.parametrize(("window", "step", "frames"), [(3, 5, [9, 14, 19]), (2, 9, [7, 16])])
def test_step_spaces_the_frames(folder, wholes, window, step, frames):
    dataset = ReelDataset([folder / "b.reel"], window, step=step)
    assert len(dataset) == 20 - (window - 1) * step
    result = dataset[frames[0]]
    assert result.frames.tolist() == frames
    np.testing.assert_allclose(result.vertices, wholes[1][frames], atol=1e-5)


def test_faces_are_those_of_the_sequence(folder):
    faces = ReelDataset(folder).faces(1)
    assert faces.dtype == torch.int64
    np.testing.assert_array_equal(faces, waving_grid(2, 6, 7).faces)


@pytest.mark.parametrize("dtype", ["float16", "float32", "float64"])
def test_normalized_positions_of_every_type(folder, wholes, dtype):
    dtype = getattr(torch, dtype)
    window = ReelDataset(folder, 3, dtype=dtype, normalize=True).at(1, 7)
    assert window.vertices.dtype == dtype
    with meshreel.open(folder / "b.reel") as reel:
        expected = (wholes[1][7:10] - reel.frame.origin) / reel.frame.scale
    tolerance = 1e-3 if dtype == torch.float16 else 1e-6
    np.testing.assert_allclose(window.vertices, expected, atol=tolerance)


def test_tracks_and_lossless_positions(tmp_path):
    sheet = tracked_sheet()
    tracks = {
        name: meshreel.Track(
            np.where(np.isinf(track.values), 0, track.values), track.domain, track.kind
        )
        for name, track in sheet.tracks.items()
    }
    sheet = sheet.replace(tracks=tracks)
    bounds = {name: "1%" for name, track in sheet.tracks.items() if track.values.dtype.kind == "f"}
    (tmp_path / "lossy.reel").write_bytes(meshreel.encode(sheet, tracks=bounds))
    (tmp_path / "exact.reel").write_bytes(meshreel.encode(sheet, lossless=True))
    dataset = ReelDataset(tmp_path, 3, tracks=sheet.tracks)
    for sequence, one in enumerate(dataset.sequences):
        whole = meshreel.decode(one.path)
        window = dataset.at(sequence, 2)
        np.testing.assert_allclose(window.vertices, whole.vertices[2:5], rtol=0, atol=1e-5)
        assert list(window.tracks) == list(sheet.tracks)
        for name, values in window.tracks.items():
            expected = whole.tracks[name].values[2:5]
            largest = np.abs(expected[np.isfinite(expected)]).max()
            np.testing.assert_allclose(values, expected, rtol=0, atol=1e-5 * largest)
            assert values.is_floating_point() == (expected.dtype.kind == "f")


def test_each_segment_is_a_sequence(tmp_path):
    whole = MeshSequence.of_segments([waving_grid(6), quad_sheet(4).replace(fps=25.0)])
    path = tmp_path / "two.reel"
    path.write_bytes(meshreel.encode(whole))
    dataset = ReelDataset(path, 2)
    assert [(sequence.segment, sequence.n_frames) for sequence in dataset.sequences] == [
        (0, 6),
        (1, 4),
    ]
    assert dataset[5].vertices.shape == (2, 30, 3)


@pytest.mark.parametrize(("kind", "start"), WORKERS)
def test_workers_yield_every_window_once(folder, kind, start):
    dataset = ReelDataset(folder, 4)
    data = dataset if kind == "map" else ReelStream(dataset)
    _ = dataset[0]  # decoded here: forked workers start over
    loader = DataLoader(data, 4, num_workers=2, multiprocessing_context=start, collate_fn=collate)
    places = []
    for batch in loader:
        for row, sequence in enumerate(batch.sequence.tolist()):
            first = int(batch.frames[row, 0])
            expected = dataset.at(sequence, first).vertices
            n_verts = int(batch.n_verts[row])
            torch.testing.assert_close(batch.vertices[row, :, :n_verts], expected)
            assert not batch.vertices[row, :, n_verts:].any()
            places.append((sequence, first))
    assert len(places) == len(set(places)) == len(dataset)


@pytest.mark.parametrize("n_items", [(3, 3), (3, 2), (2, 3)])
def test_collation_keeps_integers_when_their_types_differ(n_items):
    tracks = [torch.full((1, n_items[0], 1), 200, dtype=torch.uint8)]
    tracks.append(torch.full((1, n_items[1], 1), -70_000, dtype=torch.int32))
    frames = torch.zeros(1, dtype=torch.int64)
    batch = collate([Window(track.float(), {"label": track}, 0, frames) for track in tracks])
    for row, track, n_here in zip(batch.tracks["label"], tracks, n_items, strict=True):
        torch.testing.assert_close(row[:, :n_here], track, check_dtype=False)
        assert not row[:, n_here:].any()


def test_default_collation_stacks_windows_of_one_mesh(folder):
    batch = next(iter(DataLoader(ReelDataset(folder / "a.reel", 3), 5)))
    assert batch.vertices.shape == (5, 3, 99, 3)
    assert batch.frames.shape == (5, 3)


def test_batches_open_each_block_once(folder, monkeypatch):
    dataset = ReelDataset(folder, 3)
    opened = []
    open_file = dataset._reel
    monkeypatch.setattr(dataset, "_reel", lambda item: opened.append(item) or open_file(item))
    indices = [30, 0, 12, 5, 30, 55, 20, 1]
    windows = dataset.__getitems__(indices)
    assert sorted(opened) == [0, 1, 1, 2]
    expected = ReelDataset(folder, 3)
    for index, window in zip(indices, windows, strict=True):
        assert place_of(window) == place_of(expected[index])
        torch.testing.assert_close(window.vertices, expected[index].vertices, rtol=0, atol=1e-5)


def test_damaged_file_of_a_batch_is_reported(folder, tmp_path):
    for name in ("a.reel", "b.reel"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    dataset = ReelDataset(tmp_path, 3)
    data = bytearray((tmp_path / "a.reel").read_bytes())
    data[len(data) // 2] ^= 255
    (tmp_path / "a.reel").write_bytes(data)
    with pytest.raises(CorruptStreamError):
        dataset.__getitems__([0, 12])
    assert dataset[12].vertices.shape == (3, 42, 3)


@pytest.mark.parametrize("memory", ["2GiB", "300kB", 1])
def test_stream_opens_each_block_once(folder, monkeypatch, memory):
    """Three files have five blocks."""
    dataset = ReelDataset(folder, 3, memory=memory)
    opened = []
    open_file = dataset._reel
    monkeypatch.setattr(dataset, "_reel", lambda item: opened.append(item) or open_file(item))
    windows = [place_of(window) for window in ReelStream(dataset, open_blocks=3)]
    assert sorted(windows) == sorted(set(windows))
    assert len(windows) == 10 + 18 + 28
    assert len(opened) == 5
    assert len(dataset._cache._entries) <= 1


def test_order_of_a_stream_follows_seed_and_epoch(folder):
    dataset = ReelDataset(folder, 2)

    def order(seed, epoch=0):
        stream = ReelStream(dataset, seed=seed)
        stream.set_epoch(epoch)
        return [place_of(window) for window in stream]

    assert order(1) == order(1)
    assert order(1) != order(2)
    assert order(1) != order(1, epoch=1)
    assert order(None) != order(None)
    torch.manual_seed(5)
    first = order(None)
    torch.manual_seed(5)
    assert order(None) == first


@pytest.mark.parametrize("world_size", [2, 3, 7])
def test_ranks_share_the_windows_equally(folder, world_size):
    dataset = ReelDataset(folder, 4)
    ranks = [
        [place_of(one) for one in ReelStream(dataset, seed=3, rank=rank, world_size=world_size)]
        for rank in range(world_size)
    ]
    assert {len(one) for one in ranks} == {len(dataset) // world_size}
    assert max(Counter(chain(*ranks)).values()) == 1


def test_epoch_reaches_persistent_workers(folder):
    stream = ReelStream(ReelDataset(folder, 2), seed=0)
    loader = DataLoader(stream, None, num_workers=1, persistent_workers=True)
    orders = []
    for epoch in (0, 1, 0):
        stream.set_epoch(epoch)
        orders.append([place_of(window) for window in loader])
    assert orders[0] == orders[2] != orders[1]


def test_little_memory_keeps_the_last_file_only(folder):
    dataset = ReelDataset(folder, 2, memory=1)
    for index in (0, 20, 0, -1):
        _ = dataset[index]
        assert len(dataset._cache._entries) == 1
    whole = ReelDataset(folder, 2)
    for index in (0, 20, 0, -1):
        _ = whole[index]
    assert len(whole._cache._entries) == 3


def test_pickled_dataset_opens_its_own_files(folder):
    dataset = ReelDataset(folder, 2)
    expected = dataset[3].vertices
    copied = pickle.loads(pickle.dumps(dataset))
    torch.testing.assert_close(copied[3].vertices, expected)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"paths": "no_folder"}, "no file or folder 'no_folder'"),
        ({"paths": 3}, "takes a path, or several; got 3"),
        ({"paths": [None]}, r"paths as strings or pathlib\.Path; got \[None\]"),
        ({"window": 0}, "at least 1"),
        ({"window": 1.5}, "window must be an integer, at least 1; got 1.5"),
        ({"window": 31}, "no sequence has the 31 frames of a window; the longest has 30"),
        ({"step": 0}, "at least 1"),
        ({"step": "2"}, "step must be an integer"),
        ({"dtype": torch.int32}, "real type"),
        ({"dtype": "float16"}, r"such as torch\.float16; got 'float16'"),
        ({"tracks": ["heat"]}, "no track 'heat'"),
        ({"memory": "much"}, "memory takes a size"),
    ],
)
def test_invalid_options_are_refused(folder, options, message):
    with pytest.raises(InvalidInputError, match=message):
        ReelDataset(**{"paths": folder} | options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"open_blocks": 0}, "at least 1"),
        ({"open_blocks": 1.5}, "open_blocks must be an integer"),
        ({"rank": -1}, "rank must be an integer, at least 0"),
        ({"rank": 2, "world_size": 2, "seed": 1}, r"in 0\.\.1"),
        ({"world_size": 2}, "set seed"),
    ],
)
def test_invalid_options_of_a_stream_are_refused(folder, options, message):
    with pytest.raises(InvalidInputError, match=message):
        ReelStream(ReelDataset(folder), **options)


def test_empty_folder_and_missing_window_are_refused(folder, tmp_path):
    with pytest.raises(InvalidInputError, match=r"no \.reel file"):
        ReelDataset(tmp_path)
    with pytest.raises(IndexError, match="no window 53; there are 53"):
        ReelDataset(folder, 4)[53]
    for first in (-1, 17):
        with pytest.raises(IndexError, match=f"no window starts with frame {first}"):
            ReelDataset(folder, 4).at(1, first)


def test_snippets_of_the_guide_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "meshreel-demo").mkdir()
    meshreel.save(waving_grid(40), tmp_path / "meshreel-demo" / "flag.reel")
    for snippet in snippets(ROOT / "docs" / "guides" / "learning.md"):
        exec(compile(snippet.text, "snippet", "exec"), {"__name__": "__main__"})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "(8, 16, 99, 3)"
    assert printed[1].startswith("torch.Size([8, 16, 99, 3]) torch.float16")
    assert printed[2] == "25 windows"
