"""Encoding of blocks in other processes."""

import pickle

import numpy as np
import pytest

from meshreel.codec.encoder import encode
from meshreel.codec.options import config_of
from meshreel.codec.reel.encoding.block_coder import coder_of
from meshreel.codec.source import Source
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.save import save
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.engine.processes import ProcessExecutor
from samples.costs import slow_but
from samples.engines import InlineExecutor
from samples.meshes import irregular_sequence, waving_grid
from samples.opening import open_source
from samples.waiting import TEST_S, time_limit


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
