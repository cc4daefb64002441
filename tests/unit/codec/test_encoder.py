"""Selection of a segment in streams with several."""

from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.codec.joining import join_streams, separate_stream
from meshreel.codec.open_stream import whole_stream
from meshreel.errors import InvalidInputError, TruncatedStreamError
from samples.commands import assert_fails, run, run_json
from samples.meshes import waving_grid

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


@pytest.mark.parametrize("number", range(3))
def test_selected_segment_equals_the_joined_stream(path, number):
    wanted = meshreel.decode(STREAMS[number])
    for given in (DATA, path):
        found = meshreel.decode(given, segment=number)
        assert np.array_equal(found.vertices, wanted.vertices)
        assert np.array_equal(found.faces, wanted.faces)
    with meshreel.open(path, segment=number) as reel:
        assert np.array_equal(reel[:].vertices, wanted.vertices)
        assert (reel.fps, reel.name, reel.is_whole) == (25.0, "grid", True)
        assert reel.start_s == 2.0 + [0, 4, 9][number] / 25


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


def test_missing_segment_is_rejected(path):
    for number in (3, -1):
        with pytest.raises(InvalidInputError, match="it has 3 segments, numbered from 0"):
            meshreel.open(path, segment=number)


def test_stream_of_one_segment_has_only_segment_0():
    assert np.array_equal(
        meshreel.decode(STREAMS[0], segment=0).vertices, meshreel.decode(STREAMS[0]).vertices
    )
    with pytest.raises(InvalidInputError, match="it has 1 segment, numbered from 0"):
        meshreel.decode(STREAMS[0], segment=1)


def test_open_reel_selects_a_segment(path):
    with meshreel.open(path, segment=1) as reel:
        for function in (meshreel.decode, meshreel.info):
            with pytest.raises(InvalidInputError, match=r"to meshreel\.open"):
                function(reel, segment=1)


def test_info_lists_segments_and_sums_their_bytes(path):
    for given in (DATA, path):
        info = meshreel.info(given)
        assert [one.first_frame for one in info.segments] == [0, 4, 9]
        assert [one.n_frames for one in info.segments] == [4, 5, 1]
        assert [one.n_verts for one in info.segments] == [30, 21, 4]
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


def test_segment_is_written_as_a_separate_stream():
    for number, stream in enumerate(STREAMS):
        found = separate_stream(whole_stream(DATA, segment=number))
        assert np.array_equal(meshreel.decode(found).vertices, meshreel.decode(stream).vertices)
        assert meshreel.info(found).start_s == 2.0 + [0, 4, 9][number] / 25
    assert separate_stream(whole_stream(DATA, segment=0)) == STREAMS[0]


def test_segment_is_served_as_a_separate_stream(path):
    with meshreel.open(path, segment=1) as reel:
        served = reel.stored(0, reel.size_bytes)
        assert np.array_equal(meshreel.decode(served).vertices, reel[:].vertices)
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
