import pytest

from meshreel.codec.config import EncoderConfig
from meshreel.errors import InvalidInputError


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"method": "zip"},
            "method 'zip' is unknown; choose pca-qp, pca, pca-q, v2v, pca-qs,",
        ),
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
        ({"n_iterations": 0}, "n_iterations must be"),
        ({"allocation": "even"}, "allocation 'even' is unknown; choose energy, constant"),
        ({"bits": []}, "bits is an empty list"),
        ({"bits": [8, 1]}, "bits of row 1 must be 0 or 2..24; got 1"),
        ({"method": "pca-q", "anchors": 0.01}, "pca-q decodes with L alone"),
        ({"method": "v2v", "anchors": 0.01}, "v2v decodes with the product"),
        ({"method": "pca-qp", "step": 0.001}, "pca-qp takes bits, not step"),
        ({"method": "reel", "bits": 8}, "reel takes step, not bits"),
        ({"method": "reel", "anchors": 0.1}, "reel takes step, not anchors"),
        ({"method": "reel", "step": 0.0}, "step is in diagonals of the bounding box"),
        ({"method": "gft", "energy": 0.9}, "gft keeps a number of low frequencies"),
        ({"method": "gft", "bits": [8, 8]}, "gft takes one number of bits"),
        ({"method": "gft", "allocation": "constant"}, "gft has one step"),
    ],
)
def test_config_says_what_is_allowed_when_an_option_is_wrong(options, message):
    with pytest.raises(InvalidInputError, match=message):
        EncoderConfig(**options)
