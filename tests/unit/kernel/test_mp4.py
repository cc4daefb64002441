"""The box of an MP4 file that contains a `.reel`, and damaged files."""

import io
from contextlib import suppress

import fsspec
import numpy as np
import pytest

import meshreel
from meshreel.kernel import mp4 as containers
from meshreel.runtime.stores.ranged_file import RangedFile
from samples.commands import run, run_json
from samples.mp4 import REEL, box, mp4


@pytest.fixture(scope="module")
def stream():
    return meshreel.encode(meshreel.simulate_flag(6))


@pytest.mark.parametrize(
    "place",
    [
        lambda data: mp4(containers.reel_box(data)),
        lambda data: mp4(box(b"uuid", REEL, data, wide=True), box(b"free", bytes(9))),
        lambda data: mp4(box(b"uuid", REEL, data, size=0)),
        lambda data: mp4(box(b"uuid", bytes(16)), box(b"uuid", REEL, data), box(b"junk", size=7)),
    ],
)
def test_the_stream_is_found_in_bytes_and_files(place, stream, tmp_path):
    data, path = place(stream), tmp_path / "walk.mp4"
    path.write_bytes(data)
    vertices = meshreel.decode(stream).vertices
    for source in (data, path, io.BytesIO(data), path.open("rb")):
        with meshreel.open(source) as reel:
            reel.require_whole()
            assert np.array_equal(reel.read(0, 6), vertices)
            assert reel.stored(0, 1 << 30) == stream
    for source in (data, path):
        assert np.array_equal(meshreel.decode(source).vertices, vertices)
        assert meshreel.info(source) == meshreel.open(data).info()
    notes = []
    assert np.array_equal(meshreel.load(path, notes=notes).vertices, vertices)
    assert "the video, which is the texture" in notes[0]


def test_the_description_has_the_rates_of_video_and_sound(stream, tmp_path):
    path = tmp_path / "walk.mp4"
    path.write_bytes(mp4(containers.reel_box(stream)))
    video, sound = meshreel.info(path).media
    assert video == containers.MediaTrack("video", "avc1", 1200, 0.12)
    assert (sound.kind, sound.size_bytes, sound.mbit_per_s) == ("sound", 300, pytest.approx(0.024))
    assert "1.2 kB, 0.08 Mbit/s, avc1" in run("info", path).stdout
    assert run_json("info", path)["media"][1]["codec"] == "mp4a"
    huge = type("Huge", (bytes,), {"__len__": lambda _: 1 << 32})()
    assert containers.reel_box(huge)[:8] == b"\0\0\0\1uuid"


def test_a_remote_file_is_read_by_ranges(stream):
    data = mp4(containers.reel_box(stream), n_media=1 << 20)
    fsspec.filesystem("memory").pipe("/mp4/walk.mp4", data)
    file = RangedFile("memory://mp4/walk.mp4")
    with meshreel.open(file) as reel:
        assert np.array_equal(reel.read(0, 6), meshreel.decode(stream).vertices)
    assert file.fetched_bytes < 1 << 17


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (mp4(), "is an MP4 file without a .reel in it; `meshreel register"),
        (mp4(*[box(b"free")] * 99), "without a .reel"),
        (mp4(box(b"free", size=4)), r"a box at byte \d+ of the MP4 file exceeds it"),
        (mp4(box(b"free", size=1 << 31)), "exceeds it; fetch the file again"),
        (mp4(box(b"free", size=0, wide=True)), "exceeds it"),
        (mp4(box(b"free", size=(1 << 64) - 1, wide=True)), "exceeds it"),
        (mp4(box(b"free", size=0), box(b"uuid", REEL)), "without a .reel"),
        (mp4(box(b"uuid", REEL)), "not a .reel stream|too short|ends"),
        (mp4(box(b"uuid", REEL[:9])), "without a .reel"),
        (mp4(box(b"uuid", REEL, mp4())), "not a .reel stream"),
    ],
)
@pytest.mark.parametrize("reads", [meshreel.open, meshreel.info, meshreel.decode])
def test_damaged_files_are_errors(data, message, reads, tmp_path):
    path = tmp_path / "bad.mp4"
    path.write_bytes(data)
    for source in (path, data):
        with pytest.raises(meshreel.CorruptStreamError, match=message) as error:
            reads(source)
        assert str(path) in str(error.value) or source is data


@pytest.mark.parametrize("n_kept", range(8, 700, 23))
def test_a_damaged_description_is_an_error_or_lists_less(n_kept, stream):
    whole = mp4(containers.reel_box(stream))
    start, stop = whole.index(b"moov") + 4, whole.index(b"mdat") - 4
    movie = whole[start:stop][: n_kept - 8]
    for damaged in (movie, movie.replace(b"\0\0\0\0", b"\xff\xff\xff\xff")):
        data = box(b"ftyp", bytes(8)) + box(b"moov", damaged) + containers.reel_box(stream)
        with suppress(meshreel.CorruptStreamError):
            assert len(meshreel.info(data).media) <= 2
