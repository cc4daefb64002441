"""The header of a stream: its sizes, method and number types."""

import struct
import zlib
from dataclasses import dataclass

from meshreel.codec.bitstream.layout import FORMAT_VERSION, MAGIC, MAX_NAME_BYTES, VertexType

_FIXED = struct.Struct("<8sHIIIdBBBB4dH")
_SEGMENT = struct.Struct("<IIBBBB")
_PLACEMENT = struct.Struct("<4d")
_CHECKSUM = struct.Struct("<I")


@dataclass(frozen=True)
class Header:
    """The header of a stream; of its first segment, if it has several.

    Attributes
    ----------
    n_frames : int
        Of all segments. 0 if unknown when the header was written: then it is the sum over the
        blocks.
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


def write_segment(header: Header, first: Header) -> bytes:
    """Payload of the section SEGMENT: a header without what segments share.

    Parameters
    ----------
    header : Header
        Of the segment; its name, frames and frames per second are not stored.
    first : Header
        Of the stream. Origin and scale are stored if they differ from these.
    """
    payload = _SEGMENT.pack(
        header.n_verts,
        header.n_faces,
        header.vertex_type,
        header.method,
        header.laplacian,
        header.order,
    )
    if (header.origin, header.scale) == (first.origin, first.scale):
        return payload
    return payload + _PLACEMENT.pack(*header.origin, header.scale)
