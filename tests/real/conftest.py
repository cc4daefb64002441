"""The folder of the real sequences, which MESHREEL_DATA names."""

import os
from pathlib import Path

import pytest

import meshreel


@pytest.fixture(scope="session")
def data():
    """The folder; skips the test if it is not set."""
    if "MESHREEL_DATA" not in os.environ:
        pytest.skip("MESHREEL_DATA is not set")
    return Path(os.environ["MESHREEL_DATA"])


@pytest.fixture(scope="session")
def existing(data):
    """A function that returns the path of a file or folder; skips the test if it is missing."""

    def path_of(name):
        if not (data / name).exists():
            pytest.skip(f"{name} is missing")
        return data / name

    return path_of


@pytest.fixture(scope="session")
def sequence_named(existing):
    """A function that returns the first frames of a sequence by name."""

    def read(name, n_frames=None):
        sequence = meshreel.load(existing(f"{name}.npz"))
        return sequence.replace(vertices=sequence.vertices[:n_frames])

    return read
