"""Selection of a segment, and encoding of blocks in other processes."""

import pickle
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.codec.encoder import encode
from meshreel.codec.joining import join_streams, separate_stream
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.options import config_of
from meshreel.codec.reel.encoding.block_coder import coder_of
from meshreel.codec.source import Source
from meshreel.errors import InvalidInputError, TruncatedStreamError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.save import save
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.engine.processes import ProcessExecutor
from samples.commands import assert_fails, run, run_json
from samples.costs import slow_but
from samples.engines import InlineExecutor
from samples.meshes import irregular_sequence, waving_grid
from samples.opening import open_source
from samples.streams import not_compact
from samples.waiting import TEST_S, time_limit

with not_compact():
    STREAMS = [
        meshreel.encode(one.replace(start_s=2.0))
        for one in (waving_grid(4, 5, 6), waving_grid(5, 7, 3), waving_grid(1, 2, 2))
    ]
DATA = join_streams(STREAMS)


@pytest.fixture
def path(tmp_path):
    """A file with three segments."""
    path = tmp_path / "three.reel"
    path.write_bytes(DATA)
    return path


def test_all_segments_are_decoded_opened_and_loaded_by_default(path):
    with meshreel.open(path) as reel:
        given: Any
        for given in (meshreel.decode(path), meshreel.decode(DATA), meshreel.load(path), reel):
            assert (given.n_segments, given.starts) == (3, (0, 4, 9, 10))
            for segment, stream in zip(given.segments, STREAMS, strict=True):
                wanted = meshreel.decode(stream).vertices
                assert np.array_equal(segment.read(0, segment.n_frames), wanted)
            with pytest.raises(meshreel.ConnectivityChangeError, match=r"segments\[0\]"):
                _ = given.faces


@pytest.mark.parametrize(("n_segments", "number"), [(3, 3), (3, -1), (1, 1)])
def test_missing_segment_is_rejected(n_segments, number):
    data = DATA if n_segments == 3 else STREAMS[0]
    assert meshreel.decode(data, segment=0).n_frames == 4
    with pytest.raises(InvalidInputError, match=f"it has {n_segments} segments?, numbered from 0"):
        meshreel.decode(data, segment=number)


def test_open_reel_selects_a_segment(path):
    with meshreel.open(path, segment=1) as reel:
        for function in (meshreel.decode, meshreel.info):
            with pytest.raises(InvalidInputError, match=r"to meshreel\.open"):
                function(reel, segment=1)


def test_info_lists_segments_and_sums_their_bytes(path):
    for given in (DATA, path):
        info = meshreel.info(given)
        assert [segment.first_frame for segment in info.segments] == [0, 4, 9]
        assert [segment.n_frames for segment in info.segments] == [4, 5, 1]
        assert [segment.n_verts for segment in info.segments] == [30, 21, 4]
        assert (info.n_frames, info.n_verts, info.size_bytes) == (10, 30, len(DATA))
        assert sum(info.budget_bytes.values()) == sum(info.part_bytes.values()) == len(DATA)
        assert info.rate_bpvf == 8 * len(DATA) / (4 * 30 + 5 * 21 + 4)
        assert "10 frames in 3 segments" in repr(info)


@pytest.mark.parametrize("number", range(3))
def test_info_of_a_segment_describes_only_its_bytes(path, number):
    info, wanted = meshreel.info(path, segment=number), meshreel.info(STREAMS[number])
    assert info.size_bytes == sum(info.budget_bytes.values()) == sum(info.part_bytes.values())
    assert (info.n_modes, info.block_bytes) == (wanted.n_modes, wanted.block_bytes)
    assert info.part_bytes["positions"] == wanted.part_bytes["positions"]
    with meshreel.open(path, segment=number) as reel:
        assert reel.info() == info


def test_truncated_file_has_its_complete_segments(path):
    place = meshreel.info(DATA).segments[1]
    path.write_bytes(DATA[: len(DATA) - place.size_bytes // 2])
    with meshreel.open(path, segment=0) as reel:
        assert np.array_equal(reel[:].vertices, meshreel.decode(STREAMS[0]).vertices)
    with pytest.raises(TruncatedStreamError):
        meshreel.decode(path, segment=0)


@pytest.mark.every_case
@pytest.mark.parametrize("number", range(3))
def test_selected_segment_equals_the_joined_stream(path, number):
    wanted, start_s = meshreel.decode(STREAMS[number]), 2.0 + [0, 4, 9][number] / 25
    with not_compact():
        alone = separate_stream(whole_stream(DATA, segment=number))
    assert meshreel.info(alone).start_s == start_s
    assert (alone == STREAMS[number]) == (number == 0)
    for decoded in (
        meshreel.decode(DATA, segment=number),
        meshreel.decode(path, segment=number),
        meshreel.decode(alone),
    ):
        assert np.array_equal(decoded.vertices, wanted.vertices)
        assert np.array_equal(decoded.faces, wanted.faces)
    with meshreel.open(path, segment=number) as reel:
        assert np.array_equal(reel[:].vertices, wanted.vertices)
        assert (reel.fps, reel.name, reel.is_whole) == (25.0, "grid", True)
        assert reel.start_s == start_s
        served = reel.stored(0, reel.size_bytes)
        assert np.array_equal(meshreel.decode(served).vertices, wanted.vertices)
        assert reel.stored(3, 40) == served[3:40]


def test_commands_list_and_select_segments(path, tmp_path):
    shown = run("info", path).stdout
    for words in ("10 frames", "4 to 8", "9 to 9", "select one with --segment"):
        assert words in shown
    assert len(run_json("info", path)["segments"]) == 3
    assert run_json("info", path, "--segment", "1")["n_verts"] == 21
    output = tmp_path / "out.npz"
    assert_fails(run("decode", path, "-o", output), "10 frames in 3 segments", "decode --segment")
    assert run("decode", path, "-o", output, "--segment", "1").returncode == 0
    assert meshreel.load(output).n_verts == 21
    assert_fails(run("info", output, "--segment", "0"), "--segment applies to a .reel")


class PicklingExecutor(InlineExecutor):
    """An executor that pickles arguments and results in this process."""

    def submit(self, function, /, *args):  # type: ignore[override]
        sent = pickle.loads(pickle.dumps((function, args)))
        outcome = super().submit(sent[0], *sent[1])
        outcome.result()
        return pickle.loads(pickle.dumps(outcome.result())) and outcome


@pytest.mark.parametrize(
    "target", slow_but([{}], [{}, {"max_error": 0.4}, {"size": 3000}, {"step": 0.01}])
)
def test_workers_give_the_same_bytes(target):
    sequence = irregular_sequence(23)
    workers = PicklingExecutor()
    spread = encode(sequence, block_frames=5, engine=Engine(workers, 1), **target)
    assert spread == encode(sequence, block_frames=5, **target)
    assert len(workers.calls) >= 4  # all blocks except the first


def test_errors_are_measured_in_this_process():
    sequence = waving_grid(12)
    workers = PicklingExecutor()
    spread = encode(sequence, block_frames=5, engine=Engine(workers, 1), kg=1.0)
    assert spread == encode(sequence, block_frames=5, kg=1.0)
    assert workers.calls == []


def test_only_the_frames_of_a_block_are_sent_for_a_sequence_in_memory():
    sequence = waving_grid(200)
    pieces = list(Source(sequence, config_of(block_frames=10)).pieces())
    assert len(pickle.dumps(pieces[3])) < sequence.vertices.nbytes / 10
    restored = pickle.loads(pickle.dumps(pieces[3]))
    assert (restored.read() == pieces[3].read()).all()


def test_workers_read_frames_from_files(tmp_path):
    sequence = waving_grid(200)
    save(sequence, tmp_path / "grid.npz")
    source = Source(open_source(tmp_path / "grid.npz"), config_of(block_frames=10))
    piece = list(source.pieces())[3]
    sent = pickle.dumps(piece)
    assert len(sent) < sequence.vertices.nbytes / 10
    assert (pickle.loads(sent).read() == piece.read()).all()


@pytest.mark.parametrize("extension", ["ply", "abc", "usdc", "h5", "vtkhdf", "mdd"])
def test_piece_of_an_open_file_is_sent_with_its_frames(tmp_path, extension):
    """Open files cannot be sent to another process."""
    sequence = waving_grid(40, 20, 20)
    source = tmp_path / f"grid.{extension}"
    save(sequence, tmp_path / "f_%02d.ply" if extension == "ply" else source)
    opened = open_source(tmp_path if extension == "ply" else source)
    pieces = list(Source(opened, config_of(block_frames=10)).pieces())
    assert type(opened) is StoredFrames
    result = pickle.loads(pickle.dumps(pieces[2])).read()
    np.testing.assert_array_equal(result, sequence.vertices[20:30, pieces[2].order])


def test_process_reuses_a_mesh_that_it_received_before():
    sequence = waving_grid(5)
    source = Source(sequence, config_of())
    sent = pickle.dumps(coder_of(source.mesh, source.frame))
    assert pickle.loads(sent).mesh is pickle.loads(sent).mesh


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{}, {"lossless": True}, {"method": "grid", "max_error": 0.01}], ids=str
)
def test_processes_give_the_same_bytes(options):
    sequence = waving_grid(40)
    with time_limit(TEST_S, "two processes that code blocks"), ProcessExecutor(2) as executor:
        spread = encode(sequence, block_frames=5, engine=Engine(executor, 2), **options)
    assert spread == encode(sequence, block_frames=5, **options)
