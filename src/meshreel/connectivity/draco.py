"""The connectivity part of a Draco stream: Edgebreaker with valence contexts.

A Draco stream is a header, the counts, the connectivity and then the attributes. Only the
connectivity is kept. The decoder adds a header, counts and one attribute of zeros of its own, so
that a damaged stream has no influence on how much Draco allocates.

References
----------
J. Rossignac, "Edgebreaker: connectivity compression for triangle meshes", TVCG 5(1), 1999.
Draco bitstream specification, version 2.2.
"""

from dataclasses import dataclass

import DracoPy
import numpy as np
import numpy.typing as npt

from meshreel.connectivity.edgebreaker_extent import STANDARD, VALENCE, connectivity_size
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]

MAX_VERTICES = 1 << 24  # vertex numbers travel as float32 positions and must be exact there
MAX_VALENCE_WORK = 1 << 33  # Draco's time is quadratic in valences: this many take seconds
COMPRESSION_LEVEL = 7  # valence contexts are used from 6 on; higher levels code attributes only

# Magic, bitstream 2.2, triangle mesh, Edgebreaker, no flags.
HEAD = b"DRACO\x02\x02\x01\x01\x00\x00"
# One attribute decoder: per vertex, depth first; one attribute: position, 3 x float32; quantised,
# parallelogram prediction, wrapped, raw symbols, all of them 0; range 0..0, origin 0, 1e9, 1 bit.
TAIL = bytes.fromhex(
    "01ff0000 01 0009030000 02 010101 01010101400100"
    "0000000000000000 000000000000000000000000 286b6e4e 01"
)


@dataclass(frozen=True)
class DracoSurface:
    """A surface in Draco's order.

    Attributes
    ----------
    connectivity : bytes
        The part of the Draco stream after the counts of vertices and faces.
    coding : int
        `STANDARD` or `VALENCE`.
    vertex_of_point : int64 array of shape (P,)
        The vertex of the input that each point is; a vertex that Draco split is several points.
    faces : int64 array of shape (M, 3)
        Points of each face.
    """

    connectivity: bytes
    coding: int
    vertex_of_point: Integers
    faces: Integers


def encode_surface(faces: Integers, n_verts: int) -> DracoSurface | None:
    """The surface as Draco codes it; None if Draco cannot code it.

    Parameters
    ----------
    faces : int64 array of shape (M, 3)
        No face is degenerate or repeated, every vertex is used.
    n_verts : int
    """
    if not (0 < n_verts < MAX_VERTICES and len(faces)):
        return None
    if np.sum(np.bincount(faces.ravel()) ** 2) > MAX_VALENCE_WORK:
        return None
    try:
        stream = _draco_stream(faces, n_verts)
        named = DracoPy.decode(stream)
        vertex_of_point = np.rint(np.asarray(named.points)[:, 0]).astype(np.int64)
        coding, connectivity = _extract_connectivity(stream, len(vertex_of_point), len(faces))
        found = decode_surface(connectivity, coding, len(vertex_of_point), len(faces))
    except Exception:  # however Draco fails on this list, there is another way to code it
        return None
    all_there = np.array_equal(np.unique(vertex_of_point), np.arange(n_verts))
    if not (all_there and np.array_equal(found, named.faces)):
        return None
    return DracoSurface(connectivity, coding, vertex_of_point, found)


def decode_surface(connectivity: bytes, coding: int, n_points: int, n_faces: int) -> Integers:
    """Faces of shape (M, 3), as points in 0..n_points-1; every point is used.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of such a surface.
    """
    if not (0 < n_points <= 3 * n_faces and coding in (STANDARD, VALENCE)):
        raise CorruptStreamError(f"{n_faces} faces cannot use {n_points} points each once")
    if connectivity_size(connectivity, coding, n_faces) != len(connectivity):
        raise CorruptStreamError("bytes are left over after the connectivity")
    start = HEAD + _counts(coding, n_points, n_faces)
    try:
        mesh = DracoPy.decode(start + connectivity + TAIL)
        faces = np.asarray(mesh.faces).astype(np.int64)
        n_found = len(mesh.points)
    except Exception as error:  # DracoPy raises TypeError, ValueError and types of its own
        raise CorruptStreamError(f"Draco cannot decode the connectivity: {error}") from error
    if faces.shape != (n_faces, 3) or n_found != n_points:
        raise CorruptStreamError(
            f"the connectivity has {len(faces)} faces on {n_found} points; "
            f"{n_faces} on {n_points} are announced"
        )
    if faces.min() < 0 or faces.max() >= n_points:
        raise CorruptStreamError(f"a face names a point outside 0..{n_points - 1}")
    if not np.bincount(faces.ravel(), minlength=n_points).all():
        raise CorruptStreamError("the connectivity leaves out a point")
    return faces


def _draco_stream(faces: Integers, n_verts: int) -> bytes:
    """A complete Draco stream, in which the position of each vertex is its number."""
    bits = (n_verts - 1).bit_length()
    names = np.zeros((n_verts, 3), np.float32)
    names[:, 0] = np.arange(n_verts)
    return bytes(
        DracoPy.encode(
            names,
            faces.astype(np.uint32),
            quantization_bits=bits,
            compression_level=COMPRESSION_LEVEL,
            quantization_range=float((1 << bits) - 1),
            quantization_origin=[0, 0, 0],
            create_metadata=False,
        )
    )


def _counts(coding: int, n_points: int, n_faces: int) -> bytes:
    """The bytes between header and connectivity; the zero: no other attributes."""
    return bytes([coding]) + write_varint(n_points) + write_varint(n_faces) + b"\x00"


def _extract_connectivity(stream: bytes, n_points: int, n_faces: int) -> tuple[int, bytes]:
    coding = stream[len(HEAD)]
    start = HEAD + _counts(coding, n_points, n_faces)
    if not stream.startswith(start):
        raise CorruptStreamError("this version of Draco writes another header")
    rest = stream[len(start) :]
    return coding, rest[: connectivity_size(rest, coding, n_faces)]
