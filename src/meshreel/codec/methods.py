"""The methods of coding: their names, their numbers in a stream, and what each offers.

The packages above that code blocks of frames and decode them (`reel`, `paper`) are registered by
`meshreel.methods`, and imported when a stream or a user asks for one of their methods.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
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
    from meshreel.runtime.engine.engine import Engine
    from meshreel.runtime.progress import Progress

    Vertices = npt.NDArray[np.floating]
    BlockTracks = dict[str, Track]


class BlockCoder(Protocol):
    """Codes blocks of frames one after another."""

    def leading_sections(self) -> Iterator[tuple["Section", bytes]]:
        """The sections before the first block, behind those of the mesh."""

    def code(self, vertices: "Vertices", tracks: "BlockTracks") -> "Sections":
        """The sections of the next block.

        Integers are found now, bytes when the sections are taken.

        Parameters
        ----------
        vertices : float array of shape (T_b, V, 3)
            In internal order.
        tracks : dict of str to Track
            Values of the same frames, in the given order.
        """


class FrameReader(Protocol):
    """Decodes frames of a stream, in any order, and keeps what its blocks share."""

    def load(self, block: int, track: int = 0) -> None:
        """Decode a block now, unless it is held; raises as `fill`."""

    def fill(self, out: "npt.NDArray[Any]", first: int, track: int = 0) -> None:
        """Fill a contiguous array of shape (n, N, C) with frames of a track from `first` on.

        Raises
        ------
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If a block takes more memory than allowed.
        """

    def close(self) -> None:
        """Release all that is held."""


class Method(Protocol):
    """A method of coding."""

    @property
    def name(self) -> str:
        """Its name, as users write it."""

    @property
    def block_frames(self) -> int | None:
        """Frames coded together where nothing is asked for; None: as many as there are."""

    @property
    def has_tracks(self) -> bool:
        """Whether its streams hold tracks beside the positions."""

    @property
    def is_lossless(self) -> bool:
        """Whether positions come back bit for bit."""

    @property
    def codes_blocks_apart(self) -> bool:
        """Whether blocks can be coded by different workers, once the first is there."""

    def check(self, config: "EncoderConfig") -> None:
        """Nothing if the options it takes fit each other; each by itself is in range.

        Raises
        ------
        InvalidInputError
            If they do not.
        """

    def check_live(self, config: "EncoderConfig") -> None:
        """Nothing if frames can be coded so as they come, before the last is there.

        Raises
        ------
        InvalidInputError
            If they cannot.
        """

    def longest_block(self, n_frames: int, n_verts: int) -> int:
        """Frames coded together where no number of them is given, and memory allows it."""

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Memory that encoding takes with blocks of so many frames.

        Parameters
        ----------
        block_frames, n_verts : int
        number_bytes : int
            Size of a coordinate.
        is_whole : bool
            Whether there is no further block, which would be read meanwhile.
        """

    def most_modes(self, n_frames: int, n_verts: int) -> int:
        """Modes that a block of so many frames can have at most."""

    def encode(self, source: "Source", progress: "Progress", engine: "Engine | None") -> bytes:
        """The bytes of a stream of the source.

        Raises
        ------
        InvalidInputError
            If no stream meets the target.
        """

    def live_coder(
        self,
        mesh: "CodedMesh",
        frame: "BoundingFrame",
        first: "Vertices",
        tracks: "BlockTracks",
        targets: "TrackTargets | None",
    ) -> BlockCoder:
        """The coder of frames that are not all there yet.

        Parameters
        ----------
        mesh : CodedMesh
        frame : BoundingFrame
            Of the first block.
        first : float array of shape (T_b, V, 3)
            The first block, in internal order: step and number of modes follow from it. It is not
            coded yet.
        tracks : dict of str to Track
            Values of the first block.
        targets : mapping of str to str or float, or None
            How exact tracks are to come back.
        """

    def frames(self, opened: "OpenStream", n_modes: int | None) -> FrameReader:
        """Return a decoder of the stream's frames.

        Parameters
        ----------
        opened : OpenStream
        n_modes : int or None
            Number of leading modes of each block that move; None for all. In streams of `reel`,
            further modes, up to at least the 16th, are held at their mean over the block, and
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
"""Numbers of the methods in a stream, by name."""

METHOD_NAMES = tuple(METHOD_CODES)

Methods = Mapping[str, Method]
_LOADERS: dict[str, Callable[[], Methods]] = {}


def register(names: Iterable[str], load: Callable[[], Methods]) -> None:
    """Let a function load methods, by name, when one of these names is first used."""
    _LOADERS.update(dict.fromkeys(names, load))


@cache
def method_named(name: str) -> Method:
    """The method of this name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    if name not in METHOD_CODES:
        raise InvalidInputError(f"method {name!r} is unknown; choose {', '.join(METHOD_NAMES)}")
    return _LOADERS[name]()[name]


def method_of_code(code: int) -> Method:
    """The method of a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    for name, known in METHOD_CODES.items():
        if code == known:
            return method_named(name)
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")
