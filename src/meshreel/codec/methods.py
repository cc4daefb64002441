"""Interface of the encoding methods.

`meshreel.methods` registers the packages that implement them (`reel`, `paper`), which are imported
when a method is first used.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

from meshreel.codec.method_names import METHOD_CODES, METHOD_NAMES
from meshreel.errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from meshreel.codec.bitstream.container import Sections
    from meshreel.codec.bitstream.layout import Section
    from meshreel.codec.config import EncoderConfig
    from meshreel.codec.open_stream import OpenStream
    from meshreel.codec.source import CodedMesh, Source
    from meshreel.codec.subspace.trajectories import BoundingFrame
    from meshreel.codec.track_bounds import TrackTargets
    from meshreel.model.tracks import Track
    from meshreel.runtime.progress import Progress

    Vertices = npt.NDArray[np.floating]
    BlockTracks = dict[str, Track]


@dataclass(frozen=True, eq=False)
class LiveStart:
    """Mesh, first block and error bounds with which live encoding starts."""

    mesh: "CodedMesh"
    frame: "BoundingFrame"
    """Bounding frame of the first block."""
    first: "Vertices"
    """float array of shape (T_b, V, 3). The first block, in internal order: step and number of
    modes follow from it. It is not encoded yet.
    """
    tracks: "BlockTracks"
    """Values of the first block; relative bounds refer to their range."""
    targets: "TrackTargets | None"
    """Error bounds of tracks."""


class UnreachableError(InvalidInputError):
    """A coder cannot bring values within their bound; another prediction or range may."""


class BlockCoder(Protocol):
    """Encodes blocks of frames in order."""

    def leading_sections(self) -> Iterator[tuple["Section", bytes]]:
        """Yield the sections between those of the mesh and the first block."""

    def code(self, vertices: "Vertices", tracks: "BlockTracks") -> "Sections":
        """Encode the next block.

        Integers are computed now, bytes when the sections are iterated.

        Parameters
        ----------
        vertices : float array of shape (T_b, V, 3)
            In internal order.
        tracks : dict of str to Track
            Values of the same frames, in the given vertex order.

        Raises
        ------
        UnreachableError
            If values of a track are too large for the range of the first block.
        """


class FrameReader(Protocol):
    """Decodes frames of a stream in any order, and caches key blocks."""

    def load(self, block: int, track: int = 0) -> None:
        """Decode a block now, unless it is cached; raises as `fill`."""

    def fill(self, out: "npt.NDArray[Any]", first: int, track: int = 0) -> None:
        """Fill a contiguous array of shape (n, N, C) with frames of a track, starting with `first`.

        Raises
        ------
        CorruptStreamError
            If a block is damaged, or a position is not finite.
        MemoryLimitError
            If a block takes more memory than allowed.
        """

    def close(self) -> None:
        """Release all memory."""


class Method(Protocol):
    """An encoding method."""

    @property
    def name(self) -> str:
        """Name of the method, as in the options."""

    def check(self, config: "EncoderConfig") -> None:
        """Raise InvalidInputError if options, each in range, exclude each other."""

    def encode(self, sources: "Sequence[Source]", progress: "Progress") -> "Iterator[bytes]":
        """Yield a stream for each segment of a sequence; all together meet the target.

        Raises
        ------
        InvalidInputError
            If they cannot.
        """

    def live_coder(self, start: LiveStart) -> BlockCoder:
        """Return an encoder of live frames."""

    def frames(self, opened: "OpenStream", n_modes: int | None) -> FrameReader:
        """Return a decoder of the stream's frames.

        Parameters
        ----------
        opened : OpenStream
        n_modes : int or None
            Number of leading modes of each block that move; None for all. In streams of `reel`,
            further modes, up to at least the 16th, keep their mean over the block, and
            corrections are omitted.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1, or the method has no modes.
        """


Methods = Mapping[str, Method]
_LOADERS: dict[str, Callable[[], Methods]] = {}


def register(names: Iterable[str], load: Callable[[], Methods]) -> None:
    """Register a function that loads methods when one of these names is first used."""
    _LOADERS.update(dict.fromkeys(names, load))


@cache
def method_named(name: str) -> Method:
    """Return the method of this name; raises InvalidInputError, with all names, if unknown."""
    if name not in METHOD_CODES:
        raise InvalidInputError(f"method {name!r} is unknown; choose {', '.join(METHOD_NAMES)}")
    return _LOADERS[name]()[name]
