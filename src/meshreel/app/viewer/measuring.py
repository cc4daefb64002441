"""Errors of all frames by vertex, measured in a separate thread while the page plays."""

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.app.viewer.original import Original
from meshreel.arrays import Floats
from meshreel.codec.reel_file import ReelFile
from meshreel.metrics.heat import HEATS, heat_field
from meshreel.metrics.nmsve import FrameNmsve
from meshreel.metrics.position_errors import ErrorSums, PositionErrors
from meshreel.metrics.reference import Reference, paired_frames, reference_of_extent
from meshreel.model.geometry.connectivity import isolated_vertices
from meshreel.model.sequence import Faces, Vertices
from meshreel.runtime.progress import Progress, silent

Heats = dict[str, Floats]
"""Values of every kind of heat map at every vertex of a frame, each of shape (V,)."""

PAGE_HEATS = ("distance", "angle")
"""Heat maps that the page can compute."""

PERCENTILE = 99.5
"""Percentile of the values of all frames at which the fixed color range ends."""

SHARES = (np.arange(200) + 0.5) / 200
"""Quantiles that represent the values of a frame."""


class Comparison:
    """Compares a file with its original, frame by frame.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    """

    def __init__(self, reel: ReelFile, original: Original) -> None:
        self.reel: ReelFile = reel
        self.original: Original = original
        self.faces: Faces = reel.faces
        self.reference: Reference = reference_of_extent(original.extent)
        diagonal = self.reference.diagonal
        self._fields = {
            kind: heat_field(kind, self.faces, reel.n_verts, diagonal) for kind in HEATS
        }

    def pair(self, number: int) -> tuple[Vertices, Vertices]:
        """Original and decoded positions of a frame, of shape (V, 3), in model units."""
        return self.original.frame(number), self.reel[number].vertices

    def heat(self, kind: str, pair: tuple[Vertices, Vertices]) -> Floats:
        """Values of one kind of heat map of a frame, of shape (V,); undefined values become 0."""
        return np.nan_to_num(self._fields[kind](*pair), posinf=0.0)

    def heats(self, pair: tuple[Vertices, Vertices]) -> Heats:
        """Values of every kind of heat map of a frame."""
        return {kind: self.heat(kind, pair) for kind in HEATS}


@dataclass(frozen=True)
class MeasuredErrors:
    """Errors of all frames."""

    errors: PositionErrors
    nmsve_mean: float
    sted_spatial: float
    """The spatial part of STED, close to STED; the temporal part would need all frames at once."""


class Figures:
    """Errors and heat map ranges of the frames so far.

    Attributes
    ----------
    nmsve, largest_percent : list of float
        Errors of each frame.
    """

    def __init__(self, comparison: Comparison) -> None:
        original, reel = comparison.original, comparison.reel
        self._reference = comparison.reference
        self._nmsve_of = FrameNmsve(original.frame(0), comparison.faces, self._reference).of
        self._errors = ErrorSums(self._reference)
        self._n_touched = reel.n_verts - len(isolated_vertices(comparison.faces, reel.n_verts))
        self._deviations: list[float] = []
        self._largest: dict[str, float] = {}
        self._quantiles: dict[str, list[Floats]] = {}
        self.nmsve: list[float] = []
        self.largest_percent: list[float] = []

    def add(self, pair: tuple[Vertices, Vertices], heats: Heats) -> None:
        """Add the next frame: original and decoded positions, and heat maps."""
        self.widen_ranges(heats)
        original, decoded = (positions[np.newaxis] for positions in pair)
        ((frame, displacement),) = paired_frames(original, decoded, self._reference)
        self._errors.add(original, decoded)
        self._deviations.append(float(heats["sted"].sum()) / max(1, self._n_touched))
        self.nmsve.append(self._nmsve_of(frame, displacement))
        self.largest_percent.append(float(heats["distance"].max()))

    def widen_ranges(self, heats: Heats) -> None:
        """Widen the ranges of heat maps to those of a frame."""
        for kind, values in heats.items():
            self._largest[kind] = max(self._largest.get(kind, 0.0), float(values.max()))
            self._quantiles.setdefault(kind, []).append(np.quantile(values, SHARES))

    @property
    def measured(self) -> MeasuredErrors:
        """The errors of the frames so far; needs at least one frame."""
        nmsve, sted = float(np.mean(self.nmsve)), float(np.mean(self._deviations))
        return MeasuredErrors(self._errors.errors, nmsve, sted)

    @property
    def worst_frame(self) -> int:
        """The frame with the largest error so far."""
        return int(np.argmax(self.largest_percent))

    def heat_maps(self) -> list[dict[str, Any]]:
        """Heat maps of the page and their ranges."""
        return [
            {
                "kind": kind,
                "label": HEATS[kind].label,
                "unit": HEATS[kind].unit,
                "maximum": largest,
                "range": float(np.percentile(self._quantiles[kind], PERCENTILE)),
            }
            for kind, largest in self._largest.items()
            if kind in PAGE_HEATS
        ]

    def plots(self) -> list[dict[str, Any]]:
        """Errors of each frame, for the page."""
        return [
            {"label": "largest error, % of the diagonal", "values": self.largest_percent},
            {"label": "visual error (NMSVE)", "values": self.nmsve},
        ]


class Measuring:
    """Measures all frames in a separate thread.

    Attributes
    ----------
    figures : Figures
        Ranges of the first frame, until the ranges and errors of all frames are measured.
    error : str
        Why measuring failed; empty without an error.
    share : float
        Share of the frames that are measured.
    """

    def __init__(self, comparison: Comparison) -> None:
        self.figures: Figures = Figures(comparison)
        self.figures.widen_ranges(comparison.heats(comparison.pair(0)))
        self.error: str = ""
        self.share: float = 0.0
        self._comparison = comparison
        self._is_closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="meshreel-measuring", daemon=True)

    @property
    def is_ready(self) -> bool:
        """Whether all frames are measured."""
        return self.share == 1.0

    def start(self) -> None:
        """Start; `figures` is replaced when all frames are measured."""
        self._thread.start()

    def close(self) -> None:
        """Stop after the current frame."""
        self._is_closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def run(self, progress: Progress = silent) -> None:
        """Measure all frames in the calling thread.

        Raises
        ------
        MeshReelError, OSError
            If a frame cannot be decoded or read.
        """
        comparison, figures = self._comparison, Figures(self._comparison)
        n_frames = comparison.reel.n_frames
        for number in range(n_frames):
            if self._is_closed.is_set():
                return
            pair = comparison.pair(number)
            figures.add(pair, comparison.heats(pair))
            if number + 1 == n_frames:
                self.figures = figures
            self.share = (number + 1) / n_frames
            progress("measuring", self.share)

    def _run(self) -> None:
        try:
            self.run()
        except Exception as error:  # the thread has no caller: the page shows the error
            self.error = str(error) or type(error).__name__
