"""`--memory` of the commands that decode: what a `.reel` may take, and how to allow more."""

import pytest
from click.testing import CliRunner

import meshreel
from meshreel.app.cli.app import app
from meshreel.app.cli.messages import with_option_names
from samples.meshes import waving_grid


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    path = tmp_path_factory.mktemp("memory") / "waves.reel"
    path.write_bytes(meshreel.encode(waving_grid(4, 4, 5), step=0.01))
    return path


def run(*words):
    return CliRunner().invoke(app, [*map(str, words)])


def told_by(done):
    """The error, as the program prints it."""
    assert done.exit_code == 1
    return with_option_names(str(done.exception))


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
def test_a_stream_is_refused_by_every_command_that_decodes(stream, words):
    given = [word.format(stream) for word in words]
    error = told_by(run(*given, "--memory", "10kB"))
    assert "a mesh of 20 vertices and 24 faces would take 13.3 kB of memory" in error
    assert "allow more with --memory" in error


def test_a_stream_is_decoded_when_memory_allows_it(stream, tmp_path):
    found = run("decode", stream, "-o", tmp_path / "waves.npz", "--memory", "2MB")
    assert found.exit_code == 0, found.output
    assert meshreel.load(tmp_path / "waves.npz").n_frames == 4


def test_a_size_that_is_none_is_refused(stream):
    found = run("info", stream, "--memory", "much")
    assert told_by(found).startswith("--memory takes a size such as 100kB or 1GiB")
