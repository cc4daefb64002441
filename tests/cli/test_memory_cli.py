"""`--memory` of the commands that decode."""

import pytest

import meshreel
from samples.commands import assert_fails, run, run_ok
from samples.meshes import waving_grid


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    path = tmp_path_factory.mktemp("memory") / "waves.reel"
    path.write_bytes(meshreel.encode(waving_grid(4, 4, 5), step=0.01))
    return path


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("10kB", ("decode", "{}", "-o", "{}.npz")),
        ("10kB", ("compare", "{}", "{}")),
        ("10kB", ("render", "{}", "-o", "{}.png")),
        ("10kB", ("export", "{}", "-o", "{}.html")),
        ("1kB", ("info", "{}")),
    ],
)
def test_commands_reject_a_stream_that_exceeds_the_memory_limit(stream, words, limit):
    arguments = [word.format(stream) for word in words]
    done = run(*arguments, "--memory", limit)
    assert_fails(done, "decoding would take ", "allow more with --memory")


def test_stream_is_decoded_within_the_memory_limit(stream, tmp_path):
    run_ok("decode", stream, "-o", tmp_path / "waves.npz", "--memory", "2MB")
    assert meshreel.load(tmp_path / "waves.npz").n_frames == 4
