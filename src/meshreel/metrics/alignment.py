"""Detect a change of axes, scale and position between two sequences from different programs."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.sequence import FrameSource

MAX_SAMPLED_FRAMES, MAX_SAMPLED_VERTS = 8, 4096

MIN_DIFFERENCE = 0.02
"""Smaller differences, as a fraction of the size, are coding errors and not aligned."""

MAX_RESIDUAL = 0.1
"""Largest residual of an alignment, as a fraction of the difference that it explains."""

AXIS_CONVERSIONS: dict[tuple[str, ...], str] = {
    ("x", "-z", "y"): "y-up to z-up",
    ("x", "z", "-y"): "z-up to y-up",
}


@dataclass(frozen=True)
class Alignment:
    """Axis permutation, scale and shift that map one sequence onto another."""

    axes: tuple[str, ...]
    """tuple of 3 str. Source axes of x, y and z of the second sequence, such as ("x", "-z", "y").
    """
    scale: float
    """Size of the second sequence relative to the first."""
    shift: tuple[float, ...]
    """tuple of 3 floats. Translation after scaling, in units of the second sequence."""
    residual_percent: float
    """RMS difference after alignment, in percent of the RMS size of the second sequence."""

    @property
    def is_mirrored(self) -> bool:
        """Whether the axis permutation changes handedness."""
        order = ["xyz".index(axis[-1]) for axis in self.axes]
        n_swaps = sum(order[i] > order[j] for i in range(3) for j in range(i + 1, 3))
        return (n_swaps + sum(axis[0] == "-" for axis in self.axes)) % 2 == 1

    def __str__(self) -> str:
        changes = []
        if self.axes != ("x", "y", "z"):
            kind = AXIS_CONVERSIONS.get(self.axes) or (
                "mirrored" if self.is_mirrored else "rotated"
            )
            changes.append(f"its x, y, z are {', '.join(self.axes)} of the original ({kind})")
        if abs(self.scale - 1) > MIN_DIFFERENCE / 10:
            changes.append(f"it is {self.scale:.6g} times as large")
        if any(self.shift):
            shift = ", ".join(f"{offset:.6g}" for offset in self.shift)
            changes.append(f"it is shifted by ({shift})")
        return (
            f"the decoded sequence differs in axes, scale or position: {'; '.join(changes)}; after "
            f"alignment {self.residual_percent:.2g} % of the size (RMS) remain"
        )


def find_alignment(original: FrameSource, decoded: FrameSource) -> Alignment | None:
    """Return the alignment that explains most of the difference, or None.

    Tries all permutations and signs of the axes, each with its best scale and shift, and keeps the
    one with the least squared distance. None if the sequences hardly differ or differ otherwise.

    Parameters
    ----------
    original, decoded : FrameSource
        With equal frame and vertex counts.
    """
    first, second, unit = _sample_pair(original, decoded)
    middle, middle_hat = (points.mean(axis=(0, 1)) for points in (first, second))
    shape, shape_hat = (first - middle).reshape(-1, 3), (second - middle_hat).reshape(-1, 3)
    size, size_hat = float(np.vdot(shape, shape)), float(np.vdot(shape_hat, shape_hat))
    difference = float(np.square(second - first).sum())
    if size == 0 or size_hat == 0 or difference <= MIN_DIFFERENCE**2 * size:
        return None
    order, signs, match = _best_axes(shape_hat.T @ shape)
    if match <= 0:
        return None
    scale = match / size
    residual = max(0.0, size_hat - scale**2 * size)
    if residual > MAX_RESIDUAL**2 * min(difference, size_hat):
        return None
    shift = middle_hat - scale * signs * middle[list(order)]
    is_moved = np.linalg.norm(shift) * np.sqrt(len(shape_hat)) > MIN_DIFFERENCE * np.sqrt(size_hat)
    return Alignment(
        tuple(
            f"{'-' if sign < 0 else ''}{'xyz'[axis]}"
            for axis, sign in zip(order, signs, strict=True)
        ),
        scale,
        tuple((shift / unit).tolist()) if is_moved else (0.0, 0.0, 0.0),
        100.0 * float(np.sqrt(residual / size_hat)),
    )


def _best_axes(products: Floats) -> tuple[tuple[int, ...], Floats, float]:
    """Best order and signs of the axes, and their correlation; `products` has shape (3, 3)."""
    best: tuple[tuple[int, ...], Floats, float] | None = None
    # The identity comes first and wins ties.
    for order in permutations(range(3)):
        chosen = products[range(3), order]
        match = float(np.abs(chosen).sum())
        if best is None or match > best[2] * (1 + 1e-6):
            negligible = np.abs(chosen) <= 1e-9 * np.abs(products).max()
            best = order, np.where((chosen < 0) & ~negligible, -1.0, 1.0), match
    assert best is not None
    return best


def _sample_pair(original: FrameSource, decoded: FrameSource) -> tuple[Floats, Floats, float]:
    """Evenly spaced frames and vertices of both, scaled to about 1, and the scale factor."""
    frames = np.unique(np.linspace(0, original.n_frames - 1, MAX_SAMPLED_FRAMES).astype(int))
    verts = np.unique(np.linspace(0, original.n_verts - 1, MAX_SAMPLED_VERTS).astype(int))
    first, second = (
        np.stack([source.read(int(n), int(n) + 1)[0][verts] for n in frames]).astype(np.float64)
        for source in (original, decoded)
    )
    scale = bounding_box_reference(first).scale
    return first * scale, second * scale, scale
