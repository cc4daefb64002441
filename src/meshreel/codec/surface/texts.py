"""Text in payloads of sections: its length in bytes, and UTF-8."""

from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError


def write_text(text: str) -> bytes:
    """The bytes of a text, its length before it."""
    data = text.encode("utf-8", errors="replace")
    return write_varint(len(data)) + data


def read_text(payload: bytes, position: int) -> tuple[str, int]:
    """The text that `write_text` wrote at a position, and the position after it.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If it is not UTF-8, or the payload ends inside it.
    """
    size_bytes, position = read_varint(payload, position)
    end = position + size_bytes
    if end > len(payload):
        raise TruncatedStreamError("a section ends inside a name")
    try:
        return payload[position:end].decode(), end
    except UnicodeDecodeError as error:
        raise CorruptStreamError(f"a name is not UTF-8: {error}") from error
