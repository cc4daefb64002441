import pytest

from meshreel.codec.config import EncoderConfig
from meshreel.errors import InvalidInputError


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "zip"}, "method 'zip' is unknown; choose pca-qp"),
        ({"n_modes": 5, "energy": 0.9}, "exclude each other"),
        ({"n_modes": 0}, "n_modes must be a whole number of at least 1; got 0"),
        ({"n_modes": 2.5}, "n_modes must be a whole number"),
        ({"energy": 0.0}, "energy must be"),
        ({"energy": 1.5}, "energy must be"),
        ({"bits": 1}, "bits must be 2..24; got 1"),
        ({"bits": 40}, "bits must be 2..24; got 40"),
        ({"anchors": 1.5}, "anchors is a share"),
        ({"anchors": float("nan")}, "anchors is a share"),
        ({"laplacian": "fancy"}, "laplacian 'fancy' is unknown; choose normalized, combinatorial"),
        ({"order": "some"}, "order 'some' is unknown; choose keep, vertices, drop"),
        ({"block_frames": 0}, "block_frames must be"),
    ],
)
def test_config_says_what_is_allowed_when_an_option_is_wrong(options, message):
    with pytest.raises(InvalidInputError, match=message):
        EncoderConfig(**options)
