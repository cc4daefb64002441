"""Rates: the true bits per vertex and frame, and the parts of the paper's count (paper Eq. 13).

The paper's parts count one coordinate matrix of three and leave connectivity, means and headers
out, so they compare with its tables only. The letters are the paper's: n vertices, k frames,
n_c anchors, n_b blocks of k_f frames.
"""


def rate_bpvf(size_bytes: int, n_verts: int, n_frames: int) -> float:
    """Bits of the whole file per vertex and frame, ``8 bytes / (V T)``.

    Everything counts: the three coordinates, connectivity, basis, anchors and headers.
    """
    return 8 * size_bytes / (n_verts * n_frames)


def paper_coefficients_bpvf(coefficient_bits: float, n_verts: int, n_frames: int) -> float:
    """The paper's q: all coefficient bits of one coordinate, over n k.

    Parameters
    ----------
    coefficient_bits : float
        Bits in total for the coefficients of one coordinate. Where every coefficient takes the
        same bits, that is ``bits n k`` and q is those bits.
    """
    return coefficient_bits / (n_verts * n_frames)


def paper_anchors_bpvf(n_anchors: int, n_verts: int, *, bits: float = 16) -> float:
    """The paper's q_a of one coordinate, ``bits n_c k / (n k)``; the frames cancel."""
    return bits * n_anchors / n_verts


def paper_dictionary_bpvf_as_printed(
    n_blocks: int, block_frames: int, n_verts: int, n_frames: int, *, bits: float = 16
) -> float:
    """The paper's q_d as printed, ``bits n_b^2 k_f^2 / (n k)``.

    With blocks that fill the sequence this is ``bits k / n`` for any number of them: the cost
    of one k x k dictionary, which is what the paper's tables hold for a single block.
    """
    return bits * n_blocks**2 * block_frames**2 / (n_verts * n_frames)


def paper_dictionary_bpvf_as_stored(
    n_blocks: int, block_frames: int, n_verts: int, n_frames: int, *, bits: float = 16
) -> float:
    """The paper's q_d for what is stored, ``bits n_b k_f^2 / (n k)``.

    Each of the n_b blocks has one k_f x k_f dictionary. Equal to the printed form for one block.
    """
    # Deviation from Eq. 13: it prints n_b^2, but storage grows with n_b.
    return bits * n_blocks * block_frames**2 / (n_verts * n_frames)
