"""The two ways in which a glTF file is stored: JSON text, or JSON and binary data as GLB."""

import json
import struct
from typing import Any, NoReturn

from meshreel.errors import FormatError

MAGIC = b"glTF"
HEADER = struct.Struct("<4sII")
CHUNK = struct.Struct("<I4s")
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\x00"


def split_container(data: bytes) -> tuple[Any, memoryview | None]:
    """The JSON of a file, parsed, and its binary chunk if it is a GLB that has one.

    What a file is shows in its first bytes, not in its ending.

    Raises
    ------
    FormatError
        If it is cut short, a version other than 2, or no JSON.
    """
    if data[:4] != MAGIC:
        return _parsed(data), None
    if len(data) < HEADER.size:
        raise FormatError(f"ends after {len(data)} bytes, within the header of a GLB file")
    _, version, size = HEADER.unpack_from(data)
    if version != 2:
        raise FormatError(
            f"is a GLB file of version {version}; version 2 is read; convert it to glTF 2.0 "
            "(gltf-pipeline)"
        )
    if size > len(data):
        raise FormatError(f"is cut short: it has {len(data)} bytes of the {size} that it announces")
    chunks = _chunks(memoryview(data)[:size])
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise FormatError("is a GLB file that does not begin with JSON")
    has_binary = len(chunks) > 1 and chunks[1][0] == BINARY_CHUNK
    return _parsed(bytes(chunks[0][1])), chunks[1][1] if has_binary else None


def _chunks(data: memoryview) -> list[tuple[bytes, memoryview]]:
    """Kind and bytes of the first two chunks."""
    found: list[tuple[bytes, memoryview]] = []
    place = HEADER.size
    while len(found) < 2 and len(data) - place >= CHUNK.size:
        size, kind = CHUNK.unpack_from(data, place)
        place += CHUNK.size
        if size > len(data) - place:
            raise FormatError(
                f"chunk {len(found)} announces {size} bytes; {len(data) - place} are left"
            )
        found.append((kind, data[place : place + size]))
        place += size
    return found


def _parsed(text: bytes) -> Any:
    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except RecursionError:
        raise FormatError("is JSON that is nested too deeply") from None
    except ValueError as error:  # also what is no UTF-8, and numbers of thousands of digits
        raise FormatError(f"is no glTF file: its JSON cannot be read ({error})") from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")
