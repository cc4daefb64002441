"""Coders in the speed comparison: our methods, and Draco on each frame separately."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import meshreel
from meshreel.evaluation.codecs.peers.draco import LEVEL, Draco
from meshreel.evaluation.codecs.peers.integer_deltas import pack_frames, unpack_frames
from meshreel.evaluation.codecs.peers.protocol import Shape
from meshreel.model.sequence import Vertices

DRACO_BITS = 10
DRACO = "Draco"
DEFAULT_EFFORT, FAST_EFFORT = 5, 1

FrameAt = Callable[[int], Vertices]
"""Returns the positions of a frame, by number, from an opened stream."""


class Coder(Protocol):
    """A sequence to bytes and back."""

    @property
    def name(self) -> str:
        """Its name in the table."""

    def prepare(self, sequence: meshreel.MeshSequence) -> meshreel.MeshSequence:
        """The sequence to encode instead; not timed."""

    def encode(self, sequence: meshreel.MeshSequence) -> bytes:
        """The prepared sequence as bytes."""

    def decode(self, data: bytes, shape: Shape) -> Vertices:
        """The positions of every frame."""

    def open(self, path: Path, shape: Shape) -> FrameAt:
        """A function from a frame's number to its positions, which reads the stored bytes."""


@dataclass(frozen=True)
class OwnMethod:
    """One of our methods with options."""

    name: str
    method: str
    options: dict[str, Any]

    def prepare(self, sequence: meshreel.MeshSequence) -> meshreel.MeshSequence:
        """The sequence itself."""
        return sequence

    def encode(self, sequence: meshreel.MeshSequence) -> bytes:
        """A stream that keeps the order of vertices and faces."""
        return meshreel.encode(sequence, self.method, **self.options)

    def decode(self, data: bytes, shape: Shape) -> Vertices:
        """The positions of every frame."""
        return meshreel.decode(data).vertices

    def open(self, path: Path, shape: Shape) -> FrameAt:
        """A function from a frame's number to its positions, which reads the stored bytes."""
        reel = meshreel.open(path)
        return lambda number: reel[number].vertices


@dataclass(frozen=True)
class DracoFrames:
    """Draco through DracoPy; every frame contains the connectivity."""

    name: str = DRACO
    level: int = LEVEL
    bits: int = DRACO_BITS
    codec: Draco = field(default_factory=Draco, repr=False)

    def prepare(self, sequence: meshreel.MeshSequence) -> meshreel.MeshSequence:
        """The sequence in float32 with distinct positions, so that Draco keeps all vertices."""
        return self.codec.prepare(sequence)

    def encode(self, sequence: meshreel.MeshSequence) -> bytes:
        """The streams of all frames."""
        return self.codec.encode(sequence, self.bits)

    def decode(self, data: bytes, shape: Shape) -> Vertices:
        """The positions of every frame, in Draco's order."""
        return self.codec.decode(data, shape, "float32")

    def open(self, path: Path, shape: Shape) -> FrameAt:
        """A function from a frame's number to its positions, in Draco's order."""
        frames = unpack_frames(path.read_bytes())
        return lambda i: self.decode(pack_frames([frames[i]]), (1, *shape[1:]))[0]


def reel_name(effort: int) -> str:
    """The name of `reel` at this effort in the table."""
    return f"reel, effort {effort}"


def reel_coder(effort: int) -> OwnMethod:
    """`reel` at this effort and default quality, which needs no search."""
    return OwnMethod(reel_name(effort), "reel", {"effort": effort})


def coders_of(efforts: list[int], n_modes: int, *, with_paper: bool) -> list[Coder]:
    """Every coder of a run, Draco first."""
    coders: list[Coder] = [DracoFrames()]
    coders += [reel_coder(effort) for effort in efforts]
    if with_paper:
        coders.append(OwnMethod(f"pca-qp, {n_modes} modes", "pca-qp", {"n_modes": n_modes}))
    return coders
