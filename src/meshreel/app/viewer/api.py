"""The data that the page requests about a file and its original, in addition to the stream."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from meshreel.app.viewer.comparison import Comparison
from meshreel.app.viewer.measuring import Measured, Measuring
from meshreel.app.viewer.page import json_text
from meshreel.app.viewer.played import encoded_anew, played
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.arrays import Floats
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.rendering.track_colors import TrackColors, TrackLook
from meshreel.runtime.progress import Progress, silent

Rows = Mapping[str, str]
"""Names and figures in words, as the command line prints them."""

SMALLEST_DIAGONAL, LARGEST_DIAGONAL = 1e-30, 1e30
"""Range of diagonals that can be drawn: graphics cards use float32."""

JSON = "application/json"

BINARY = "application/octet-stream"

MOST_FRAMES, MOST_POSITIONS = 48, 1 << 23
"""Maximum numbers of frames and positions of the first block searched for extreme positions."""

DIRECTIONS = np.array([d for d in product((-1, 0, 1), repeat=3) if d > (0, 0, 0)], np.float32)
"""13 axes of a cube; the extreme positions along them frame a mesh."""


@dataclass(frozen=True)
class Answer:
    """The answer to a path: its content type, and the bytes."""

    content_type: str
    body: bytes


class Api:
    """Answers the requests of one player; threads may share it.

    Parameters
    ----------
    name : str
        To show, if the stream has none of its own.
    rows_of : callable
        Gives figures of the stream in words.
    comparison : Comparison, optional
        With the original.
    measured_rows : callable, optional
        Gives the errors of all frames in words.
    progress : callable, optional
        Of encoding a stream of another method than `reel` anew.
    look : TrackLook, optional
        The track that colors the mesh initially.

    Attributes
    ----------
    reel : ReelFile
        That which the page plays: see `meshreel.app.viewer.played`.
    method : str
        Of the file.
    measuring : Measuring or None
        Of the errors, where there is an original.
    tracks : TrackComparison or None
        Likewise.

    Raises
    ------
    InvalidInputError
        If the model is too large or too small to be drawn, or there is no such track, or it
        cannot be shown so.
    CorruptStreamError
        If the first block is damaged.
    """

    def __init__(
        self,
        reel: ReelFile,
        name: str,
        rows_of: Callable[[StreamInfo], Rows],
        comparison: Comparison | None = None,
        measured_rows: Callable[[Measured], Rows] = lambda _: {},
        progress: Progress = silent,
        look: TrackLook | None = None,
    ) -> None:
        if look is not None:
            TrackColors(look, reel.track(look.name))  # raises if the track cannot be shown
        self._look = look
        self.tracks = TrackComparison(reel, comparison.original) if comparison else None
        diagonal = reel.frame.scale
        if not SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
            raise InvalidInputError(
                f"the model is {diagonal:.3g} units large; the player draws from "
                f"{SMALLEST_DIAGONAL:g} to {LARGEST_DIAGONAL:g}: scale it before it is encoded"
            )
        self.method = reel.method
        self.reel, self.comparison = played(reel, progress), comparison
        self._name, self._measured_rows = name, measured_rows
        self._rows, self._budget = _figures(reel, rows_of)
        if self.is_reencoded:
            self._rows["shown"] = encoded_anew(self.method)
        self._reach = reach_of(self.reel)
        self.measuring = None if comparison is None else Measuring(comparison)

    @property
    def is_reencoded(self) -> bool:
        """Whether the page plays another stream than the file."""
        return self.method != self.reel.method

    def answer(self, path: str) -> Answer | None:
        """The answer to a path such as "api/facts"; None if there is no such thing.

        Raises
        ------
        MeshReelError, OSError
            If a frame cannot be read.
        """
        if path == "api/facts":
            return _json(self.facts())
        if path == "api/plots" and self.measuring:
            return _json(self.plots())
        found = re.fullmatch(r"api/(original|original_track/([0-9]{1,4}))/([0-9]{1,9})", path)
        if not found or self.comparison is None or int(found[3]) >= self.reel.n_frames:
            return None
        frame = int(found[3])
        if found[2] is None:
            return Answer(BINARY, self.original(frame))
        return self._original_track(int(found[2]), frame)

    def _original_track(self, number: int, frame: int) -> Answer | None:
        """Values of a track of the original, float32 or float64 of shape (N, C)."""
        tracks = self.tracks
        if tracks is None or number >= len(tracks.names):
            return None
        return Answer(BINARY, tracks.given(tracks.names[number], frame).tobytes())

    def facts(self) -> dict[str, Any]:
        """Facts of the file beside those that its stream holds."""
        reach = self._reach
        return {
            "name": self.reel.name or self._name,
            "low": reach.low.tolist(),
            "high": reach.high.tolist(),
            "swept": (reach.swept - np.array(self.reel.frame.origin)).tolist(),
            "up": "y",
            "is_whole": self.reel.is_whole,
            "n_modes": [_n_modes(self.reel, number) for number in range(len(self.reel.starts) - 1)],
            "rows": [list(row) for row in self._rows.items()],
            "budget": [list(row) for row in self._budget.items()],
            "original": self._original(),
            "colored_by": _look_facts(self._look) if self._look else None,
        }

    def plots(self) -> dict[str, Any]:
        """Errors of all frames, once they are measured, and how far that is."""
        assert self.measuring is not None  # asked for only with an original
        measuring = self.measuring
        is_ready, figures = measuring.is_ready, measuring.figures
        rows = self._measured_rows(figures.measured) if is_ready else {}
        return {
            "ready": is_ready,
            "share": measuring.share,
            "error": measuring.error,
            "heats": figures.described_heats(),
            "plots": figures.plots() if is_ready else [],
            "rows": [list(row) for row in rows.items()],
            "worst_frame": figures.worst_frame if is_ready else None,
        }

    def original(self, number: int) -> bytes:
        """Positions of a frame of the original: float32, from the centre of the file."""
        assert self.comparison is not None  # asked for only with an original
        positions = self.comparison.original.frame(number) - np.array(self.reel.frame.origin)
        return bytes(positions.astype("<f4").tobytes())

    def _original(self) -> dict[str, Any] | None:
        if self.comparison is None:
            return None
        errors = self.plots()
        return {
            "name": self.comparison.original.name,
            "diagonal": self.comparison.reference.diagonal,
            "tracks": self.tracks.names if self.tracks else [],
            "track_heats": self.tracks.described() if self.tracks else [],
            **{key: errors[key] for key in ("heats", "plots", "rows", "worst_frame")},
        }


def _figures(
    reel: ReelFile, rows_of: Callable[[StreamInfo], Rows]
) -> tuple[dict[str, str], dict[str, int]]:
    """Figures in words, and bytes by kind of section; of a damaged file what is wrong with it."""
    try:
        info = reel.info()
    except CorruptStreamError as error:
        return {"damaged": str(error)}, {}
    return dict(rows_of(info)), dict(info.budget_bytes)


def _look_facts(look: TrackLook) -> dict[str, str | None]:
    return {
        "track": look.name,
        "component": look.component,
        "range": look.range,
        "colormap": look.colormap,
    }


def _n_modes(reel: ReelFile, number: int) -> int:
    """Modes of a block; none where it is damaged, and cannot be shown."""
    try:
        return reel.n_modes_of(number)
    except CorruptStreamError:
        return 0


def _json(value: Mapping[str, Any]) -> Answer:
    return Answer(JSON, json_text(value).encode())


@dataclass(frozen=True)
class Reach:
    """The region that a camera must show.

    Attributes
    ----------
    low, high : float64 arrays of shape (3,)
        Corners of the bounding box of all frames, in model units.
    swept : float64 array of shape (26, 3)
        Extreme positions of all frames, in model units.
    """

    low: Floats
    high: Floats
    swept: Floats


def reach_of(reel: ReelFile) -> Reach:
    """The region that all frames of a file cover.

    If a file has several blocks, only the first one is decoded: its region is scaled about the
    center of the file to the diagonal of the file, which the stream records. Frames of an encoder
    that did not know all frames may lie outside.

    Raises
    ------
    CorruptStreamError
        If the first block is damaged.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    drawn = np.unique(reel.faces)  # vertices without a face are not seen
    swept = np.zeros((0, 3))
    stop = reel.starts[1]
    n_sought = int(np.clip(MOST_POSITIONS // reel.n_verts, 2, MOST_FRAMES))
    sought = set(np.linspace(0, stop - 1, n_sought).round().astype(int).tolist())
    for start, frames in reel.pieces(range(stop)):
        low = np.minimum(low, frames.min(axis=(0, 1)))
        high = np.maximum(high, frames.max(axis=(0, 1)))
        for number in sought.intersection(range(start, start + len(frames))):
            frame = frames[number - start][drawn].astype(np.float64)
            swept = outermost(np.concatenate([swept, outermost(frame)]))
    if len(reel.starts) == 2:
        return Reach(low, high, swept)
    origin = np.array(reel.frame.origin)
    reach = np.maximum(np.abs(low - origin), np.abs(high - origin))
    length = float(np.linalg.norm(reach))
    factor = max(1.0, reel.frame.scale / 2 / length) if length > 0 else 1.0
    reach *= factor
    return Reach(origin - reach, origin + reach, origin + factor * (swept - origin))


def outermost(points: Floats) -> Floats:
    """Extreme points, of shape (26, 3), along `DIRECTIONS`; may contain duplicates."""
    along = (points - points[0]).astype(np.float32) @ DIRECTIONS.T  # offset, to keep precision
    found: Floats = points[np.concatenate([along.argmin(axis=0), along.argmax(axis=0)])]
    return found
