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
    "words",
    [
        ("decode", "{}", "-o", "{}.npz"),
        ("compare", "{}", "{}"),
        ("render", "{}", "-o", "{}.png"),
        ("export", "{}", "-o", "{}.html"),
        ("info", "{}"),
    ],
    ids=lambda words: words[0],
)
def test_commands_reject_a_stream_that_exceeds_the_memory_limit(stream, words):
    arguments = [word.format(stream) for word in words]
    needed = "a mesh of 20 vertices and 24 faces would take 13.3 kB of memory"
    assert_fails(run(*arguments, "--memory", "10kB"), needed, "allow more with --memory")


def test_stream_is_decoded_within_the_memory_limit(stream, tmp_path):
    run_ok("decode", stream, "-o", tmp_path / "waves.npz", "--memory", "2MB")
    assert meshreel.load(tmp_path / "waves.npz").n_frames == 4


def test_invalid_size_is_rejected(stream):
    done = run("info", stream, "--memory", "much")
    assert_fails(done, "meshreel: --memory takes a size such as 100kB or 1GiB")
