"""A codec to compare with ours: quantized differences between frames, and deflate.

    meshreel evaluate walk.npz --codec examples/own_codec.py:encode,decode

Replace the two functions by your codec. `meshreel evaluate` calls `encode` with each of the
SETTINGS, here bits per coordinate, adds the bytes of the coded faces, and compares rates at equal
error. Do not count faces, which `decode` receives, or set HAS_FACES = True.
"""

import struct
import zlib

import numpy as np

SETTINGS = (8, 10, 12)
HEAD = struct.Struct("<2I4d")

Array = np.ndarray


def encode(vertices: Array, faces: Array, setting: float) -> bytes:
    """Return the bytes of positions of shape (T, V, 3)."""
    low = vertices.min(axis=(0, 1)).astype(float)
    step = float((vertices.max(axis=(0, 1)) - low).max()) / (2**setting - 1) or 1.0
    integers = np.rint((vertices - low) / step).astype(np.int32)
    differences = np.diff(integers, axis=0, prepend=0)
    head = HEAD.pack(*vertices.shape[:2], *low, step)
    return head + zlib.compress(differences.astype("<i2").tobytes(), 9)


def decode(data: bytes, faces: Array) -> Array:
    """Return positions of shape (T, V, 3)."""
    n_frames, n_verts, *low, step = HEAD.unpack_from(data)
    differences = np.frombuffer(zlib.decompress(data[HEAD.size :]), "<i2")
    integers = differences.reshape(n_frames, n_verts, 3).astype(np.int32).cumsum(axis=0)
    vertices: Array = np.array(low) + step * integers
    return vertices
