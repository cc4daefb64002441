"""The reader in C decodes what the package decodes, to the bit, and refuses what it refuses."""

import threading
from io import BytesIO

import numpy as np
import pytest

import meshreel
from conformance.make import FOLDER, STREAMS
from meshreel.bitstream.reader import open_stream
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import MeshReelError
from meshreel.kernel.normals import surface_normals
from samples import c_reader
from samples.c_reader import Decoder, File, RefusalError, by_calls, in_memory, inspect
from samples.costs import draws

OF_THE_PAPER = [name for name in STREAMS if name.startswith("paper_")]
OF_POSITIONS = [name for name in STREAMS if name not in OF_THE_PAPER]


def stored(name):
    return (FOLDER / f"{name}.reel").read_bytes()


def read_leniently(data):
    """What the package reads of a file that may be damaged: triangles and positions, or None."""
    try:
        opened = ReelFile(BytesIO(data))
        return opened.faces, opened.read(0, len(opened))
    except MeshReelError:
        return None


def refusal(act):
    """The code that an act is refused with; OK if it is not."""
    try:
        act()
    except RefusalError as refused:
        return refused.code
    return c_reader.OK


def test_frames_are_the_same_bits_as_those_of_the_package():
    rng = np.random.default_rng(5)
    for name in OF_POSITIONS:
        data = stored(name)
        wanted = meshreel.decode(data)
        file = File(in_memory(data), off=int(rng.integers(64)))
        found = file.frames(rng.permutation(file.info.n_frames))
        assert found.tobytes() == wanted.vertices.tobytes(), name
        assert np.array_equal(file.triangles, wanted.faces), name


def test_a_file_is_read_by_calls_as_it_is_in_memory():
    for name in ("everything_quantised", "key_blocks", "live_with_bound", "grid", "order_shuffled"):
        data = stored(name)
        found, wanted = File(by_calls(data)), File(in_memory(data))
        assert found.frames().tobytes() == wanted.frames().tobytes(), name
        assert np.array_equal(found.triangles, wanted.triangles), name


def test_a_file_says_of_itself_what_the_package_says():
    for name in OF_POSITIONS:
        data = stored(name)
        said, opened = inspect(in_memory(data)), OpenStream(open_stream(BytesIO(data)))
        stream, header = opened.stream, opened.stream.header
        assert (said.n_frames, said.n_verts) == (stream.n_frames, header.n_verts), name
        assert (said.n_triangles, said.fps) == (header.n_faces, header.fps), name
        assert (said.diagonal, tuple(said.centre)) == (header.scale, header.origin), name
        assert (said.n_blocks, said.n_tracks) == (len(stream.places), len(opened.tracks))
        assert (said.method, said.order) == (header.method, header.order), name
        assert said.start_s == opened.start_s, name
        assert said.is_whole == stream.is_whole, name


@pytest.mark.parametrize("name", [OF_THE_PAPER[0], OF_THE_PAPER[-1]])
def test_methods_of_the_paper_are_refused_by_a_code_of_their_own(name):
    assert refusal(lambda: inspect(in_memory(stored(name)))) == c_reader.METHOD
    assert "meshreel decode" in c_reader.words(c_reader.METHOD)


def test_less_memory_than_stated_is_refused():
    source = in_memory(stored("max_error_in_blocks"))
    file = File(source)
    for given in (0, 1, 100, file.info.file_bytes // 2, file.info.file_bytes - 1):
        assert refusal(lambda given=given: File(source, given)) == c_reader.NO_MEMORY
    for given in (0, 1, 100, file.info.decoder_bytes - 1):
        assert refusal(lambda given=given: Decoder(file, given)) == c_reader.NO_MEMORY


def test_a_frame_that_does_not_exist_is_refused_and_the_decoder_goes_on():
    file = File(in_memory(stored("key_blocks")))
    decoder, n_frames = Decoder(file), file.info.n_frames
    before = decoder.frame(3)
    assert refusal(lambda: decoder.frame(n_frames)) == c_reader.INVALID
    assert refusal(lambda: decoder.load(n_frames)) == c_reader.INVALID
    assert refusal(lambda: file.block_of(n_frames)) == c_reader.INVALID
    assert refusal(lambda: decoder.frame(0, np.float64)) == c_reader.INVALID
    assert np.array_equal(decoder.frame(3), before)


def test_blocks_hold_all_frames_one_after_another():
    file = File(in_memory(stored("key_blocks")))
    found, frame = [], 0
    while frame < file.info.n_frames:
        first, count = file.block_of(frame)
        assert first == frame
        assert file.block_of(first + count - 1) == (first, count)
        found.append(count)
        frame += count
    assert len(found) == file.info.n_blocks > 1
    assert max(found) == file.info.longest_block


def test_floats_of_a_file_of_doubles_are_its_doubles_rounded():
    for name in ("doubles", "lossless_doubles", "grid_doubles"):
        file = File(in_memory(stored(name)))
        decoder = Decoder(file)
        assert np.array_equal(decoder.frame(1), decoder.frame(1, np.float64).astype(np.float32))


def test_doubles_beyond_float_are_refused_as_floats_only():
    huge = np.array([[0.0, 0, 0], [1e300, 0, 0], [0, 1e300, 0]])
    sequence = meshreel.MeshSequence(np.stack([huge, huge / 2]), [[0, 1, 2]])
    file = File(in_memory(meshreel.encode(sequence, method="lossless")))
    decoder = Decoder(file)
    assert refusal(lambda: decoder.frame(0)) == c_reader.RANGE
    assert np.array_equal(decoder.frame(0, np.float64), huge)


def test_normals_are_those_of_the_core():
    file = File(in_memory(stored("sphere")))
    decoder = Decoder(file)
    positions = decoder.frame(2)
    wanted = surface_normals(positions[None], file.triangles.astype(np.int32))[0]
    assert np.array_equal(decoder.normals(positions), wanted.astype(np.float32))


def test_decoders_of_a_file_work_on_threads_at_the_same_time():
    file = File(by_calls(stored("key_blocks")))
    wanted, found = file.frames(), {}

    def decode(number):
        order = np.random.default_rng(number).permutation(file.info.n_frames)
        found[number] = file.frames(order)

    threads = [threading.Thread(target=decode, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(found[number], wanted) for number in range(4))


def test_what_cannot_be_read_is_told_apart_from_damage():
    data = stored("two_frames")
    for place in range(len(data)):

        def act(place=place):
            File(by_calls(data, fails_at=place)).frames()

        assert refusal(act) == c_reader.UNREADABLE, place


@pytest.mark.parametrize("name", ["two_frames", "live_with_bound"])
def test_a_stream_that_is_cut_off_holds_the_same_frames_as_for_the_package(name):
    data = stored(name)
    for size in range(0, len(data), 1 + len(data) // draws(300)):
        compare_leniently(data[:size])


@pytest.mark.parametrize("name", ["corrections", "grid_live", "lossless_in_blocks", "key_blocks"])
def test_a_damaged_stream_is_refused_or_the_same_frames_as_for_the_package(name):
    rng, data = np.random.default_rng(7), stored(name)
    for place in rng.choice(len(data), min(len(data), draws(60)), replace=False):
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        compare_leniently(bytes(damaged))


def compare_leniently(data):
    """The reader in C and the package make the same of bytes that may be damaged."""
    wanted = read_leniently(data)
    code = refusal(lambda: File(in_memory(data)).frames())
    if wanted is None:
        assert code in (c_reader.TRUNCATED, c_reader.CORRUPT, c_reader.UNSUPPORTED)
        return
    assert code == c_reader.OK
    file = File(in_memory(data))
    assert np.array_equal(file.triangles, wanted[0])
    assert file.frames().tobytes() == wanted[1].tobytes()
