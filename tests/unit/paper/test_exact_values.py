import numpy as np
import pytest

from meshreel.errors import CorruptStreamError
from meshreel.paper.exact_values import decode_exact, encode_exact


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_values_are_lossless(dtype):
    values = np.random.default_rng(0).normal(size=(5, 4, 3)).astype(dtype)
    values[1, 2] = [-0.0, np.finfo(dtype).tiny, np.finfo(dtype).max]
    values[2:4, 1] = [np.nan, np.inf, -np.inf]
    back = decode_exact(encode_exact(values), values.shape, dtype)
    assert back.tobytes() == values.tobytes()


def test_static_values_take_few_bytes():
    values = np.tile(np.random.default_rng(0).normal(size=(1, 10, 3)), (500, 1, 1))
    assert len(encode_exact(values)) < 340


def test_size_is_proportional_to_the_changes_of_smooth_motion():
    t = np.linspace(0, 6, 200)[:, None, None]
    phases = np.random.default_rng(1).random((1, 20, 3))
    values = np.sin(t + 6 * phases).astype(np.float32)
    assert len(encode_exact(values)) < 0.62 * values.nbytes


@pytest.mark.parametrize("data", [b"", b"\x02", encode_exact(np.zeros((2, 2, 3))) + b"\0\0\0"])
def test_decoding_refuses_another_shape(data):
    with pytest.raises(CorruptStreamError):
        decode_exact(data, (1000, 2, 3), np.float64)
