"""The header of a stream: its sizes, method and number types."""

import struct
import zlib
from dataclasses import dataclass

from meshreel.bitstream.layout import (
    FORMAT_VERSION,
    MAGIC,
    MAX_NAME_BYTES,
    VertexType,
)
from meshreel.counting import counted
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError

_FIXED = struct.Struct("<8sHIIIdBBBB4dH")
_CHECKSUM = struct.Struct("<I")

LONGEST_HEADER = _FIXED.size + MAX_NAME_BYTES + _CHECKSUM.size


@dataclass(frozen=True)
class Header:
    """The header of a stream.

    Attributes
    ----------
    n_frames : int
        0 if unknown when the header was written: then it is the sum over the blocks.
    n_verts, n_faces : int
        At least 1 each.
    fps : float
        Frames per second; 0 = unknown.
    vertex_type : VertexType
        Number type of the positions, of the input and of the output.
    method : int
        Code of the method (`codec.methods`).
    laplacian : int
        Code of the Laplacian (`codec.choices`).
    order : int
        Code of what is kept of the vertex and face order (`codec.choices`).
    origin : tuple of 3 floats
        Centre of the model, in model units.
    scale : float
        Diagonal of the bounding box in model units; all other lengths in the stream are relative to
        it.
    name : str
        At most `MAX_NAME_BYTES` in UTF-8.
    """

    n_frames: int
    n_verts: int
    n_faces: int
    fps: float
    vertex_type: VertexType
    method: int
    laplacian: int
    order: int
    origin: tuple[float, ...]
    scale: float
    name: str = ""


def write_header(header: Header) -> bytes:
    """The bytes of a header, checksum included."""
    name = header.name.encode("utf-8", errors="replace")[:MAX_NAME_BYTES]
    name = name.decode("utf-8", errors="ignore").encode()  # no half of a character at the cut
    fixed = _FIXED.pack(
        MAGIC,
        FORMAT_VERSION,
        header.n_frames,
        header.n_verts,
        header.n_faces,
        header.fps,
        header.vertex_type,
        header.method,
        header.laplacian,
        header.order,
        *header.origin,
        header.scale,
        len(name),
    )
    return fixed + name + _CHECKSUM.pack(zlib.crc32(fixed + name))


def read_header(data: bytes) -> tuple[Header, int]:
    """The header at the start of a stream, and the position after it.

    Raises
    ------
    CorruptStreamError
        If the data are not a `.reel` stream, or the header is damaged.
    TruncatedStreamError
        If the data end inside the header.
    UnsupportedVersionError
        If the stream is of a newer version than this build reads.
    """
    _check_magic_and_version(data)
    if len(data) < _FIXED.size:
        raise _cut_off(data, _FIXED.size)
    fields = _FIXED.unpack_from(data)
    if fields[-1] > MAX_NAME_BYTES:
        raise CorruptStreamError(
            f"the header announces a name of {fields[-1]} bytes; at most {MAX_NAME_BYTES} are "
            "allowed"
        )
    end = _FIXED.size + fields[-1]
    if len(data) < end + _CHECKSUM.size:
        raise _cut_off(data, end + _CHECKSUM.size)
    if zlib.crc32(data[:end]) != _CHECKSUM.unpack_from(data, end)[0]:
        raise CorruptStreamError("the header's checksum does not match; the file is damaged")
    return _checked_header(fields, data[_FIXED.size : end]), end + _CHECKSUM.size


def _check_magic_and_version(data: bytes) -> None:
    if not data:
        raise TruncatedStreamError("the stream is empty (0 bytes)")
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise CorruptStreamError(
            f"not a .reel stream: it starts with {data[:8].hex(' ')}, not {MAGIC.hex(' ')}"
        )
    if len(data) < len(MAGIC) + 2:
        raise _cut_off(data, _FIXED.size)
    (version,) = struct.unpack_from("<H", data, len(MAGIC))
    if 1 <= version < FORMAT_VERSION:
        raise UnsupportedVersionError(
            f"the stream is format {version}, which meshreel wrote before its first release; this "
            f"build reads format {FORMAT_VERSION}; encode the original again"
        )
    if version != FORMAT_VERSION:
        raise UnsupportedVersionError(
            f"the stream is format {version}; this build reads format {FORMAT_VERSION}; upgrade "
            "meshreel (or the file is damaged)"
        )


def _checked_header(fields: tuple, name: bytes) -> Header:  # type: ignore[type-arg]
    _, _, n_frames, n_verts, n_faces, fps, vertex_type, method, laplacian, order = fields[:10]
    origin, scale = fields[10:13], fields[13]
    if min(n_verts, n_faces) < 1:
        raise CorruptStreamError(
            f"the header announces {counted(n_verts, 'vertex')} and "
            f"{counted(n_faces, 'face')}; each must be at least 1"
        )
    if vertex_type not in list(VertexType):
        raise CorruptStreamError(f"vertex type {vertex_type} is unknown; 4 and 8 are allowed")
    if not all(abs(value) < float("inf") for value in (*origin, scale, fps)):
        raise CorruptStreamError("the header holds a number that is not finite")
    if not (scale > 0 and fps >= 0):
        raise CorruptStreamError(f"scale {scale} must be positive and fps {fps} not negative")
    try:
        text = name.decode()
    except UnicodeDecodeError as error:
        raise CorruptStreamError(f"the name is not UTF-8: {error}") from error
    return Header(
        n_frames, n_verts, n_faces, fps, VertexType(vertex_type),
        method, laplacian, order, origin, scale, text,
    )  # fmt: skip


def _cut_off(data: bytes, needed: int) -> TruncatedStreamError:
    return TruncatedStreamError(
        f"the stream ends at byte {len(data)}, inside the header of at least {needed} bytes"
    )
