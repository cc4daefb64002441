"""Long sequences built from short performances: looped, mixed, rotated and paused.

Frames are generated when they are read, so memory does not depend on the length.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from meshreel.model.extent import Extent, bounding_boxes, extent_of_boxes
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.timing import Timing
from meshreel.model.tracks import TrackSource

Floats = npt.NDArray[np.float64]
Vertices = npt.NDArray[np.floating]

CHUNK_FRAMES = 64
"""Frames generated at a time."""

KINDS = {
    "loops": ("loop",),
    "mixed": ("loop", "mix", "turn", "mix", "slow", "hold"),
    "held": ("hold", "slow", "hold", "loop"),
}
"""Scene types of each kind of sequence, chosen at random."""


@dataclass(frozen=True)
class Scenes:
    """Content of each frame.

    Attributes
    ----------
    lower, upper : float array of shape (T,)
        Frame of the performance for the lower and the upper half of the body.
    turn : float array of shape (T,)
        Angle around the vertical axis, in radians.
    starts : list of int
        First frame of each scene.
    """

    lower: Floats
    upper: Floats
    turn: Floats
    starts: list[int]


def scenes_of(kinds: Iterable[str], n_frames: int, n_base: int, seed: int) -> Scenes:
    """Random scenes of 60 to 800 frames."""
    rng, names = np.random.default_rng(seed), list(kinds)
    lower, upper, turn = (np.zeros(n_frames) for _ in range(3))
    starts, start, angle = [], 0, 0.0
    while start < n_frames:
        kind = names[int(rng.integers(len(names)))]
        length = min(int(60 * (800 / 60) ** rng.random()), n_frames - start)
        part = slice(start, start + length)
        starts.append(start)
        lower[part] = upper[part] = there_and_back(
            _speeds(kind, length, rng), n_base, rng, is_short=kind != "loop"
        )
        if kind == "mix":
            upper[part] = there_and_back(_speeds(kind, length, rng), n_base, rng, is_short=True)
        if kind == "turn":
            turn[part] = angle + np.cumsum(0.03 * _wavy(length, rng))
            angle = float(turn[start + length - 1])
        else:
            turn[part] = angle
        start += length
    return Scenes(lower, upper, turn, starts)


def _speeds(kind: str, length: int, rng: np.random.Generator) -> Floats:
    """Playback speed of each frame: 0.5 to 1.5, a tenth of that, or 0."""
    factor = {"hold": 0.0, "slow": 0.1}.get(kind, 1.0)
    return factor * (1.0 + 0.5 * _wavy(length, rng))


def _wavy(length: int, rng: np.random.Generator) -> Floats:
    """A smooth curve in -1..1."""
    times, phases = np.arange(length), rng.random(2) * 2 * np.pi
    return np.asarray(np.sin(times / 37.0 + phases[0]) * np.cos(times / 101.0 + phases[1]))


def there_and_back(
    speeds: Floats, n_base: int, rng: np.random.Generator, *, is_short: bool
) -> Floats:
    """Frames of the performance, or of a random third of it, forwards and backwards."""
    length = (n_base - 1) / 3.0 if is_short else n_base - 1.0
    first = rng.random() * (n_base - 1.0 - length)
    phase = (rng.random() * 2 * length + np.cumsum(speeds)) % (2 * length)
    return np.asarray(first + np.minimum(phase, 2 * length - phase))


class LongSequence:
    """A `FrameSource` of frames that are generated when they are read.

    Parameters
    ----------
    base : MeshSequence
        The performance.
    kind : str
        One of `KINDS`.
    n_frames : int
    seed : int, default 1
    """

    def __init__(
        self, base: meshreel.MeshSequence, kind: str, n_frames: int, seed: int = 1
    ) -> None:
        self.n_frames, self.n_verts, self.faces = n_frames, base.n_verts, base.faces
        self.timing, self.dtype = Timing(base.fps or 25.0), np.dtype(np.float32)
        self.name = f"{base.name}, {kind}"
        self.surface: Surface = PLAIN
        self.tracks: Mapping[str, TrackSource] = {}
        self.scenes = scenes_of(KINDS[kind], n_frames, base.n_frames, seed)
        vertices = base.vertices.astype(np.float32)
        self._centers = vertices.mean(axis=1, keepdims=True)
        self._shapes = vertices - self._centers
        mean = self._shapes.mean(axis=0)
        self._up = int(np.argmax(np.ptp(mean, axis=0)))
        height = (mean[:, self._up] - mean[:, self._up].min()) / np.ptp(mean[:, self._up])
        self._is_upper = (1.0 / (1.0 + np.exp(-20.0 * (height - 0.5)))).astype(np.float32)[:, None]

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3)."""
        out = np.empty((stop - start, self.n_verts, 3), np.float32)
        for number in range(start, stop):
            self._fill(out[number - start], number)
        return out

    def _fill(self, out: Vertices, number: int) -> None:
        scenes = self.scenes
        center, shape = (
            _between(frames, scenes.lower[number]) for frames in (self._centers, self._shapes)
        )
        if scenes.upper[number] != scenes.lower[number]:
            shape += self._is_upper * (_between(self._shapes, scenes.upper[number]) - shape)
        shape += center
        angle = scenes.turn[number]
        first, second = (axis for axis in range(3) if axis != self._up)
        cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        out[:, self._up] = shape[:, self._up]
        out[:, first] = cosine * shape[:, first] - sine * shape[:, second]
        out[:, second] = sine * shape[:, first] + cosine * shape[:, second]

    @cached_property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""
        boxes = [
            bounding_boxes(self.read(start, min(start + CHUNK_FRAMES, self.n_frames)))
            for start in range(0, self.n_frames, CHUNK_FRAMES)
        ]
        low, high = (np.concatenate(corners) for corners in zip(*boxes, strict=True))
        return extent_of_boxes(low, high)


def _between(frames: Vertices, number: float) -> Any:
    """Interpolate linearly between two frames."""
    first = min(int(number), len(frames) - 2)
    share = np.float32(number - first)
    return (np.float32(1.0) - share) * frames[first] + share * frames[first + 1]
