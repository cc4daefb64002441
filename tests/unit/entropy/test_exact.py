import numpy as np
import pytest

from meshreel.entropy.exact import decode_exact, encode_exact
from meshreel.errors import CorruptStreamError


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_values_come_back_bit_by_bit_when_coded(dtype):
    values = np.random.default_rng(0).normal(size=(5, 4, 3)).astype(dtype)
    values[1, 2] = [-0.0, np.finfo(dtype).tiny, np.finfo(dtype).max]
    back = decode_exact(encode_exact(values), values.shape, dtype)
    assert back.tobytes() == values.tobytes()


def test_size_is_small_when_nothing_moves():
    values = np.tile(np.random.default_rng(0).normal(size=(1, 10, 3)), (500, 1, 1))
    assert len(encode_exact(values)) < 1000


@pytest.mark.parametrize("data", [b"", b"\x00", encode_exact(np.zeros((2, 2, 3)))])
def test_decoding_raises_when_the_shape_does_not_fit(data):
    with pytest.raises(CorruptStreamError):
        decode_exact(data, (3, 2, 3), np.float64)
