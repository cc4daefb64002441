"""Lossless compressors of float arrays: byte shuffle with zstd, and NumPy's deflate."""

import io
from dataclasses import dataclass
from importlib import import_module

import numpy as np
import numpy.typing as npt

from meshreel.evaluation.codecs.peers.protocol import Shape, interleaved, planar
from meshreel.model.sequence import MeshSequence, Vertices


@dataclass(frozen=True)
class Blosc2:
    """Byte shuffle and zstd, by Blosc2."""

    name: str = "blosc2"
    summary: str = "Blosc2, byte shuffle and zstd level 9, lossless, on a (3 V, T) array"
    package: str = "blosc2"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """The compression level, the only setting."""
        return (9,)

    def params(self, setting: float) -> str:
        """The level."""
        return f"level {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One Blosc2 chunk, ordered by trajectory."""
        blosc2 = import_module("blosc2")

        trajectories = np.ascontiguousarray(planar(sequence.vertices).T)
        return bytes(
            blosc2.compress2(
                trajectories,
                codec=blosc2.Codec.ZSTD,
                clevel=int(setting),
                filters=[blosc2.Filter.SHUFFLE],
                typesize=trajectories.itemsize,
            )
        )

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        blosc2 = import_module("blosc2")

        n_frames, n_verts, _ = shape
        trajectories = np.frombuffer(blosc2.decompress2(data), dtype).reshape(3 * n_verts, n_frames)
        return interleaved(np.ascontiguousarray(trajectories.T), shape)


@dataclass(frozen=True)
class Npz:
    """`numpy.savez_compressed`, the baseline of users without a mesh codec."""

    name: str = "npz"
    summary: str = "numpy.savez_compressed (deflate), lossless"
    package: None = None
    extra: None = None
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """A placeholder; there are no settings."""
        return (0,)

    def params(self, setting: float) -> str:
        """An empty text."""
        return ""

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One .npz with the positions."""
        stream = io.BytesIO()
        np.savez_compressed(stream, vertices=sequence.vertices)
        return stream.getvalue()

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        with np.load(io.BytesIO(data)) as arrays:
            vertices: Vertices = arrays["vertices"]
        return vertices
