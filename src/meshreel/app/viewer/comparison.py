"""Comparison of a file with its original, by vertex and frame."""

import numpy as np

from meshreel.app.viewer.original import Original
from meshreel.arrays import Floats
from meshreel.codec.reel_file import ReelFile
from meshreel.metrics.heat import HEATS, heat_field
from meshreel.metrics.reference import reference_of_box
from meshreel.model.sequence import Vertices

Heats = dict[str, Floats]
"""Values of every kind of heat map at every vertex of a frame, each of shape (V,)."""


class Comparison:
    """Compares a file with its original, frame by frame.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    """

    def __init__(self, reel: ReelFile, original: Original) -> None:
        self.reel, self.original = reel, original
        self.faces = reel.faces
        self.reference = reference_of_box(original.extent.low, original.extent.high)
        diagonal = self.reference.diagonal
        self._fields = {
            kind: heat_field(kind, self.faces, reel.n_verts, diagonal) for kind in HEATS
        }

    def pair(self, number: int) -> tuple[Vertices, Vertices]:
        """Original and decoded positions of a frame, of shape (V, 3), in model units."""
        return self.original.frame(number), self.reel[number]

    def heat(self, kind: str, pair: tuple[Vertices, Vertices]) -> Floats:
        """Values of one kind of heat map of a frame, of shape (V,); undefined values become 0."""
        return np.nan_to_num(self._fields[kind](*pair), posinf=0.0)

    def heats(self, pair: tuple[Vertices, Vertices]) -> Heats:
        """Values of every kind of heat map of a frame."""
        return {kind: self.heat(kind, pair) for kind in HEATS}
