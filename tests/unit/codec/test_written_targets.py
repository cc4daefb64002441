"""Targets given as text with units: equal streams, and the guaranteed bound."""

from dataclasses import asdict

import numpy as np
import pytest

import meshreel
from meshreel.codec.options import config_of
from meshreel.codec.reel_options import ReelOptions
from meshreel.errors import InvalidInputError
from samples.meshes import waving_grid
from samples.streams import recorded


def distances(sequence, decoded):
    return np.linalg.norm(decoded.vertices.astype(float) - sequence.vertices, axis=2)


@pytest.mark.parametrize(
    ("text", "number"),
    [({"max_error": "0.05%"}, {"max_error": 0.05}), ({"size": "1kB"}, {"size": 1000})],
    ids=str,
)
def test_target_as_text_gives_the_same_stream(text, number):
    assert meshreel.encode(waving_grid(), **text) == meshreel.encode(waving_grid(), **number)


@pytest.mark.parametrize(
    ("max_error", "unit", "in_units"),
    [("0.002u", None, 0.002), ("2mm", "m", 0.002), ("0.02mm", "cm", 0.002)],
)
def test_every_vertex_is_within_a_bound_in_length_units(max_error, unit, in_units):
    sequence = waving_grid()
    data = meshreel.encode(sequence, max_error=max_error, unit=unit)
    farthest = distances(sequence, meshreel.decode(data)).max()
    assert in_units / 20 < farthest <= in_units
    stream = meshreel.info(data)
    bound = stream.error_bound_percent / 100 * stream.diagonal
    assert bound == pytest.approx(in_units, rel=1e-12)


def test_every_vertex_of_live_frames_is_within_a_bound_in_length_units():
    data = recorded(waving_grid(), block_frames=5, max_error="0.002u")
    assert distances(waving_grid(), meshreel.decode(data)).max() <= 0.002


def test_options_given_as_text_are_numbers():
    config = config_of(max_error="0.5mm", unit="cm", memory="1kB")
    assert config == ReelOptions(max_error="0.05u", memory=1000.0)
    assert config_of(**asdict(config)) == config


def test_refused_bound_is_reported_in_the_unit_of_the_request():
    words = r"1e-12 model units are .* % of the diagonal: max_error .* cannot be guaranteed"
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(waving_grid(), max_error="1e-12u")


def test_unit_without_a_number_is_refused():
    with pytest.raises(InvalidInputError, match="unit applies to a length in max_error"):
        config_of(unit="mm")
