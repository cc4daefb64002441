"""Encoding methods: their names, their codes in a stream, and their interface.

`meshreel.methods` registers the packages that implement them (`reel`, `paper`), which are imported
when a method is first used.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

from meshreel.errors import InvalidInputError, UnsupportedVersionError

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
    """What an encoder of live frames knows when they begin."""

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

    @property
    def positions_only(self) -> bool:
        """Whether it codes the positions of one mesh, without tracks, segments or workers."""

    def check(self, config: "EncoderConfig") -> None:
        """Raise InvalidInputError if options, each in range, exclude each other."""

    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Return the number of frames per block without an option or a memory limit.

        None if the number of frames is unknown, and any number will do.
        """

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Estimate the memory of encoding with blocks of this length.

        Parameters
        ----------
        block_frames, n_verts : int
        number_bytes : int
            Size of a coordinate.
        is_whole : bool
            Whether one block is the whole sequence, so that no other is read meanwhile.
        """

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


METHOD_CODES = {
    "pca-qp": 0,
    "pca": 1,
    "pca-q": 2,
    "v2v": 3,
    "pca-qs": 4,
    "blocks": 5,
    "gft": 6,
    "reel": 7,
    "lossless": 8,
    "grid": 9,
}
"""Codes of the methods in a stream, by name."""

METHOD_NAMES = tuple(METHOD_CODES)

LOSSLESS = "lossless"

Methods = Mapping[str, Method]
_LOADERS: dict[str, Callable[[], Methods]] = {}


def register(names: Iterable[str], load: Callable[[], Methods]) -> None:
    """Register a function that loads methods when one of these names is first used."""
    _LOADERS.update(dict.fromkeys(names, load))


def own_name(name: str) -> str:
    """Return our name of a method that may have its name in the paper, such as "PCA+qp"."""
    plain = str(name).lower().replace("+", "-").replace(" ", "-")
    plain = "gft" if plain == "per-mesh" else plain
    return plain if plain in METHOD_CODES else name


@cache
def method_named(name: str) -> Method:
    """Return the method of this name; raises InvalidInputError, with all names, if unknown."""
    if name not in METHOD_CODES:
        raise InvalidInputError(f"method {name!r} is unknown; choose {', '.join(METHOD_NAMES)}")
    return _LOADERS[name]()[name]


def method_of_code(code: int) -> Method:
    """Return the method of this code; raises UnsupportedVersionError if unknown."""
    for name, known in METHOD_CODES.items():
        if code == known:
            return method_named(name)
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")
