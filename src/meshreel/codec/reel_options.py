"""Options of the methods `reel`, `lossless` and `grid`."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Annotated

from meshreel.codec.config import MAX_BLOCK_POSITIONS, EncoderConfig
from meshreel.codec.error_bounds import METERS, bound_of
from meshreel.codec.memory import bytes_of
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import method_named
from meshreel.codec.option import Option, Range
from meshreel.codec.targets import (
    ABOVE_ZERO,
    DEFAULT_QUALITY,
    DIAGONAL_OF_ALL,
    GROUP,
    QUALITIES,
    Target,
    TargetKind,
    target_of,
)
from meshreel.errors import InvalidInputError, Keyword

REEL, BOUNDED = ("reel",), ("reel", "grid")
"""Methods that support an option."""

EFFORT_RANGE = Range(1, 9, is_whole=True)
DEFAULT_EFFORT = 5


MAX_EXACT_POSITIONS, MIN_EXACT_FRAMES = 1 << 22, 64
"""Size of a block of `lossless`: at most about 2 s of decoding, but enough frames to adapt to."""

MAX_UNCUT_FRAMES, MAX_UNCUT_POSITIONS = 1024, 1 << 23
"""`reel` cuts sequences that exceed both limits; small meshes decode quickly anyway."""

MAX_CUT_FRAMES = 512
"""Maximum number of frames of a block of a cut sequence."""

PROCESS_BYTES, BYTES_PER_FRAME, BYTES_PER_PAIR = 110e6, 2e5, 200.0
"""Memory of the process, of a frame that threads process in pieces, and of an entry of the
autocorrelation of frames. All constants of this estimate are measured: docs/benchmarks.md, "Large
meshes"."""

BYTES_PER_VERTEX, BYTES_PER_MODE, BYTES_PER_COMPARED_MODE, MAX_MODES = 1500.0, 10.0, 50.0, 150
"""Memory of a vertex, and of a mode at a vertex without and with a trial that reuses the modes of a
key block. MAX_MODES is the number of modes assumed for long blocks."""

BYTES_PER_CACHED, MAX_CACHED = 52.0, 2.8e6
"""Memory of the cached coordinates of a position, and the largest number of cached positions."""


class Tune(Enum):
    """Error measure that the encoder optimizes."""

    VISUAL = "visual"
    GEOMETRY = "geometry"
    SURFACE = "surface"


VERTEX_ERRORS = TargetKind.MAX_ERROR, TargetKind.KG
"""Targets that count errors of vertices, not distances of surfaces."""


@dataclass(frozen=True, kw_only=True)
class ReelOptions(EncoderConfig):
    """Options of `reel`, `lossless` and `grid`, checked."""

    quality: Annotated[
        float | None,
        Option(
            f"{QUALITIES.words}: how visible errors are. At {DEFAULT_QUALITY:g}, a model that "
            "fills the screen looks like its original; every 12 points halve the errors.",
            default_text=f"{DEFAULT_QUALITY:g}, without another target",
            range=QUALITIES,
            group=GROUP,
            methods=REEL,
        ),
    ] = None
    bound: Annotated[
        float | str | None,
        Option(
            "Largest error of positions and of all tracks, guaranteed, as in 0.1%: positions in "
            f"percent {DIAGONAL_OF_ALL}, tracks of their range. --track sets exceptions; integers "
            "stay exact.",
            range=ABOVE_ZERO,
            unit="in percent",
            group=GROUP,
            metavar="PERCENT",
            methods=BOUNDED,
        ),
    ] = None
    max_error: Annotated[
        float | str | None,
        Option(
            "Largest distance of any vertex from the original, guaranteed. 0.1 or 0.1%: "
            f"percent {DIAGONAL_OF_ALL}; 0.5u: model units; 0.5mm: a length, see {{unit}}.",
            range=ABOVE_ZERO,
            unit="in percent",
            group=GROUP,
            metavar="BOUND",
            synonyms=dict.fromkeys(
                ("error", "error_bound", "eb", "epsilon", "tolerance", "precision"), ""
            ),
            methods=BOUNDED,
        ),
    ] = None
    unit: Annotated[
        str | None,
        Option(
            "Length of one model unit, if {max_error} is a length.",
            names=tuple(METERS),
            group=GROUP,
            metavar="|".join(METERS),
            methods=BOUNDED,
        ),
    ] = None
    kg: Annotated[
        float | None,
        Option(
            "Smallest file of at most this KG error, relative to the shape's extent.",
            range=ABOVE_ZERO,
            unit="in percent",
            group=GROUP,
            metavar="PERCENT",
            more="In percent.",
            needs_all_frames=True,
            methods=REEL,
        ),
    ] = None
    size: Annotated[
        float | str | None,
        Option(
            "Best quality within this size, as in 100kB, 1MiB or 100000 (bytes).",
            range=ABOVE_ZERO,
            unit="in bytes",
            group=GROUP,
            metavar="SIZE",
            needs_all_frames=True,
            methods=REEL,
        ),
    ] = None
    step: Annotated[
        float | None,
        Option(
            "Quantization step of positions, in diagonals of the bounding box of all frames.",
            range=Range(0, 1, is_open=True),
            unit="in diagonals of the bounding box",
            group=GROUP,
            methods=BOUNDED,
        ),
    ] = None
    lossless: Annotated[
        bool,
        Option(
            "Decode positions and tracks bit for bit. Also keeps the order of vertices and faces, "
            "unless {order} is given.",
            group=GROUP,
            more='Equals method="lossless". `tracks` may still set bounds, or drop tracks.',
            methods=("reel", LOSSLESS),
        ),
    ] = False
    tune: Annotated[
        str | None,
        Option(
            "Error measure to optimize. visual: how the surface looks; geometry: vertex positions; "
            "surface: the shape, along which vertices may slide.",
            default_text="the measure of the target, else visual",
            names=tuple(tune.value for tune in Tune),
            more="visual suits STED, geometry KG and largest errors, surface registered captures.",
            methods=REEL,
        ),
    ] = None
    effort: Annotated[
        int | None,
        Option(
            f"{EFFORT_RANGE.words}: encoding time against size.",
            default_text=str(DEFAULT_EFFORT),
            range=EFFORT_RANGE,
            methods=REEL,
        ),
    ] = None

    def _complete(self) -> None:
        if self.size is not None:
            object.__setattr__(self, "size", bytes_of(self.size, "size"))
        if self.bound is not None:
            self._check_bound()
        if self.max_error is not None:
            object.__setattr__(self, "max_error", bound_of(self.max_error, self.unit).plain)
            object.__setattr__(self, "unit", None)
        elif self.unit is not None:
            raise InvalidInputError(
                Keyword("unit"), " applies to a length in ", Keyword("max_error"), "; give both"
            )
        kind = self.target.kind
        if self.tune == Tune.SURFACE.value and kind in VERTEX_ERRORS:
            raise InvalidInputError(
                Keyword("tune"),
                " surface lets vertices slide, which ",
                Keyword("bound" if self.bound is not None else kind.value),
                " counts as errors; set ",
                Keyword("quality"),
                " or ",
                Keyword("size"),
            )
        if self.lossless:
            unused = [option for option in self.chosen if LOSSLESS not in option.methods]
            if unused:
                first, lossless = Keyword(unused[0].name), Keyword("lossless")
                raise InvalidInputError(
                    first, " has no effect with ", lossless, "; omit it, or ", lossless
                )
            object.__setattr__(self, "method", LOSSLESS)
        object.__setattr__(self, "lossless", self.method == LOSSLESS)
        method_named(self.method).check(self)

    def _check_bound(self) -> None:
        """Replace the text of `bound`; raise if it is no percentage or there is another target."""
        try:
            percent = float(str(self.bound).strip().removesuffix("%"))
        except ValueError:
            raise InvalidInputError(
                Keyword("bound"),
                " is a percentage such as 0.1%, as each track has its own unit; got "
                f"{self.bound!r}; a length bounds positions, with ",
                Keyword("max_error"),
            ) from None
        ABOVE_ZERO.check(percent, Keyword("bound"), "in percent")
        for kind in TargetKind:
            if getattr(self, kind.value) is not None:
                first, second = Keyword("bound"), Keyword(kind.value)
                raise InvalidInputError(first, " and ", second, " exclude each other; give one")
        object.__setattr__(self, "bound", percent)

    @property
    def bound_percent(self) -> float | None:
        """Error bound of positions and all tracks in percent of their ranges, if one was set."""
        return None if self.bound is None else float(self.bound)

    @property
    def track_quality(self) -> float | None:
        """Quality that determines bounds of tracks; None for targets that are errors."""
        has_quality = self.target.kind in (TargetKind.QUALITY, TargetKind.SIZE)
        return quality_of(self) if has_quality else None

    @cached_property
    def target(self) -> Target:
        """Target of `reel`: a rate, an error or a step."""
        if self.bound_percent is not None:
            return Target(TargetKind.MAX_ERROR, self.bound_percent)
        return target_of(**{kind.value: getattr(self, kind.value) for kind in TargetKind})

    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Return the number of frames per block without an option or a memory limit.

        Every cut repeats the fields that are not reused, so blocks are long. Long sequences are cut
        to limit time, memory and latency. Without fields, showing a frame decodes its whole block,
        which takes longer, and cuts cost fewer bytes.
        """
        if n_frames is None:
            return None
        if self.method not in REEL:
            together = max(MIN_EXACT_FRAMES, MAX_EXACT_POSITIONS // n_verts)
            together = max(1, min(together, MAX_BLOCK_POSITIONS // n_verts))
            return -(-n_frames // -(-n_frames // together))
        n_blocks = -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)
        if n_frames > MAX_UNCUT_FRAMES and n_frames * n_verts > MAX_UNCUT_POSITIONS:
            n_blocks = max(n_blocks, -(-n_frames // MAX_CUT_FRAMES))
        return -(-n_frames // n_blocks)

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Estimate the memory of encoding with blocks of this length."""
        n_positions, n_modes = block_frames * n_verts, min(3 * block_frames, MAX_MODES)
        mode_bytes, n_blocks = (BYTES_PER_MODE, 1) if is_whole else (BYTES_PER_COMPARED_MODE, 2)
        return (
            PROCESS_BYTES
            + BYTES_PER_FRAME * block_frames
            + BYTES_PER_PAIR * block_frames**2
            + (BYTES_PER_VERTEX + mode_bytes * n_modes) * n_verts
            + BYTES_PER_CACHED * min(n_positions, MAX_CACHED)
            + 3 * number_bytes * n_blocks * n_positions
        )


def quality_of(config: EncoderConfig) -> float:
    """Return the quality of options; the default one if they have another target."""
    if isinstance(config, ReelOptions) and config.target.kind is TargetKind.QUALITY:
        return config.target.value
    return DEFAULT_QUALITY
