"""`--memory` of the commands that decode."""

import pytest
from click.testing import CliRunner

import meshreel
from meshreel.app.cli.app import app
from meshreel.app.cli.messages import with_options
from samples.meshes import waving_grid


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    path = tmp_path_factory.mktemp("memory") / "waves.reel"
    path.write_bytes(meshreel.encode(waving_grid(4, 4, 5), step=0.01))
    return path


def run(*words):
    return CliRunner().invoke(app, [*map(str, words)])


def error_of(done):
    """Return the error as the program prints it."""
    assert done.exit_code == 1
    return with_options(done.exception.message)


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
    error = error_of(run(*arguments, "--memory", "10kB"))
    assert "a mesh of 20 vertices and 24 faces would take 13.3 kB of memory" in error
    assert "allow more with --memory" in error


def test_stream_is_decoded_within_the_memory_limit(stream, tmp_path):
    done = run("decode", stream, "-o", tmp_path / "waves.npz", "--memory", "2MB")
    assert done.exit_code == 0, done.output
    assert meshreel.load(tmp_path / "waves.npz").n_frames == 4


def test_invalid_size_is_rejected(stream):
    done = run("info", stream, "--memory", "much")
    assert error_of(done).startswith("--memory takes a size such as 100kB or 1GiB")
