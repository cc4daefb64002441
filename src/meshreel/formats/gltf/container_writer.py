"""Writing the GLB container: JSON and buffer."""

import json
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.container import BINARY_CHUNK, CHUNK, HEADER, JSON_CHUNK, MAGIC

VERSION = 2
MAX_BYTES = (1 << 32) - 1


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
