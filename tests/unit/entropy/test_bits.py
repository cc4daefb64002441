import numpy as np

from meshreel.entropy.bits import pack_bits, packed_size_bytes, unpack_bits


def test_fields_lie_low_bits_first_when_packed():
    # 1 (1 bit), 2 (2 bits), 255 (8 bits): 1 | 2 << 1 | 255 << 3 = 0x7FD
    assert pack_bits(np.array([1, 2, 255]), np.array([1, 2, 8])) == b"\xfd\x07"


def test_fields_come_back_when_widths_are_mixed():
    rng = np.random.default_rng(0)
    widths = rng.integers(0, 33, 500)
    fields = rng.integers(0, 2**32, 500) & ((1 << widths) - 1)
    packed = pack_bits(fields, widths)
    assert len(packed) == packed_size_bytes(widths)
    np.testing.assert_array_equal(unpack_bits(packed, widths), fields)


def test_nothing_is_written_when_all_widths_are_zero():
    assert pack_bits(np.zeros(4, int), np.zeros(4, int)) == b""
    assert unpack_bits(b"", np.zeros(4, int)).tolist() == [0, 0, 0, 0]
