import pytest

from meshreel.codec.stored_blocks import read_block
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError


@pytest.mark.parametrize(("n_frames", "n_modes"), [(0, 4), (3, 0), (0, 0)])
def test_block_is_refused_when_a_number_is_zero(n_frames, n_modes):
    with pytest.raises(CorruptStreamError):
        read_block(write_varint(n_frames) + write_varint(n_modes))
