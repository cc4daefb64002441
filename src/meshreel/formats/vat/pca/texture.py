"""The texture file of PCA textures: header, weights and fields, in 8-bit RGBA texels.

From the top left, in reading order:

======================  ========================================================================
Texels                  Content
======================  ========================================================================
8                       24-bit integers, red the lowest byte: frames; rows of texels per slice;
                        of positions, the first row of its slices, texels of pairs, texels of
                        single digits; the same of normals, with rows and texels 0 without them
T (R + N)               weights as float32, red the highest byte, frame by frame: R of positions,
                        then N of normals
to the end of the row   unused
P slices, then S        positions: per texel of pairs or of single digits, slices of x, y and z
P slices, then S        normals, in the same way
======================  ========================================================================

A slice has one texel per vertex, in reading order; column and row of a vertex are its second UVs.
A byte is ``16 (upper + 8) + lower + 8``. Each byte of a texel of pairs has one weight, for
``15 upper + lower``; each byte of a texel of single digits has two, the four of the upper digits
first, then the four of the lower ones. No alpha is 0.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes, Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.vat.pca.digits import BASE, DIGITS_PER_TEXEL, DigitRows

N_HEADER = 8
SIDES = (2048, 4096, 8192, 16384)
"""Texture sizes to try, from those that most GPUs support."""

MAX_AREA_RATIO = 1.01
"""Limit of the area relative to the smallest texture, in exchange for a squarer one."""

MAX_HEADER_NUMBER = (1 << 24) - 1
EMPTY_BYTE = 0x88
"""Byte with two digits of 0."""

DIGIT_BIAS = 8
"""Offset of digits in a byte, which makes them positive."""


@dataclass(frozen=True)
class Section:
    """Location of the slices of positions or normals.

    Attributes
    ----------
    n_pair_texels, n_single_texels : int
        Texels per coordinate of a vertex.
    """

    first_row: int
    n_pair_texels: int
    n_single_texels: int

    @property
    def n_slices(self) -> int:
        """Number of slices of all coordinates."""
        return 3 * (self.n_pair_texels + self.n_single_texels)

    @property
    def n_weights(self) -> int:
        """Number of weights per frame."""
        return DIGITS_PER_TEXEL // 2 * self.n_pair_texels + DIGITS_PER_TEXEL * self.n_single_texels


@dataclass(frozen=True)
class Header:
    """The numbers in the first texels.

    Attributes
    ----------
    slice_rows : int
        Rows of texels per slice.
    """

    n_frames: int
    slice_rows: int
    positions: Section
    normals: Section

    @property
    def numbers(self) -> list[int]:
        """The numbers in file order."""
        sections = [self.positions, self.normals]
        counts = [[one.first_row, one.n_pair_texels, one.n_single_texels] for one in sections]
        return [self.n_frames, self.slice_rows, *counts[0], *counts[1]]


def make_texture(positions: DigitRows, normals: DigitRows | None, n_verts: int) -> Bytes:
    """Return the texture of positions and normals, of shape (height, width, 4).

    Raises
    ------
    InvalidInputError
        If it would exceed the texture size of GPUs.
    """
    sections = [positions] if normals is None else [positions, normals]
    weights = np.concatenate([one.weights for one in sections], axis=1)
    counts = [(one.n_pair_texels, one.n_single_texels) for one in sections] + [(0, 0)]
    n_slices = 3 * sum(map(sum, counts))
    width, slice_rows = choose_size(n_verts, N_HEADER + weights.size, n_slices)
    first = -(-(N_HEADER + weights.size) // width)
    first_section = Section(first, *counts[0])
    second_row = first + first_section.n_slices * slice_rows
    second_section = Section(second_row if normals else 0, *counts[1])
    header = Header(len(weights), slice_rows, first_section, second_section)
    texels = np.full((first + n_slices * slice_rows, width, 4), EMPTY_BYTE, np.uint8)
    rows = texels.reshape(-1, 4)
    rows[:N_HEADER] = _numbers_to_bytes(header.numbers)
    rows[N_HEADER : N_HEADER + weights.size] = weights_to_bytes(weights).reshape(-1, 4)
    slices = texels[first:].reshape(n_slices, slice_rows * width, 4)
    start = 0
    for one in sections:
        for block in (_pair_bytes(one), _single_bytes(one)):
            slices[start : start + len(block), :n_verts] = block
            start += len(block)
    return texels


def read_header(texels: Bytes) -> Header:
    """Return the numbers in the first texels of a texture."""
    header = texels.reshape(-1, 4)[:N_HEADER].astype(np.int64)
    numbers = [int(number) for number in header[:, :3] @ [1, 1 << 8, 1 << 16]]
    positions, normals = Section(*numbers[2:5]), Section(*numbers[5:])
    return Header(numbers[0], numbers[1], positions, normals)


def texel_coordinates(texels: Bytes, n_verts: int) -> npt.NDArray[np.int64]:
    """Return column and row of each vertex in a slice, of shape (V, 2)."""
    row, column = np.divmod(np.arange(n_verts), texels.shape[1])
    return np.stack([column, row], axis=1)


def section_offsets(texels: Bytes, header: Header, section: Section, n_verts: int) -> "Offsets":
    """Return the offsets from the rest mesh in a section of a texture, as shaders read it."""
    n_weights = header.positions.n_weights + header.normals.n_weights
    table = texels.reshape(-1, 4)[N_HEADER : N_HEADER + header.n_frames * n_weights]
    weights = bytes_to_weights(table).reshape(header.n_frames, n_weights)
    before = 0 if section is header.positions else header.positions.n_weights
    last_row = section.first_row + section.n_slices * header.slice_rows
    size = header.slice_rows * texels.shape[1]
    slices = texels[section.first_row : last_row].reshape(section.n_slices, size, 4)[:, :n_verts]
    return Offsets(weights[:, before : before + section.n_weights], slices, section.n_pair_texels)


@dataclass(frozen=True, eq=False)
class Offsets:
    """Weights and texels of a section.

    Attributes
    ----------
    weights : float32 array of shape (T, R)
    slices : uint8 array of shape (3 (P + S), V, 4)
    n_pair_texels : int
        P, the texels of pairs per coordinate.
    """

    weights: Singles
    slices: Bytes
    n_pair_texels: int

    def frame(self, number: int) -> Singles:
        """Return the offsets of a frame, of shape (V, 3), in float32 as shaders compute them."""
        added = np.zeros((self.slices.shape[1], 3), np.float32)
        weights, start = self.weights[number], 0
        for texel in range(len(self.slices) // 3):
            is_pair = texel < self.n_pair_texels
            own = weights[start : start + (DIGITS_PER_TEXEL // 2 if is_pair else DIGITS_PER_TEXEL)]
            start += len(own)
            for axis in range(3):
                texels = self.slices[3 * texel + axis]
                upper = (texels >> 4).astype(np.float32) - np.float32(DIGIT_BIAS)
                lower = (texels & 15).astype(np.float32) - np.float32(DIGIT_BIAS)
                if is_pair:
                    added[:, axis] += (np.float32(BASE) * upper + lower) @ own
                else:
                    added[:, axis] += (
                        upper @ own[: DIGITS_PER_TEXEL // 2] + lower @ own[DIGITS_PER_TEXEL // 2 :]
                    )
        return added


def weights_to_bytes(weights: Singles) -> Bytes:
    """Return weights as texels of shape (..., 4), highest byte first.

    The lowest byte, which is alpha, is 1 instead of 0: a relative change of 2**-23.
    """
    stored = np.ascontiguousarray(weights, ">f4").view(np.uint8).reshape(*weights.shape, 4)
    stored[..., 3] = np.maximum(stored[..., 3], 1)
    return stored


def bytes_to_weights(texels: Bytes) -> Singles:
    """Return the weights in texels of shape (..., 4)."""
    return np.ascontiguousarray(texels).view(">f4")[..., 0].astype(np.float32)


def _numbers_to_bytes(numbers: Sequence[int]) -> Bytes:
    if (largest := max(numbers)) > MAX_HEADER_NUMBER:
        raise InvalidInputError(
            f"the header of PCA textures stores numbers up to {MAX_HEADER_NUMBER}; got {largest}; "
            "use fewer frames (--frames)"
        )
    rows = [[one & 255, one >> 8 & 255, one >> 16, 255] for one in numbers]
    return np.array(rows, np.uint8)


def _pair_bytes(rows: DigitRows) -> Bytes:
    """Return the slices of pairs, of shape (3 P, V, 4)."""
    return _slices(rows.pairs[:, 0], rows.pairs[:, 1])


def _single_bytes(rows: DigitRows) -> Bytes:
    """Return the slices of single digits, of shape (3 S, V, 4), upper digits first."""
    n_texels, size = rows.n_single_texels, rows.singles.shape[1]
    by_texel = rows.singles.reshape(n_texels, 2, DIGITS_PER_TEXEL // 2, size)
    halves = (DIGITS_PER_TEXEL // 2 * n_texels, size)
    return _slices(by_texel[:, 0].reshape(halves), by_texel[:, 1].reshape(halves))


def _slices(upper: npt.NDArray[np.int8], lower: npt.NDArray[np.int8]) -> Bytes:
    """Return the slices of digits of shape (4 n, 3 V), of shape (3 n, V, 4)."""
    slices = (16 * (upper.astype(np.int16) + DIGIT_BIAS) + lower + DIGIT_BIAS).astype(np.uint8)
    n_texels, n_verts = len(slices) // 4, slices.shape[1] // 3
    arranged = slices.reshape(n_texels, 4, n_verts, 3).transpose(0, 3, 2, 1)
    return arranged.reshape(3 * n_texels, n_verts, 4)


def choose_size(n_verts: int, n_before: int, n_slices: int) -> tuple[int, int]:
    """Return the width, and the rows per slice, of a small and nearly square texture.

    Its sides are within the smallest limit of `SIDES` that is large enough.
    """
    for side in SIDES:
        candidates = []
        for slice_rows in range(1, side + 1):
            width = max(-(-n_verts // slice_rows), N_HEADER)
            height = -(-n_before // width) + n_slices * slice_rows
            if width <= side and height <= side:
                candidates.append((width * height, width, slice_rows))
            if height > side and width <= side:
                break
        if candidates:
            max_area = MAX_AREA_RATIO * min(candidates)[0]
            return min(
                (abs(math.log(width * width / area)), width, slice_rows)
                for area, width, slice_rows in candidates
                if area <= max_area
            )[1:]
    raise InvalidInputError(
        f"{n_verts} vertices with {n_slices} slices and {n_before} weights need a texture of more "
        f"than {SIDES[-1]} texels per side, the limit of GPUs; allow a larger error (--max-error), "
        "or use fewer frames (--frames)"
    )
