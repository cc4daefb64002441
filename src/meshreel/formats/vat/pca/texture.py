"""The texture of PCA textures: a header, weights and fields, in 8-bit texels of four channels.

From the top left, in reading order:

======================  ========================================================================
Texels                  Hold
======================  ========================================================================
8                       numbers of 24 bits, red the lowest byte: frames; rows of texels in a slice;
                        the first row of the slices of positions, texels of pairs, of single
                        digits; the same three of normals, where rows and texels are 0 without them
T (R + N)               weights as float32, red the highest byte, frame by frame: R of positions,
                        then N of normals
to the end of the row   nothing
P slices, then S        of positions: three for each texel of pairs and of single digits, x, y, z
P slices, then S        of normals, the same
======================  ========================================================================

A slice has a texel for each vertex, in reading order; column and row of a vertex in it are its
second texture coordinates. A byte is ``16 (upper + 8) + lower + 8``. Bytes of a texel of pairs have
one weight each, for ``15 upper + lower``; those of a texel of single digits two, first the four for
the upper digits, then the four for the lower ones. No alpha is 0.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes, Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.vat.pca.digits import BASE, ROWS, Rows

N_HEADER = 8
SIDES = (2048, 4096, 8192, 16384)
"""Largest sides of textures: as few GPUs lack as possible."""

ROOMY = 1.01
"""A texture may be so much larger than the smallest one."""

LARGEST_NUMBER = (1 << 24) - 1
EMPTY = 0x88
"""A byte of two digits of 0."""

MIDDLE = 8
"""What is added to a digit."""


@dataclass(frozen=True)
class Section:
    """Where the slices of positions, or of normals, are.

    Attributes
    ----------
    first_row : int
    n_pair_texels, n_single_texels : int
        Of each coordinate.
    """

    first_row: int
    n_pair_texels: int
    n_single_texels: int

    @property
    def n_slices(self) -> int:
        """Slices of all coordinates."""
        return 3 * (self.n_pair_texels + self.n_single_texels)

    @property
    def n_weights(self) -> int:
        """Weights of a frame."""
        return ROWS // 2 * self.n_pair_texels + ROWS * self.n_single_texels


@dataclass(frozen=True)
class Header:
    """What the first texels say.

    Attributes
    ----------
    n_frames : int
    slice_rows : int
        Rows of texels in a slice.
    positions, normals : Section
    """

    n_frames: int
    slice_rows: int
    positions: Section
    normals: Section

    @property
    def numbers(self) -> list[int]:
        """The numbers in their order."""
        sections = [self.positions, self.normals]
        own = [[one.first_row, one.n_pair_texels, one.n_single_texels] for one in sections]
        return [self.n_frames, self.slice_rows, *own[0], *own[1]]


def make_texture(positions: Rows, normals: Rows | None, n_verts: int) -> Bytes:
    """The texture of rows, of shape (height, width, 4).

    Raises
    ------
    InvalidInputError
        If it would be larger than GPUs hold them.
    """
    given = [positions] if normals is None else [positions, normals]
    weights = np.concatenate([one.weights for one in given], axis=1)
    counts = [(one.n_pair_texels, one.n_single_texels) for one in given] + [(0, 0)]
    n_slices = 3 * sum(map(sum, counts))
    width, slice_rows = _fit(n_verts, N_HEADER + weights.size, n_slices)
    first = -(-(N_HEADER + weights.size) // width)
    own = Section(first, *counts[0])
    second = Section(first + own.n_slices * slice_rows if normals else 0, *counts[1])
    header = Header(len(weights), slice_rows, own, second)
    texels = np.full((first + n_slices * slice_rows, width, 4), EMPTY, np.uint8)
    rows = texels.reshape(-1, 4)
    rows[:N_HEADER] = _numbers_to_bytes(header.numbers)
    rows[N_HEADER : N_HEADER + weights.size] = weights_to_bytes(weights).reshape(-1, 4)
    slices = texels[first:].reshape(n_slices, slice_rows * width, 4)
    start = 0
    for one in given:
        for filled in (_pair_bytes(one), _single_bytes(one)):
            slices[start : start + len(filled), :n_verts] = filled
            start += len(filled)
    return texels


def read_header(texels: Bytes) -> Header:
    """What the first texels of a texture say."""
    found = texels.reshape(-1, 4)[:N_HEADER].astype(np.int64)
    numbers = [int(number) for number in found[:, :3] @ [1, 1 << 8, 1 << 16]]
    positions, normals = Section(*numbers[2:5]), Section(*numbers[5:])
    return Header(numbers[0], numbers[1], positions, normals)


def texel_places(texels: Bytes, n_verts: int) -> npt.NDArray[np.int64]:
    """Column and row of each vertex in a slice, of shape (V, 2)."""
    row, column = np.divmod(np.arange(n_verts), texels.shape[1])
    return np.stack([column, row], axis=1)


def section_offsets(texels: Bytes, header: Header, section: Section, n_verts: int) -> "Offsets":
    """What a section of a texture adds to the mesh at rest, as shaders read it."""
    n_all = header.positions.n_weights + header.normals.n_weights
    table = texels.reshape(-1, 4)[N_HEADER : N_HEADER + header.n_frames * n_all]
    weights = bytes_to_weights(table).reshape(header.n_frames, n_all)
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
        P.
    """

    weights: Singles
    slices: Bytes
    n_pair_texels: int

    def frame(self, number: int) -> Singles:
        """What is added in a frame, of shape (V, 3), in float32 as shaders compute it."""
        added = np.zeros((self.slices.shape[1], 3), np.float32)
        weights, start = self.weights[number], 0
        for texel in range(len(self.slices) // 3):
            is_pair = texel < self.n_pair_texels
            own = weights[start : start + (ROWS // 2 if is_pair else ROWS)]
            start += len(own)
            for axis in range(3):
                texels = self.slices[3 * texel + axis]
                upper = (texels >> 4).astype(np.float32) - np.float32(MIDDLE)
                lower = (texels & 15).astype(np.float32) - np.float32(MIDDLE)
                if is_pair:
                    added[:, axis] += (np.float32(BASE) * upper + lower) @ own
                else:
                    added[:, axis] += upper @ own[: ROWS // 2] + lower @ own[ROWS // 2 :]
        return added


def weights_to_bytes(weights: Singles) -> Bytes:
    """Weights as texels of shape (..., 4), the highest byte first; the lowest one is never 0.

    It is 1 where it would be 0, which changes a weight by 2**-23 of it.
    """
    found = np.ascontiguousarray(weights, ">f4").view(np.uint8).reshape(*weights.shape, 4)
    found[..., 3] = np.maximum(found[..., 3], 1)
    return found


def bytes_to_weights(texels: Bytes) -> Singles:
    """Weights of texels of shape (..., 4)."""
    return np.ascontiguousarray(texels).view(">f4")[..., 0].astype(np.float32)


def _numbers_to_bytes(numbers: Sequence[int]) -> Bytes:
    if (largest := max(numbers)) > LARGEST_NUMBER:
        raise InvalidInputError(
            f"the header of PCA textures holds numbers up to {LARGEST_NUMBER}; got {largest}; "
            "take fewer frames (--frames)"
        )
    rows = [[one & 255, one >> 8 & 255, one >> 16, 255] for one in numbers]
    return np.array(rows, np.uint8)


def _pair_bytes(rows: Rows) -> Bytes:
    """Slices of pairs, of shape (3 P, V, 4)."""
    return _slices(rows.pairs[:, 0], rows.pairs[:, 1])


def _single_bytes(rows: Rows) -> Bytes:
    """Slices of single digits, of shape (3 S, V, 4); of eight rows the first four are upper."""
    n_texels, size = rows.n_single_texels, rows.singles.shape[1]
    by_texel = rows.singles.reshape(n_texels, 2, ROWS // 2, size)
    halves = (ROWS // 2 * n_texels, size)
    return _slices(by_texel[:, 0].reshape(halves), by_texel[:, 1].reshape(halves))


def _slices(upper: npt.NDArray[np.int8], lower: npt.NDArray[np.int8]) -> Bytes:
    """Slices of digits of shape (4 n, 3 V): shape (3 n, V, 4)."""
    found = (16 * (upper.astype(np.int16) + MIDDLE) + lower + MIDDLE).astype(np.uint8)
    n_texels, n_verts = len(found) // 4, found.shape[1] // 3
    moved = found.reshape(n_texels, 4, n_verts, 3).transpose(0, 3, 2, 1)
    return moved.reshape(3 * n_texels, n_verts, 4)


def _fit(n_verts: int, n_before: int, n_slices: int) -> tuple[int, int]:
    """Width, and rows of a slice, of a texture that is nearly square, and nearly the smallest.

    Its sides are as short as few GPUs lack.
    """
    for side in SIDES:
        fits = []
        for slice_rows in range(1, side + 1):
            width = max(-(-n_verts // slice_rows), N_HEADER)
            height = -(-n_before // width) + n_slices * slice_rows
            if width <= side and height <= side:
                fits.append((width * height, width, slice_rows))
            if height > side and width <= side:
                break
        if fits:
            small = ROOMY * min(fits)[0]
            return min(
                (abs(math.log(width * width / area)), width, slice_rows)
                for area, width, slice_rows in fits
                if area <= small
            )[1:]
    raise InvalidInputError(
        f"{n_verts} vertices with {n_slices} slices and {n_before} weights need a texture of more "
        f"than {SIDES[-1]} texels a side, which is all that GPUs hold; allow a larger error "
        "(--max-error), or take fewer frames (--frames)"
    )
