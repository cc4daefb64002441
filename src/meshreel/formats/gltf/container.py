"""The containers of a glTF file, read and written: JSON text, or GLB with JSON and binary data."""

import json
import struct
from pathlib import Path
from typing import Any, NoReturn

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.buffer_writer import BufferWriter, Json

MAGIC = b"glTF"
HEADER = struct.Struct("<4sII")
CHUNK = struct.Struct("<I4s")
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\x00"

VERSION = 2
MAX_BYTES = (1 << 32) - 1


def split_container(data: bytes) -> tuple[Any, memoryview | None]:
    """Return the parsed JSON of a file, and the binary chunk of a GLB file if it has one.

    The container is detected from the first bytes, not from the file extension.

    Raises
    ------
    FormatError
        If the file is truncated, has a version other than 2, or is not JSON.
    """
    if data[:4] != MAGIC:
        return _parsed(data), None
    if len(data) < HEADER.size:
        raise FormatError(f"ends after {len(data)} bytes, within the header of a GLB file")
    _, version, size = HEADER.unpack_from(data)
    if version != 2:
        raise FormatError(
            f"is a GLB file of version {version}; only version 2 is supported; convert it to "
            "glTF 2.0 (gltf-pipeline)"
        )
    if size > len(data):
        raise FormatError(f"is truncated: it has {len(data)} of the declared {size} bytes")
    chunks = _chunks(memoryview(data)[:size])
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise FormatError("is a GLB file that does not start with JSON")
    has_binary = len(chunks) > 1 and chunks[1][0] == BINARY_CHUNK
    return _parsed(bytes(chunks[0][1])), chunks[1][1] if has_binary else None


def _chunks(data: memoryview) -> list[tuple[bytes, memoryview]]:
    """Return type and bytes of the first two chunks."""
    chunks: list[tuple[bytes, memoryview]] = []
    offset = HEADER.size
    while len(chunks) < 2 and len(data) - offset >= CHUNK.size:
        size, kind = CHUNK.unpack_from(data, offset)
        offset += CHUNK.size
        if size > len(data) - offset:
            raise FormatError(
                f"chunk {len(chunks)} declares {size} bytes; only {len(data) - offset} follow"
            )
        chunks.append((kind, data[offset : offset + size]))
        offset += size
    return chunks


def _parsed(text: bytes) -> Any:
    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except RecursionError:
        raise FormatError("is JSON nested too deeply") from None
    except ValueError as error:  # includes invalid UTF-8 and huge integers
        raise FormatError(f"is not a glTF file: its JSON cannot be read ({error})") from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def write_container(path: Path, document: Json, buffer: BufferWriter, advice: str) -> int:
    """Write a ``.glb`` file, and return its size in bytes.

    Parameters
    ----------
    path : Path
    document : dict
        The JSON, without the buffer.
    buffer : BufferWriter
    advice : str
        Advice for the user if the file is too large.

    Raises
    ------
    InvalidInputError
        If the file is too large for its format.
    """
    complete = document | {"buffers": [{"byteLength": buffer.size_bytes}]}
    text = json.dumps(complete, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size_bytes = HEADER.size + CHUNK.size + len(text) + CHUNK.size + buffer.size_bytes
    if size_bytes > MAX_BYTES:
        raise InvalidInputError(
            f"the file would have {size_bytes} bytes; a .glb file can have at most "
            f"{MAX_BYTES}; {advice}"
        )
    with path.open("wb") as file:
        file.write(HEADER.pack(MAGIC, VERSION, size_bytes))
        file.write(CHUNK.pack(len(text), JSON_CHUNK) + text)
        file.write(CHUNK.pack(buffer.size_bytes, BINARY_CHUNK))
        file.writelines(buffer.pieces)
    return size_bytes
