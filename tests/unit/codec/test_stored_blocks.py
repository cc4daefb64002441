import pytest

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section, VertexType
from meshreel.bitstream.reader import read_stream
from meshreel.bitstream.writer import whole_stream
from meshreel.codec.methods import METHOD_CODES, method_named
from meshreel.codec.stored_blocks import read_block, stored_block, write_block
from meshreel.errors import CorruptStreamError


@pytest.mark.parametrize("payload", [b"\0\4", b"\0\0", b"\3\1\0"])
def test_block_is_refused_when_it_has_no_frames_or_bytes_are_left_over(payload):
    with pytest.raises(CorruptStreamError, match="frames"):
        read_block(payload)


@pytest.mark.parametrize(("method", "n_modes"), [("reel", 0), ("v2v", 0), ("lossless", 1)])
def test_block_is_refused_when_its_method_does_not_have_so_many_modes(method, n_modes):
    header = Header(
        0, 3, 1, 0.0, VertexType.FLOAT32, METHOD_CODES[method], 0, 2, (0.0, 0.0, 0.0), 1.0
    )
    block = (Section.BLOCK, write_block(3, n_modes)), (Section.VALUES, b"12")
    stream = read_stream(whole_stream(header, [(Section.CONNECTIVITY, b"abc")], [(3, block)]))
    with pytest.raises(CorruptStreamError, match=f"has {n_modes} modes"):
        stored_block(stream, method_named(method), 0)
