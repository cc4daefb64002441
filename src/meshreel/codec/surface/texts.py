"""Text in payloads of sections: its length in bytes, and UTF-8."""

from meshreel.codec.bitstream.container import write_varint


def write_text(text: str) -> bytes:
    """The bytes of a text, its length before it."""
    data = text.encode("utf-8", errors="replace")
    return write_varint(len(data)) + data
