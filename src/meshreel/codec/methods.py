"""The methods of coding: what each offers, and where it lives.

A method is a room of its own (`reel`, `paper`) that codes blocks of frames and decodes them. It is
imported when a stream or a user asks for it; nothing here, and nothing above, knows its insides.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from meshreel.codec.option import Option
from meshreel.errors import InvalidInputError, UnsupportedVersionError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from meshreel.bitstream.layout import Section
    from meshreel.bitstream.writer import Sections
    from meshreel.codec.config import EncoderConfig
    from meshreel.codec.decoded_block import FrameBlock
    from meshreel.codec.open_stream import OpenStream
    from meshreel.codec.source import CodedMesh, Source
    from meshreel.codec.track_bounds import TrackTargets
    from meshreel.runtime.engine.engine import Engine
    from meshreel.runtime.progress import Progress
    from meshreel.subspace.trajectories import BoundingFrame
    from meshreel.tracks import Track

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


class BlockDecoder(Protocol):
    """Decodes the blocks of a stream, in any order, and keeps what they share."""

    def block(self, number: int) -> "FrameBlock":
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """


class TrackBlockDecoder(Protocol):
    """Decodes a track in the blocks of a stream, in any order."""

    def block(self, number: int) -> "npt.NDArray[Any]":
        """Values of shape (T_b, N, C) in a block, in the order in which vertices or faces go out.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """


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

    def track_decoder(self, opened: "OpenStream", track: int) -> TrackBlockDecoder:
        """The decoder of a track beside the positions, from 1 on."""

    def decoder(self, opened: "OpenStream", n_modes: int | None) -> BlockDecoder:
        """The decoder of a stream's blocks.

        Parameters
        ----------
        opened : OpenStream
        n_modes : int or None
            Only the first so many modes of each block move.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1, or not for this method.
        """


@dataclass(frozen=True)
class _Home:
    """The name and code of a method, and its room.

    Of a room, `options.OPTIONS` maps the name to rows of options, and `method.METHODS` to the
    method.
    """

    name: str
    code: int
    room: str


_PAPER, _REEL = "meshreel.paper", "meshreel.reel"
_HOMES = (
    _Home("pca-qp", 0, _PAPER),
    _Home("pca", 1, _PAPER),
    _Home("pca-q", 2, _PAPER),
    _Home("v2v", 3, _PAPER),
    _Home("pca-qs", 4, _PAPER),
    _Home("blocks", 5, _PAPER),
    _Home("gft", 6, _PAPER),
    _Home("reel", 7, _REEL),
    _Home("lossless", 8, _REEL),
    _Home("grid", 9, _REEL),
)

METHOD_NAMES = tuple(home.name for home in _HOMES)
METHOD_CODES = {home.name: home.code for home in _HOMES}
"""Numbers of the methods in a stream, by name."""


def method_named(name: str) -> Method:
    """The method of this name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    for home in _HOMES:
        if home.name == name:
            return _method_at(home)
    raise InvalidInputError(f"method {name!r} is unknown; choose {', '.join(METHOD_NAMES)}")


def method_of_code(code: int) -> Method:
    """The method of a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    for home in _HOMES:
        if home.code == code:
            return _method_at(home)
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")


def own_options(name: str) -> tuple[Option, ...]:
    """The options that a method of `METHOD_NAMES` takes beside those that every method takes."""
    room = next(home.room for home in _HOMES if home.name == name)
    rows: tuple[Option, ...] = import_module(f"{room}.options").OPTIONS[name]
    return rows


def _method_at(home: _Home) -> Method:
    method: Method = import_module(f"{home.room}.method").METHODS[home.name]
    return method
