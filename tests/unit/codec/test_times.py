"""Times of frames in streams, and notes about tracks of solver state."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.joining import join_streams
from meshreel.codec.solver_state import solver_state_note
from meshreel.codec.times import write_times
from meshreel.errors import InvalidInputError
from samples.meshes import quad_sheet, waving_grid

RNG = np.random.default_rng(0)
TIMES: dict[str, list[float]] = {
    "solver": [0, 0.005, 0.01, 0.015, 0.0175],
    "random": np.cumsum(RNG.exponential(size=5)).tolist(),
    "across 0": [-2.0, -1.0, 0.0, 1e-300, 3.0],
    "huge": [-1e308, -9e307, 0, 1, 1e100],
    "neighbors": [1, *(1 + np.cumsum([1, 2, 1, 5]) * 2.0**-52)],
    "two": [0.1, 7.5],
    "late": [1e6, 1e6 + 0.011, 1e6 + 0.02],
    "closest": [0, 5e-324, 1e-323],
}


@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_times_are_exact(times):
    sequence = waving_grid(len(times)).replace(times=times)
    stream = meshreel.encode(sequence, block_frames=2)
    decoded = meshreel.decode(stream)
    if sequence.timing.times is not None:
        np.testing.assert_array_equal(decoded.times, times)
    assert decoded.timing == sequence.timing
    assert meshreel.ReelFile(BytesIO(stream)).timing == sequence.timing


def test_times_of_solvers_take_few_bytes():
    regular = 0.005 * np.arange(101)
    regular[-1] = 0.4975
    assert len(write_times(regular)) < 1.3 * len(regular) + 16
    irregular = np.cumsum(RNG.exponential(size=1000))
    assert len(write_times(irregular)) < 8.9 * len(irregular)


def test_even_times_take_no_byte():
    sequence = waving_grid(5).replace(fps=25)
    timed = waving_grid(5).replace(times=np.arange(5) / 25)
    assert meshreel.encode(sequence) == meshreel.encode(timed)


def test_joined_streams_keep_times():
    parts = waving_grid(3).replace(times=[0, 1, 3]), quad_sheet(2).replace(times=[4, 4.5])
    stream = join_streams([meshreel.encode(part) for part in parts])
    assert meshreel.decode(stream).times.tolist() == [0, 1, 3, 4, 4.5]
    assert meshreel.decode(stream, segment=1).times.tolist() == [4, 4.5]
    assert meshreel.ReelFile(BytesIO(stream)).segments[1].times.tolist() == [4, 4.5]


GRID = waving_grid(5)


def recorded(times, **options):
    output = BytesIO()
    with meshreel.Encoder(GRID.faces, output, block_frames=2, **options) as encoder:
        for time, frame in zip(times, GRID.vertices, strict=True):
            encoder.push(frame, time=time)
    return output.getvalue()


def test_recordings_at_even_times_have_a_rate():
    assert meshreel.decode(recorded(np.arange(5) / 50)).fps == 50


def test_a_recording_that_is_cut_off_has_its_nominal_rate():
    stream = recorded(TIMES["solver"], fps=200)
    reel = meshreel.ReelFile(BytesIO(stream[:-40]))
    assert (reel.is_whole, reel.fps, reel.n_frames) == (False, 200, 5)
    whole = meshreel.encode(waving_grid(5).replace(times=TIMES["solver"]), block_frames=2)
    reel = meshreel.ReelFile(BytesIO(whole[: 3 * len(whole) // 4]))
    assert not reel.is_whole
    np.testing.assert_array_equal(reel.times, TIMES["solver"][: reel.n_frames])


def test_times_of_a_recording_are_found_without_the_index():
    stream = recorded(TIMES["solver"])
    end = stream.index(bytes([Section.INDEX]), len(stream) - 60)
    reel = meshreel.ReelFile(BytesIO(stream[:end]))
    assert reel.times.tolist() == TIMES["solver"]


@pytest.mark.parametrize(
    ("times", "options", "message"),
    [
        ([0, 1, None, 2, 3], {}, "frame 2 has no time"),
        ([None, 1, 2, 3, 4], {}, "frame 1 has a time"),
        ([0, 1, 1, 2, 3], {}, "times must ascend"),
        ([0, 1, 2, 3, 5], {"start_s": 1.0}, "start_s is not set"),
    ],
)
def test_invalid_times_of_a_recording_are_refused(times, options, message):
    with pytest.raises(InvalidInputError, match=message):
        recorded(times, **options)


SMALL_GRID = waving_grid(6)
NAMES = ("pprevious", "oldP", "previous")


def tracks_of(*names):
    tracks = {name: meshreel.Track(SMALL_GRID.vertices, kind="vector") for name in names}
    sequence = meshreel.MeshSequence(SMALL_GRID.vertices, SMALL_GRID.faces, 25, tracks=tracks)
    return meshreel.info(meshreel.encode(sequence)).tracks


def test_tracks_of_solver_state_are_noted_with_all_sizes():
    tracks = tracks_of(*NAMES)
    heavy, light = replace(tracks[2], size_bytes=182_091), replace(tracks[0], size_bytes=1_200)
    note = solver_state_note([light, replace(tracks[1], size_bytes=26_694), heavy], ())
    assert ": pprevious, oldP; tracks by size: " in note
    assert "previous (182 kB), oldP (26.7 kB), pprevious (1.2 kB);" in note
    assert note.endswith("drop these tracks")


def test_requested_tracks_are_not_noted():
    assert "oldP" not in solver_state_note(tracks_of(*NAMES), {"oldP"})
    assert solver_state_note(tracks_of("previous"), ()) is None
