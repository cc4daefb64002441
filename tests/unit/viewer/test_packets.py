"""Arrays that a page reads in place."""

import numpy as np
import pytest

from meshreel.viewer.packets import TYPES, packet
from samples.packets import read_packet


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("shape", [(5, 3), (7,), (0, 3), (2, 3, 4)])
def test_packet_gives_arrays_back_when_it_is_read(name, shape):
    values = np.arange(np.prod(shape)).reshape(shape).astype(name)
    header, arrays = read_packet(packet({"first": values[:1], "second": values}, n_modes=3))
    assert header["n_modes"] == 3
    assert arrays["second"].dtype == np.dtype(name)
    np.testing.assert_array_equal(arrays["second"], values)
    np.testing.assert_array_equal(arrays["first"], values[:1])


def test_packet_is_little_endian_when_arrays_are_not():
    values = np.arange(4, dtype=">f4")
    _, arrays = read_packet(packet({"values": values}))
    np.testing.assert_array_equal(arrays["values"], np.arange(4))


def test_packet_begins_arrays_at_eight_bytes_when_names_have_any_length():
    for length in range(1, 20):
        data = packet({"x" * length: np.array([1], np.uint8), "y": np.array([2], np.float32)})
        assert len(data) % 8 == 0
        assert read_packet(data)[1]["y"] == 2
