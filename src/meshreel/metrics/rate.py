"""Bit rate of a file."""


def rate_bpvf(size_bytes: int, n_verts: int, n_frames: int) -> float:
    """Bits of the whole file per vertex and frame, ``8 bytes / (V T)``."""
    return 8 * size_bytes / (n_verts * n_frames)
