"""Options of encoding that all methods share, with their checks.

`codec.options` joins them with those of each family of methods. `encode`, the command line, batches
and the documentation derive options, types, defaults and texts from the fields of these classes. To
add an option, add a field and read it in the methods that support it.
"""

from abc import ABC, abstractmethod
from bisect import bisect_right
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from meshreel.codec.bitstream.layout import Laplacian, Order
from meshreel.codec.image_options import IMAGES_OPTION, MAX_IMAGE_OPTION, check_images
from meshreel.codec.memory import bytes_of
from meshreel.codec.method_names import LOSSLESS, METHOD_NAMES
from meshreel.codec.option import COUNT, Option, Range, options_of_fields
from meshreel.codec.targets import ABOVE_ZERO
from meshreel.errors import InvalidInputError

if TYPE_CHECKING:
    from meshreel.model.surface import Surface

DEFAULT_METHOD = "reel"

ROUNDING = tuple(name for name in METHOD_NAMES if name != LOSSLESS)
"""Methods that round positions."""

UV_BITS_RANGE = Range(4, 24, is_whole=True)
"""Bits of texture coordinates: a float32 in 0..1 represents every point of a grid of 24 bits."""

MAX_BLOCK_POSITIONS = 1 << 28
"""Maximum number of positions of a block if `block_frames` is not given."""


@dataclass(frozen=True)
class EncoderConfig(ABC):
    """The options of `meshreel.encode` that all methods share, checked.

    Raises
    ------
    InvalidInputError
        If an option is out of range, or two exclude each other.
    """

    positions_only: ClassVar[bool] = False
    """Whether the methods code the positions of one mesh, without tracks, segments or workers."""

    method: Annotated[
        str,
        Option(
            "Encoding method.",
            names=METHOD_NAMES,
            methods=METHOD_NAMES,
            more="`reel`: our own, several times smaller than the others, which are variants of "
            "the paper. `pca-qp`: deltas on the eigen-trajectories of each axis, least squares "
            "with anchors. `pca`, `pca-q`: without anchors, the first at 16 bits. `v2v`: vertices "
            "instead of deltas. `pca-qs`: as `pca-qp`, decoded frame by frame. `blocks`: "
            "eigen-trajectories of short blocks, tracked. `gft`: each frame's deltas on the low "
            "frequencies of the graph. `lossless`: bit-exact. `grid`: positions rounded to a grid "
            "within max_error=, then coded losslessly.",
        ),
    ] = DEFAULT_METHOD
    _: KW_ONLY
    n_modes: Annotated[
        int | None,
        Option(
            "Number of modes, 1 or more: a maximum for reel, else a number per axis.",
            range=COUNT,
            flag="--modes",
            synonyms={"k_l": ""},
            more="Those of an axis are eigen-trajectories (the paper's k_l), at most as many as a "
            "block has frames; a shorter last block has fewer. Excludes `energy`. With `gft`, "
            "graph frequencies, at most one per vertex; default 5 % of the vertices. Many of a "
            "large mesh take minutes, and only `meshreel.paper.read` decodes them.",
            methods=ROUNDING,
        ),
    ] = None
    uv_bits: Annotated[
        int | None,
        Option(
            "Round texture coordinates to a grid of 2^N steps per texture width, N of "
            f"{UV_BITS_RANGE.words}; 12 is a texel of a 4096 texture. Default: exact.",
            range=UV_BITS_RANGE,
            metavar="N",
            methods=ROUNDING,
        ),
    ] = None
    images: Annotated[str | None, replace(IMAGES_OPTION, methods=METHOD_NAMES)] = None
    max_image: Annotated[int | None, replace(MAX_IMAGE_OPTION, methods=METHOD_NAMES)] = None
    order: Annotated[
        str | None,
        Option(
            "Which order to keep. keep: of vertices and faces; vertices: of the vertices; drop: "
            "neither, for the smallest file. Default: keep; drop for Draco frames, which have "
            "none.",
            names=tuple(order.name.lower() for order in Order),
            methods=METHOD_NAMES,
        ),
    ] = None
    block_frames: Annotated[
        int | None,
        Option(
            "Frames per block; fewer take less memory and more bytes. Default: all, as far as "
            "memory allows; above 1024 frames and 8 million positions, up to 512. Method blocks: "
            "up to 25.",
            range=COUNT,
            synonyms={"n_b": "the frames of each block (k / n_b)", "k_f": ""},
            methods=METHOD_NAMES,
        ),
    ] = None
    memory: Annotated[
        float | str | None,
        Option(
            "Memory limit of encoding, as in 500MB or 1GiB; blocks are shortened to fit, and "
            "frames stay in their files. Default: blocks of up to 268 million positions.",
            range=ABOVE_ZERO,
            unit="in bytes",
            metavar="SIZE",
            more="Includes the program itself. Blocks of the default size take about 6 GB. "
            "Blocks of `lossless` and `grid` have up to 4 million positions, or 64 frames.",
            methods=METHOD_NAMES,
        ),
    ] = None

    def __post_init__(self) -> None:
        for option in options_of_fields(type(self)):
            value = getattr(self, option.name)
            if value is not option.default:
                option.check(value)
            if value != option.default:
                option.check_method(self.method)
        if self.images is not None or self.max_image is not None:
            check_images(self.images, self.max_image)
        if self.memory is not None:
            object.__setattr__(self, "memory", bytes_of(self.memory, "memory"))
        self._complete()

    @abstractmethod
    def _complete(self) -> None:
        """Replace text by numbers, set options that follow from others, and compare them."""

    @property
    def chosen(self) -> list[Option]:
        """Options that differ from their defaults."""
        options = options_of_fields(type(self))
        return [option for option in options if getattr(self, option.name) != option.default]

    @property
    def bound_percent(self) -> float | None:
        """Error bound of positions and all tracks in percent of their ranges, if one was set."""
        return None

    @property
    def track_quality(self) -> float | None:
        """Quality that determines bounds of tracks; None for targets that are errors."""
        return None

    @property
    def laplacian_choice(self) -> Laplacian:
        """The Laplacian that the header names; methods without deltas do not use it."""
        return Laplacian.NORMALIZED

    def check_live(self) -> None:
        """Raise InvalidInputError if an option needs the whole sequence."""
        for option in self.chosen:
            if option.needs_all_frames:
                others = [
                    other.name
                    for other in options_of_fields(type(self))
                    if other.group == option.group and other.range and not other.needs_all_frames
                ]
                raise InvalidInputError(
                    f"{option.name} needs the whole sequence; for frames added in order, set "
                    f"{', '.join(others)}"
                )

    def order_of(self, surface: "Surface") -> Order:
        """Return which order a stream of a mesh with this surface keeps.

        By default the order is kept if it matters, or polygons or parts depend on it.
        """
        if self.order is not None:
            return Order[self.order.upper()]
        needs_order = surface.is_ordered or surface.face_sizes is not None or surface.parts
        return Order.KEEP if needs_order else Order.DROP

    @property
    def memory_bytes(self) -> float | None:
        """Memory limit in bytes, or None."""
        return None if self.memory is None else float(self.memory)

    @abstractmethod
    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Return the number of frames per block without an option or a memory limit.

        None if the number of frames is unknown, and any number will do.
        """

    @abstractmethod
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

    def frames_in_block(self, n_frames: int, n_verts: int, number_bytes: int) -> int:
        """Return the number of frames per block.

        Blocks of `reel` are as long as memory allows, because each stores its own fields.

        Parameters
        ----------
        number_bytes : int
            Size of a coordinate.

        Raises
        ------
        InvalidInputError
            If not even one frame fits into the memory limit.
        """
        longest = self.longest_block(n_frames, n_verts) or n_frames
        preferred = min(self.block_frames or longest, n_frames)
        if self.memory is None:
            return preferred
        memory = float(self.memory)

        def needed(block_frames: int) -> float:
            is_whole = block_frames >= n_frames
            return self.block_bytes(block_frames, n_verts, number_bytes, is_whole=is_whole)

        if needed(preferred) <= memory:
            return preferred
        if memory < needed(1):
            raise InvalidInputError(
                f"memory of {memory / 1e6:.0f} MB is too little for one frame; allow at least "
                f"{needed(1) / 1e6:.0f} MB"
            )
        return bisect_right(range(1, preferred), memory, key=needed)

    def with_blocks_of(self, block_frames: int, n_verts: int, number_bytes: int) -> Self:
        """Return these options with shorter blocks, and the memory that they need."""
        needed = self.block_bytes(block_frames, n_verts, number_bytes, is_whole=False)
        return replace(self, block_frames=block_frames, memory=needed)
