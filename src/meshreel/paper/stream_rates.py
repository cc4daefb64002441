"""Rates in the count of the paper's Table I: bits per vertex and frame (paper Eq. 13).

The count covers one coordinate matrix of three, without connectivity, isolated vertices and
headers. Letters as in the paper: n vertices, k frames, n_c anchors, n_b blocks of k_f frames.
"""

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.codec.bitstream.layout import Section
from meshreel.kernel.integers import encode_integers
from meshreel.paper.blocks import write_coded_block
from meshreel.paper.coded_values import CodedBlock
from meshreel.paper.stream import PaperStream, read
from meshreel.paper.variants import Basis, Decoding, variant_named

N_AXES = 3


@dataclass(frozen=True)
class RateParts:
    """One count of a stream's bits per vertex and frame of a coordinate matrix.

    Attributes
    ----------
    q : float
        Bits of the coefficients.
    q_a : float or None
        Bits of the anchors; None for a variant without anchors (`pca`, `pca-q`, `v2v`), whose
        single vertex of each component is not counted.
    q_d : float or None
        Bits of the dictionaries; None for `gft`, which derives its basis from connectivity.
    bits_per_row : tuple of float64 arrays of shape (3, K)
        Mean bits of an entry in each row of coefficients of each block (paper Fig. 5).
    """

    q: float
    q_a: float | None
    q_d: float | None
    bits_per_row: tuple[Floats, ...]

    @property
    def q_s(self) -> float:
        """The sum of q, q_a and q_d."""
        return self.q + (self.q_a or 0.0) + (self.q_d or 0.0)


@dataclass(frozen=True)
class StreamRates:
    """Rates of a stream by Eq. 13 and as stored.

    Attributes
    ----------
    eq13 : RateParts
        Number of entries times their bits. An entry of a row takes the bits of the row's largest
        magnitude and a sign; an anchor position those of the largest position; an entry of a
        dictionary those of its largest entry, or the mean bits of a stored entry if dictionaries
        are stored as differences (`blocks`). A dictionary counts k_f x k_f entries, of
        which streams contain K k_f.
    stored : RateParts
        A third of the bytes in the stream, with quantization steps and tables, without the 4 to 9
        bytes around a section. `bits_per_row` codes each row separately; in a stream similar rows
        share a table.
    q_entropy : float
        q if each entry took the zero-order entropy of its row, without tables.
    dictionary_bits : float or None
        Bits of a dictionary's entry that `eq13` counts.
    q_d_per_block : float or None
        q_d of n_b dictionaries: Eq. 13 prints n_b^2 k_f^2 entries, n_b matrices have n_b k_f^2.
    """

    eq13: RateParts
    stored: RateParts
    q_entropy: float
    dictionary_bits: float | None
    q_d_per_block: float | None


def rates(
    data: bytes | bytearray | memoryview | str | os.PathLike[str] | PaperStream,
) -> StreamRates:
    """Return the rates of a stream in the count of Table I (paper Eq. 13).

    Parameters
    ----------
    data : bytes, path or PaperStream
        As for `read`, or a stream as arrays, also with replaced ones. Each array must consist of
        multiples of its steps.

    Raises
    ------
    InvalidInputError
        If replaced arrays do not fit the stream or their steps, or as `read`.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        As `read`.

    Examples
    --------
    >>> rates = meshreel.paper.rates(meshreel.encode(sequence, "pca-qp", n_modes=20))
    >>> rates.eq13.q_s, rates.stored.q_s
    """
    stream = data if isinstance(data, PaperStream) else read(data, all_frequencies=True)
    return rates_of(stream)


def rates_of(stream: PaperStream, *, has_coded_rows: bool = True) -> StreamRates:
    """The rates of a stream, as `rates`.

    Parameters
    ----------
    has_coded_rows : bool
        Whether to code each row separately for `bits_per_row` of the stored count; it is empty
        without, and `gft` with its thousands of rows much faster.
    """
    variant, size = variant_named(stream.method), stream.n_verts * stream.n_frames
    blocks = [stream.coded_block(block) for block in stream.blocks]
    stored_bytes = _stored_bytes(stream, blocks)

    def stored(*sections: Section) -> float:
        return 8 * sum(stored_bytes[section] for section in sections) / N_AXES / size

    fixed = tuple(_bits_of_rows(block, _fixed_length_bits) for block in blocks)
    entropy = tuple(_bits_of_rows(block, _entropy_bits) for block in blocks)
    anchors = dictionary = None
    if variant.decoding is Decoding.ANCHORED:
        anchors = sum(map(_anchor_bits, blocks)) / size
    if variant.basis is not Basis.GRAPH:
        has_differences = any(block.is_difference for block in stream.blocks)
        dictionary = _dictionary_bits(
            blocks, stored_bytes[Section.BASIS] if has_differences else None
        )
    n_squares = sum(block.n_frames**2 for block in stream.blocks)
    return StreamRates(
        eq13=RateParts(
            q=_matrix_bits(fixed, blocks) / size,
            q_a=anchors,
            q_d=None if dictionary is None else dictionary * stream.n_frames / stream.n_verts,
            bits_per_row=fixed,
        ),
        stored=RateParts(
            q=stored(Section.COEFFICIENTS),
            q_a=None if anchors is None else stored(Section.ANCHORS, Section.ANCHOR_RESIDUALS),
            q_d=None if dictionary is None else stored(Section.BASIS),
            bits_per_row=tuple(
                _bits_of_rows(block, _coded_bits) for block in (blocks if has_coded_rows else ())
            ),
        ),
        q_entropy=_matrix_bits(entropy, blocks) / size,
        dictionary_bits=dictionary,
        q_d_per_block=None if dictionary is None else dictionary * n_squares / size,
    )


def _stored_bytes(stream: PaperStream, blocks: Sequence[CodedBlock]) -> Counter[Section]:
    """Bytes of the payloads of all blocks, by section."""
    sizes, previous = Counter[Section](), None
    for block, arrays in zip(blocks, stream.blocks, strict=True):
        reference = previous if arrays.is_difference else None
        variant = variant_named(stream.method)
        for section, payload in write_coded_block(block, arrays.n_frames, variant, reference):
            sizes[section] += len(payload)
        previous = block.basis
    return sizes


def _bits_of_rows(block: CodedBlock, bits_of: Callable[[Integers], float]) -> Floats:
    """Mean bits of an entry in each row of coefficients, of shape (3, K)."""
    integers = block.coefficients.integers
    return np.array([[bits_of(row) / len(row) for row in axis] for axis in integers])


def _matrix_bits(bits_per_row: Sequence[Floats], blocks: Sequence[CodedBlock]) -> float:
    """Bits of all rows of a coordinate matrix, the mean of the three."""
    lengths = [block.coefficients.integers.shape[2] for block in blocks]
    rows = zip(bits_per_row, lengths, strict=True)
    return float(sum(bits.sum() * length for bits, length in rows)) / N_AXES


def _magnitude_bits(largest: float) -> int:
    """Bits of a sign and of integers up to this magnitude; 0 if all are zero."""
    return int(np.frexp(largest)[1]) + 1 if largest else 0


def _fixed_length_bits(row: Integers) -> float:
    return float(len(row) * _magnitude_bits(float(np.abs(row).max())))


def _entropy_bits(row: Integers) -> float:
    """Zero-order entropy of a row, in bits."""
    counts = np.unique(row, return_counts=True)[1]
    return float(len(row) * np.log2(len(row)) - counts @ np.log2(counts))


def _coded_bits(row: Integers) -> float:
    return 8.0 * len(encode_integers([row]))


def _anchor_bits(block: CodedBlock) -> float:
    """Bits of the anchors of one coordinate matrix: positions, or coefficients if stored alone."""
    anchors, positions = block.anchors, block.values.anchor_positions
    assert anchors is not None  # the method has them
    assert positions is not None
    if anchors.residuals is None:
        assert anchors.coefficients is not None
        integers = anchors.coefficients.integers
        return float(_magnitude_bits(float(np.abs(integers).max())) * integers[0].size)
    # Decoded positions differ from the originals by up to half a step.
    largest = np.floor(np.abs(positions).max() / (float(anchors.residuals.steps[0]) or 1.0))
    return float(_magnitude_bits(float(largest)) * positions[0].size)


def _dictionary_bits(blocks: Sequence[CodedBlock], n_bytes: int | None) -> float:
    """Bits of a dictionary's entry: of the largest, or the mean of stored differences."""
    entries = [block.basis.integers for block in blocks if block.basis is not None]
    if n_bytes is not None:
        return 8.0 * n_bytes / float(sum(integers.size for integers in entries))
    return float(max(_magnitude_bits(float(np.abs(integers).max())) for integers in entries))
