"""The protocol of other codecs that can be measured."""

from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Protocol, runtime_checkable

import numpy.typing as npt

from meshreel.model.sequence import MeshSequence, Vertices

Shape = tuple[int, int, int]


class Packaged(Protocol):
    """What needs a package."""

    @property
    def name(self) -> str:
        """Its name in tables and plots."""

    @property
    def package(self) -> str | None:
        """The package it needs; None where Python and NumPy are enough."""

    @property
    def extra(self) -> str | None:
        """The extra of meshreel that brings the package; None where it is always there."""


class Peer(Packaged, Protocol):
    """A codec of vertex positions, at one setting after another."""

    @property
    def summary(self) -> str:
        """How it is used, in one line."""

    @property
    def has_faces(self) -> bool:
        """Whether its bytes hold the faces, too."""

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """The settings to run, a number each."""

    def params(self, setting: float) -> str:
        """A setting in words; empty where there is nothing to set."""

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """The prepared sequence as bytes."""

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the order the codec gives them, from bytes, shape and type alone."""


@runtime_checkable
class ReordersVertices(Protocol):
    """A codec that gives vertices in an order of its own, which is found again to measure it."""

    def prepare(self, sequence: MeshSequence) -> MeshSequence:
        """The sequence that is encoded in its place; not part of the seconds."""

    def restore(self, decoded: Vertices, prepared: MeshSequence, setting: float) -> Vertices:
        """The decoded positions in the order of the prepared sequence; not part of the seconds.

        Raises
        ------
        InvalidInputError
            If it cannot be told which decoded position belongs to which vertex.
        """


def planar(vertices: Vertices) -> Vertices:
    """Positions as an array of shape (T, 3 V): a frame's x, then its y, then its z.

    Measured on two captured and animated sequences: smaller than interleaved coordinates, for
    zfp by a third and for SZ3 by half.
    """
    planes: Vertices = vertices.transpose(0, 2, 1)
    return planes.reshape(len(vertices), -1)


def interleaved(rows: Vertices, shape: Shape) -> Vertices:
    """The inverse of `planar`."""
    n_frames, n_verts, _ = shape
    vertices: Vertices = rows.reshape(n_frames, 3, n_verts).transpose(0, 2, 1)
    return vertices.copy()


def is_available(peer: Packaged) -> bool:
    """Whether its package can be imported."""
    if peer.package is None:
        return True
    try:
        return find_spec(peer.package) is not None
    except ValueError:  # the entry of sys.modules is not a module
        return False


def why_missing(peer: Packaged) -> str:
    """A line that names the package and what brings it."""
    source = f"pip install 'meshreel[{peer.extra}]'" if peer.extra else "reinstall meshreel"
    return f"`{peer.name}` was not measured: it needs the package {peer.package} ({source})"


def package_version(peer: Packaged) -> str:
    """The version of its package; empty where it needs none or none is told."""
    try:
        return version(peer.package) if peer.package else ""
    except PackageNotFoundError:
        return ""
