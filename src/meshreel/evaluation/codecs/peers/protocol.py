"""The protocol and registry of other codecs in the comparison, which are imported on demand."""

from collections.abc import Iterable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Protocol, runtime_checkable

import numpy.typing as npt

from meshreel.evaluation.choices import checked_names
from meshreel.model.sequence import MeshSequence, Vertices

Shape = tuple[int, int, int]

_CLASSES = {
    "draco": ("draco", "Draco"),
    "sz3": ("arrays", "Sz3"),
    "zfp": ("arrays", "Zfp"),
    "meshopt": ("integer_deltas", "MeshOptimizer"),
    "pco": ("integer_deltas", "Pcodec"),
    "blosc2": ("arrays", "Blosc2"),
    "npz": ("arrays", "Npz"),
}
"""Module and class by name."""

PEER_NAMES = tuple(_CLASSES)
NONE = "none"
"""Selects no peers."""


class Packaged(Protocol):
    """A codec that may need a package."""

    @property
    def name(self) -> str:
        """Name in tables and plots."""

    @property
    def package(self) -> str | None:
        """Required package; None if Python and NumPy suffice."""

    @property
    def extra(self) -> str | None:
        """The extra of meshreel that installs the package; None if it is always installed."""


class Peer(Packaged, Protocol):
    """A codec of vertex positions with a sweep of settings."""

    @property
    def summary(self) -> str:
        """One-line description of its use."""

    @property
    def has_faces(self) -> bool:
        """Whether its bytes contain the faces."""

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """The settings to measure, one number each."""

    def params(self, setting: float) -> str:
        """A setting as text; empty for codecs without settings."""

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """Encode the prepared sequence."""

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Decode positions, in the codec's vertex order."""


@runtime_checkable
class ReordersVertices(Protocol):
    """A codec that reorders vertices; the original order is restored for measuring."""

    def prepare(self, sequence: MeshSequence) -> MeshSequence:
        """The sequence to encode; not part of the timing."""

    def restore(self, decoded: Vertices, prepared: MeshSequence, setting: float) -> Vertices:
        """The decoded positions in the order of the prepared sequence; not part of the timing.

        Raises
        ------
        InvalidInputError
            If decoded positions cannot be matched to vertices.
        """


def planar(vertices: Vertices) -> Vertices:
    """Positions as an array of shape (T, 3 V): all x, then all y, then all z of a frame.

    On two sequences, streams are smaller than with interleaved coordinates: by a third for zfp
    and by half for SZ3.
    """
    planes: Vertices = vertices.transpose(0, 2, 1)
    return planes.reshape(len(vertices), -1)


def interleaved(rows: Vertices, shape: Shape) -> Vertices:
    """The inverse of `planar`."""
    n_frames, n_verts, _ = shape
    vertices: Vertices = rows.reshape(n_frames, 3, n_verts).transpose(0, 2, 1)
    return vertices.copy()


def is_available(peer: Packaged) -> bool:
    """Whether the package can be imported."""
    if peer.package is None:
        return True
    try:
        return find_spec(peer.package) is not None
    except ValueError:  # the entry of sys.modules is not a module
        return False


def why_missing(peer: Packaged) -> str:
    """A line that names the missing package and how to install it."""
    source = f"pip install 'meshreel[{peer.extra}]'" if peer.extra else "reinstall meshreel"
    return f"`{peer.name}` was not measured: it needs the package {peer.package} ({source})"


def package_version(peer: Packaged) -> str:
    """The version of the package; empty if unknown or not needed."""
    try:
        return version(peer.package) if peer.package else ""
    except PackageNotFoundError:
        return ""


def peers_named(names: Iterable[str] = PEER_NAMES) -> "tuple[Peer, ...]":
    """Return the peers of these names in registry order; none for "none".

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    selected = set(names)
    if selected == {NONE}:
        return ()
    return tuple(_peer(name) for name in checked_names(selected, PEER_NAMES, "peer"))


def _peer(name: str) -> "Peer":
    module, kind = _CLASSES[name]
    peer: Peer = getattr(import_module(f"meshreel.evaluation.codecs.peers.{module}"), kind)()
    return peer
