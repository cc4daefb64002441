"""Encoding of frames added in order."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.streaming import Encoder
from meshreel.errors import InvalidInputError
from meshreel.metrics.position_errors import position_errors
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid
from samples.streams import recorded

SEQUENCE = waving_grid(43)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("reel", {}),
        ("reel", {"max_error": 0.3, "effort": 5}),
        ("blocks", {"n_modes": 4}),
        ("pca-qp", {}),
    ],
)
def test_frames_of_one_block_equal_those_of_encode(method, options):
    sequence = irregular_sequence(9)
    online = decode(recorded(sequence, method=method, block_frames=9, **options))
    at_once = decode(encode(sequence, method, block_frames=9, **options))
    np.testing.assert_array_equal(online.vertices, at_once.vertices)
    np.testing.assert_array_equal(online.faces, at_once.faces)


@pytest.mark.parametrize("method", ["reel", "blocks", "pca-qp", "v2v"])
def test_error_is_small_with_many_blocks(method):
    data = recorded(SEQUENCE, method=method, block_frames=10)
    assert info(data).block_frames == (10, 10, 10, 10, 3)
    assert kg_error_percent(SEQUENCE.vertices, decode(data).vertices) < 2.5


def test_later_blocks_take_fewer_bytes_than_the_first():
    sequence = waving_grid(60, 40, 41)
    data = recorded(sequence, block_frames=20)
    alone = [
        len(encode(meshreel.MeshSequence(sequence.vertices[number : number + 20], sequence.faces)))
        for number in (20, 40)
    ]
    connectivity = info(data).budget_bytes["connectivity"]
    assert sum(info(data).block_bytes[1:]) < 0.8 * (sum(alone) - 2 * connectivity)


def test_latency_determines_the_block_length():
    data = recorded(SEQUENCE, max_latency_s=0.5)
    expected = int(0.5 * 15 / 16 * (SEQUENCE.fps or 25))
    assert info(data).block_frames[0] == expected


def test_error_bound_holds_for_frames_outside_the_first_box():
    growing = meshreel.MeshSequence(
        SEQUENCE.vertices * np.linspace(1, 30, 43, dtype=np.float32)[:, None, None], SEQUENCE.faces
    )
    data = recorded(growing, block_frames=8, max_error=0.5)
    result = position_errors(growing.vertices, decode(data).vertices).max_error_percent
    assert info(data).error_bound_percent == 0.5
    assert result <= 0.5


def test_growing_file_is_readable_up_to_the_last_block(tmp_path):
    path = tmp_path / "live.reel"
    encoder = Encoder(SEQUENCE.faces, path, block_frames=10)
    for frame in SEQUENCE.vertices[:25]:
        encoder.push(frame)
    encoder._wait_for_all()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (20, False)
        assert_parts_sum(reel.info())
    encoder.close()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (25, True)
        assert_parts_sum(reel.info())


def assert_parts_sum(stream):
    """The bytes of parts of a stream sum to its size."""
    assert min(stream.part_bytes.values()) > 0
    assert sum(stream.part_bytes.values()) == stream.size_bytes


RECORDING = """
    import itertools, sys, time
    import meshreel
    sequence = meshreel.simulate_flag(40)
    encoder = meshreel.Encoder(sequence.faces, sys.argv[1], block_frames=5)
    for number in itertools.count():
        encoder.push(sequence.vertices[number % 40])
        print(number, flush=True)
        time.sleep(0.002)
"""


@pytest.mark.slow
def test_file_of_a_killed_encoder_is_readable_up_to_the_last_block(tmp_path):
    path = tmp_path / "killed.reel"
    command = [sys.executable, "-c", textwrap.dedent(RECORDING), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        while int(process.stdout.readline()) < 33:
            pass
        process.send_signal(signal.SIGKILL)
    n_written = os.path.getsize(path)
    flag = meshreel.simulate_flag(40)
    with meshreel.open(path) as reel:
        assert not reel.is_whole
        assert len(reel) % 5 == 0
        assert len(reel) >= 20
        shown = np.stack([frame.vertices for frame in reel])[:40]
        assert kg_error_percent(flag.vertices[: len(shown)], shown) < 3
    assert os.path.getsize(path) == n_written


def test_pushed_frames_are_kept_when_the_source_fails(tmp_path):
    path = tmp_path / "stopped.reel"

    def record():
        with Encoder(SEQUENCE.faces, path, block_frames=10) as encoder:
            for number, frame in enumerate(SEQUENCE.vertices):
                if number == 17:
                    raise KeyboardInterrupt
                encoder.push(frame)

    with pytest.raises(KeyboardInterrupt):
        record()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (17, True)


def test_no_file_is_left_without_pushed_frames(tmp_path):
    path = tmp_path / "empty.reel"
    with pytest.raises(InvalidInputError, match="no frame was pushed"):
        Encoder(SEQUENCE.faces, path).close()
    assert not path.exists()


def test_existing_file_is_kept(tmp_path):
    path = tmp_path / "there.reel"
    path.write_bytes(b"mine")
    with pytest.raises(InvalidInputError, match="exists"):
        Encoder(SEQUENCE.faces, path)
    assert path.read_bytes() == b"mine"


def test_path_without_the_extension_reel_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"live\.glb must end in \.reel; got \.glb"):
        Encoder(SEQUENCE.faces, tmp_path / "live.glb")
    assert list(tmp_path.iterdir()) == []


FILLING = """
    import resource, sys
    import meshreel
    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))
    sequence = meshreel.simulate_flag(40)
    try:
        with meshreel.Encoder(sequence.faces, sys.argv[1], block_frames=5) as encoder:
            for frame in sequence.vertices:
                encoder.push(frame)
    except OSError as error:
        print(error.filename)
"""


@pytest.mark.slow
def test_error_names_a_file_that_grows_too_large(tmp_path):
    pytest.importorskip("resource")
    path = tmp_path / "live.reel"
    command = [sys.executable, "-c", textwrap.dedent(FILLING), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == (f"{path}\n", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *(({name: 1.0}, "needs the whole sequence") for name in ("kg", "sted", "bpvf", "size")),
        ({"block_frames": "all"}, "'auto'; got 'all'"),
        ({"max_latency_s": 0}, "above 0; got 0"),
        ({"qualty": 3}, "option 'qualty' is unknown; did you mean 'quality'"),
        ({"fps": -1}, "fps"),
    ],
)
def test_options_without_a_meaning_for_live_frames_are_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        Encoder(SEQUENCE.faces, BytesIO(), **options)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (np.zeros((5, 3), np.float32), "frame 1 has 5 vertices of type float32; frame 0 has 99"),
        (SEQUENCE.vertices[0].astype(np.float64), "of type float64"),
        (np.full_like(SEQUENCE.vertices[0], np.nan), "must be finite"),
        (SEQUENCE.vertices, r"shape \(V, 3\)"),
    ],
)
def test_recording_continues_after_a_refused_frame(frame, message):
    file = BytesIO()
    with Encoder(SEQUENCE.faces, file, block_frames=2) as encoder:
        encoder.push(SEQUENCE.vertices[0])
        with pytest.raises(InvalidInputError, match=message):
            encoder.push(frame)
        encoder.push(SEQUENCE.vertices[1])
    assert info(file.getvalue()).n_frames == 2


def test_pushed_frames_are_copied():
    frame, file = np.empty_like(SEQUENCE.vertices[0]), BytesIO()
    with Encoder(SEQUENCE.faces, file, block_frames=43) as encoder:
        for vertex in SEQUENCE.vertices:
            frame[:] = vertex
            encoder.push(frame)
    expected = decode(recorded(SEQUENCE, block_frames=43)).vertices
    np.testing.assert_array_equal(decode(file.getvalue()).vertices, expected)


def test_latency_is_measured_until_blocks_are_written():
    start = time.perf_counter()
    with Encoder(SEQUENCE.faces, BytesIO(), block_frames=10) as encoder:
        for frame in SEQUENCE.vertices:
            encoder.push(frame)
    assert 0 < encoder.latency_s <= time.perf_counter() - start


def test_error_of_a_block_is_raised_when_the_next_one_is_complete():
    far = SEQUENCE.vertices * np.float32(1e12)
    encoder = Encoder(SEQUENCE.faces, BytesIO(), block_frames=5, max_error=1e-3)
    for frame in SEQUENCE.vertices[:5]:
        encoder.push(frame)
    for frame in far[:4]:
        encoder.push(frame)
    encoder.push(far[4])
    with pytest.raises(InvalidInputError, match="cannot be guaranteed"):
        encoder.close()


@pytest.mark.parametrize("max_error", [1e-9, 1e-12])
def test_bounds_finer_than_the_integers_of_a_stream_are_kept(max_error):
    sequence = waving_grid(6, dtype=np.float64)
    data = recorded(sequence, block_frames=3, max_error=max_error)
    errors = np.linalg.norm(decode(data).vertices - sequence.vertices, axis=2)
    assert errors.max() <= max_error / 100 * info(data).diagonal
