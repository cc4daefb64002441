"""Selection of a segment."""

from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.codec.joining import join_streams, separate_stream
from meshreel.codec.open_stream import whole_stream
from meshreel.errors import InvalidInputError, TruncatedStreamError
from samples.commands import assert_fails, run, run_json
from samples.meshes import waving_grid
from samples.streams import not_compact

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
