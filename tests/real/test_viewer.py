"""Real sequences as the player plays them."""

import os
from pathlib import Path

import pytest

import meshreel
from samples.packets import largest_error

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MESHREEL_DATA" not in os.environ, reason="MESHREEL_DATA is not set"),
]


@pytest.mark.parametrize("name", ["samba", "chicken", "jumping"])
def test_player_shows_what_is_decoded_when_the_sequence_is_real(name):
    data = meshreel.encode(meshreel.load(Path(os.environ["MESHREEL_DATA"]) / f"{name}.npz"))
    assert largest_error(data) < 2e-5
    assert largest_error(data, 9e-5) < 1e-4
