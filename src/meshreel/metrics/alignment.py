"""Whether two sequences differ only by axes, scale and place, as programs differ in them."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.sequence import FrameSource

MOST_FRAMES, MOST_VERTICES = 8, 4096
"""Samples of a sequence, evenly spaced; a turn of axes shows in few."""

NOTICEABLE = 0.02
"""Differences of less than this share of the size are errors of a codec, not of axes."""

EXPLAINED = 0.1
"""How much may be left of the difference for axes, scale and place to explain it."""

NAMED_TURNS: dict[tuple[str, ...], str] = {
    ("x", "-z", "y"): "y upwards was turned to z upwards",
    ("x", "z", "-y"): "z upwards was turned to y upwards",
}


@dataclass(frozen=True)
class Alignment:
    """Turn, scale and shift that make of one sequence nearly the other.

    Attributes
    ----------
    axes : tuple of 3 str
        The axes of the first that x, y and z of the second are, such as ("x", "-z", "y").
    scale : float
        Size of the second by that of the first.
    shift : tuple of 3 floats
        By how much the second was moved then, in its units.
    left_percent : float
        RMS of what differs still, in percent of the RMS size of the second.
    """

    axes: tuple[str, ...]
    scale: float
    shift: tuple[float, ...]
    left_percent: float

    @property
    def is_mirrored(self) -> bool:
        """Whether the turn makes left out of right."""
        order = ["xyz".index(axis[-1]) for axis in self.axes]
        n_swaps = sum(order[i] > order[j] for i in range(3) for j in range(i + 1, 3))
        return (n_swaps + sum(axis[0] == "-" for axis in self.axes)) % 2 == 1

    def __str__(self) -> str:
        told = []
        if self.axes != ("x", "y", "z"):
            turn = NAMED_TURNS.get(self.axes) or ("mirrored" if self.is_mirrored else "turned")
            told.append(f"its x, y, z are {', '.join(self.axes)} of the original ({turn})")
        if abs(self.scale - 1) > NOTICEABLE / 10:
            told.append(f"it is {self.scale:.6g} times as large")
        if any(self.shift):
            place = ", ".join(f"{one:.6g}" for one in self.shift)
            told.append(f"it is moved by ({place})")
        return (
            f"most of the difference is one of axes, scale or place: {'; '.join(told)}; apart from "
            f"that the two differ by {self.left_percent:.2g} % of the size (RMS)"
        )


def find_alignment(original: FrameSource, decoded: FrameSource) -> Alignment | None:
    """The turn of axes, the scale and the shift that explain most of a difference, if any do.

    Of all permutations and signs of the axes that with the least squared distance, each with its
    best scale and shift. None where the sequences hardly differ, or differ otherwise.

    Parameters
    ----------
    original, decoded : FrameSource
        Of as many frames and vertices.
    """
    first, second, unit = _sampled(original, decoded)
    middle, middle_hat = (one.mean(axis=(0, 1)) for one in (first, second))
    shape, shape_hat = (first - middle).reshape(-1, 3), (second - middle_hat).reshape(-1, 3)
    size, size_hat = float(np.vdot(shape, shape)), float(np.vdot(shape_hat, shape_hat))
    difference = float(np.square(second - first).sum())
    if size == 0 or size_hat == 0 or difference <= NOTICEABLE**2 * size:
        return None
    order, signs, match = _best_axes(shape_hat.T @ shape)
    if match <= 0:
        return None
    scale = match / size
    left = max(0.0, size_hat - scale**2 * size)
    if left > EXPLAINED**2 * min(difference, size_hat):
        return None
    shift = middle_hat - scale * signs * middle[list(order)]
    is_moved = np.linalg.norm(shift) * np.sqrt(len(shape_hat)) > NOTICEABLE * np.sqrt(size_hat)
    return Alignment(
        tuple(
            f"{'-' if sign < 0 else ''}{'xyz'[axis]}"
            for axis, sign in zip(order, signs, strict=True)
        ),
        scale,
        tuple((shift / unit).tolist()) if is_moved else (0.0, 0.0, 0.0),
        100.0 * float(np.sqrt(left / size_hat)),
    )


def _best_axes(products: Floats) -> tuple[tuple[int, ...], Floats, float]:
    """Order and signs of the axes that fit best, and their sum of products, of shape (3, 3)."""
    best: tuple[tuple[int, ...], Floats, float] | None = None
    # The first order is the identity, which stays unless another is better.
    for order in permutations(range(3)):
        chosen = products[range(3), order]
        match = float(np.abs(chosen).sum())
        if best is None or match > best[2] * (1 + 1e-6):
            negligible = np.abs(chosen) <= 1e-9 * np.abs(products).max()
            best = order, np.where((chosen < 0) & ~negligible, -1.0, 1.0), match
    assert best is not None  # there are six orders
    return best


def _sampled(original: FrameSource, decoded: FrameSource) -> tuple[Floats, Floats, float]:
    """Some frames and vertices of both, about the size of 1, and the factor that made them so."""
    frames = np.unique(np.linspace(0, original.n_frames - 1, MOST_FRAMES).astype(int))
    verts = np.unique(np.linspace(0, original.n_verts - 1, MOST_VERTICES).astype(int))
    first, second = (
        np.stack([source.read(int(n), int(n) + 1)[0][verts] for n in frames]).astype(np.float64)
        for source in (original, decoded)
    )
    scale = bounding_box_reference(first).scale
    return first * scale, second * scale, scale
