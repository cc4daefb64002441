"""Options of the paper's methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, ClassVar

from meshreel.codec.bitstream.layout import Laplacian
from meshreel.codec.config import EncoderConfig
from meshreel.codec.methods import method_named
from meshreel.codec.option import COUNT, Option, Range

PAPER_METHODS = ("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft")
DELTA_METHODS = tuple(name for name in PAPER_METHODS if name != "v2v")
"""All methods of the paper, and those that code delta coordinates."""

GROUP = "The paper's methods"

BITS_RANGE = Range(2, 24, is_whole=True)
DEFAULT_BITS, FINE_BITS = 9, 16
"""Default bits of coefficients; `pca` uses `FINE_BITS`."""

DEFAULT_ENERGY, DEFAULT_ANCHORS, DEFAULT_ITERATIONS = 0.99995, 0.01, 4

TRACKED_BLOCK_FRAMES = 25
"""Maximum number of frames per block of `blocks`, by default."""

PROCESS_BYTES, BYTES_PER_VERTEX, BYTES_PER_POSITION = 100e6, 4000.0, 130.0
"""Estimated memory: constant, per vertex, and per position of a block; a graph basis is extra."""


def equal_blocks(n_frames: int) -> int:
    """Frames of each block, the paper's k_f = k / n_b, for n_b = ceil(k / 25) blocks.

    The last block may have fewer.
    """
    n_blocks = -(-n_frames // TRACKED_BLOCK_FRAMES)
    return -(-n_frames // n_blocks)


class Allocation(Enum):
    """Distribution of bits over the rows of coefficients."""

    ENERGY = "energy"
    CONSTANT = "constant"


@dataclass(frozen=True, kw_only=True)
class PaperOptions(EncoderConfig):
    """Options of the paper's methods; `paper.settings.check` checks their combinations."""

    positions_only: ClassVar[bool] = True

    energy: Annotated[
        float | None,
        Option(
            "Share of the shape's energy to keep, up to 1; chooses the number of modes.",
            default_text=str(DEFAULT_ENERGY),
            range=Range(0, 1, is_open=True),
            unit="a share of the energy",
            group=GROUP,
            more="The omitted energy causes a KG error of sqrt(1 - energy), by default 0.7 %.",
            methods=PAPER_METHODS,
        ),
    ] = None
    bits: Annotated[
        int | Sequence[int] | None,
        Option(
            f"Bits of the largest coefficient, {BITS_RANGE.words}; or of each row, 0 to omit it.",
            default_text=f"{DEFAULT_BITS}; pca: {FINE_BITS}",
            range=BITS_RANGE,
            group=GROUP,
            metavar="N[,N...]",
            methods=PAPER_METHODS,
        ),
    ] = None
    allocation: Annotated[
        str,
        Option(
            "How to distribute one number of bits over the rows.",
            names=tuple(allocation.value for allocation in Allocation),
            group=GROUP,
            more="energy: all share the step of the largest, so that bits follow a row's energy; "
            "constant: each row spreads that many bits over its range.",
            methods=PAPER_METHODS,
        ),
    ] = Allocation.ENERGY.value
    anchors: Annotated[
        float | Sequence[int] | None,
        Option(
            "Share of the vertices stored as anchors, 0 to 1, if the method has anchors; or their "
            "indices.",
            default_text=str(DEFAULT_ANCHORS),
            range=Range(0, 1),
            unit="a share of the vertices (0.01 = 1 %)",
            group=GROUP,
            metavar="SHARE or N,N...",
            more="Every connected component gets at least one: 0 decodes by L alone (Eq. 11).",
            synonyms={"n_c": "a share of the vertices (n_c / n)"},
            methods=PAPER_METHODS,
        ),
    ] = None
    choices: Annotated[
        str | Mapping[str, object] | None,
        Option(
            "Choices that the paper leaves open, separated by commas: anchor-values, anchor-set, "
            "anchor-seed, anchor-bits, dictionary-bits, quantize, centering, dictionary, rotation.",
            group=GROUP,
            metavar="NAME=VALUE[,...]",
            more='Such as `"anchor-values=coefficients,anchor-bits=16"`, or a mapping; '
            "`meshreel.paper.PaperChoices` describes each.",
            methods=PAPER_METHODS,
        ),
    ] = None
    laplacian: Annotated[
        str,
        Option(
            "Laplacian matrix of the deltas.",
            names=tuple(laplacian.name.lower() for laplacian in Laplacian),
            group=GROUP,
            more="normalized: I - D^-1 C (Eq. 3), with smaller measured errors; combinatorial: "
            "D - C (Eq. 1); cotangent: I - D^-1 W with the cotangent weights of the first frame, "
            "which is stored too.",
            methods=DELTA_METHODS,
        ),
    ] = Laplacian.NORMALIZED.name.lower()
    n_iterations: Annotated[
        int,
        Option(
            "Orthogonal iterations from block to block (blocks).",
            range=COUNT,
            group=GROUP,
            flag="--iterations",
            synonyms={"t_max": "which is t_max - 1"},
            methods=("blocks",),
        ),
    ] = DEFAULT_ITERATIONS

    def _complete(self) -> None:
        method_named(self.method).check(self)

    @property
    def laplacian_choice(self) -> Laplacian:
        """The Laplacian as an enumeration member."""
        return Laplacian[self.laplacian.upper()]

    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Default frames per block, if memory suffices; those of `blocks` are of equal length."""
        if self.method != "blocks":
            return n_frames
        return TRACKED_BLOCK_FRAMES if n_frames is None else equal_blocks(n_frames)

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Memory for encoding with blocks of this many frames, independent of the number type."""
        return PROCESS_BYTES + n_verts * (BYTES_PER_VERTEX + BYTES_PER_POSITION * block_frames)
