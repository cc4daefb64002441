"""A simulated cloth flag in gusty wind: the demo sequence, which needs no file.

Position-based dynamics in small substeps (Macklin et al. 2019, "Small Steps in Physics
Simulation"), with tethers to the pole that limit stretch (Kim et al. 2012, "Long Range
Attachments") and bending after Bergou et al. 2006. Arrays are (3, rows, columns): x, y, z.
"""

from collections.abc import Iterator

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.sequence import Faces, MeshSequence
from meshreel.runtime.progress import Count, Progress, silent

Links = tuple[tuple[slice, ...], tuple[slice, ...], float]

_WIDTH_M, _HEIGHT_M = 1.5, 1.0
_GRAVITY_M_PER_S2, _TOP_SPEED_M_PER_S = 9.81, 15.0
_WIND_M_PER_S, _TURBULENCE = 3.0, 0.3
_FRONT_DRAG_PER_M, _SKIN_DRAG_PER_M = 24.0, 2.0  # light silk, 30 g per square meter
_BENDING_M4_PER_S2, _DAMPING_PER_S = 7e-4, 70.0
_SUBSTEP_S, _SUBSTEPS_PER_WIND = 1 / 900, 6
_TARGET_STRETCH, _MAX_PASSES = 1.06, 30


def simulate_flag(
    n_frames: int = 300,
    *,
    n_rows: int = 52,
    n_columns: int = 52,
    fps: float = 30.0,
    progress: Progress = silent,
) -> MeshSequence:
    """Simulate a flag of 1.5 m by 1 m that flutters at its pole; deterministic.

    Parameters
    ----------
    n_frames : int
        At least 1. A longer sequence begins with the frames of a shorter one.
    n_rows, n_columns : int
        Vertices along the pole and away from it, at least 3; ordered by row from the top.
    fps : float
        Frames per second, 1..1000.
    progress : callable
        Called with ``("simulating", fraction)`` after each frame.

    Returns
    -------
    MeshSequence named "flag", float32 positions in meters; y is up, the pole at x = 0
        The motion is chaotic: machines that round differently produce different motion.

    Raises
    ------
    InvalidInputError
        If an argument is out of its range.
    """
    counts = {"n_frames": (n_frames, 1), "n_rows": (n_rows, 3), "n_columns": (n_columns, 3)}
    for name, (value, least) in counts.items():
        if not isinstance(value, int | np.integer) or value < least:
            raise InvalidInputError(
                Keyword(name), f" must be an integer, at least {least}; got {value!r}"
            )
    if not 1 <= fps <= 1000:
        raise InvalidInputError(f"fps must be in 1..1000; got {fps}")
    n_substeps = int(np.ceil(max(n_rows, n_columns, 52) / 52 / (fps * _SUBSTEP_S)))
    cloth = _Cloth(n_rows, n_columns, substep_s=1 / (fps * n_substeps))
    frames = np.empty((n_frames, n_rows, n_columns, 3), np.float32)
    for frame in range(n_frames):
        frames[frame] = np.moveaxis(cloth.positions, 0, -1)
        for substep in range(n_substeps):
            cloth.advance(frame * n_substeps + substep)
        progress("simulating", Count(frame + 1, n_frames, "frames"))
    return MeshSequence(frames.reshape(n_frames, -1, 3), _faces(n_rows, n_columns), fps, "flag")


def _faces(n_rows: int, n_columns: int) -> Faces:
    """Two triangles per cell, facing +z at rest, split from the upper left to the lower right."""
    row, column = np.indices((n_rows - 1, n_columns - 1)).reshape(2, -1)
    a, b, c, d = (row * n_columns + column + k for k in (0, n_columns, n_columns + 1, 1))
    return np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3).astype(np.int32)


class _Cloth:
    """The state of the cloth, advanced in substeps."""

    def __init__(self, n_rows: int, n_columns: int, substep_s: float) -> None:
        self.substep_s = substep_s
        self.steps_m = (_HEIGHT_M / (n_rows - 1), _WIDTH_M / (n_columns - 1))
        below, x = np.indices((n_rows, n_columns)) * np.array(self.steps_m)[:, None, None]
        self.positions = np.stack([x, _HEIGHT_M - below, 0.04 * x * np.sin(3 * x - 2 * below)])
        self.velocities, self.acceleration = np.zeros((2, *self.positions.shape))
        self.pole = self.positions[:, :, :1].copy()
        self.tethers = ((self.pole, x), (self.pole[:, :1], np.hypot(x, below)))
        self.links = list(_disjoint_links((n_rows, n_columns), self.steps_m))
        self.gusts = _Gusts(x[:-1, :-1], below[:-1, :-1])

    def advance(self, n_done: int) -> None:
        """Advance by one substep; `n_done` substeps precede it."""
        if n_done % _SUBSTEPS_PER_WIND == 0:
            self._accelerate(self.gusts.wind(n_done * self.substep_s))
        self.velocities += self.substep_s * self.acceleration
        self._bend_and_damp()
        np.clip(self.velocities, -_TOP_SPEED_M_PER_S, _TOP_SPEED_M_PER_S, out=self.velocities)
        old, self.positions = self.positions, self.positions + self.substep_s * self.velocities
        for _ in range(_MAX_PASSES):
            if self._satisfy_constraints() < _TARGET_STRETCH:
                break
        self.velocities = (self.positions - old) / self.substep_s

    def _accelerate(self, wind: Floats) -> None:
        """Set the acceleration by gravity and drag; drag of a cell is split among its corners."""
        x, v = self.positions, self.velocities
        normal = np.cross(x[:, 1:, 1:] - x[:, :-1, :-1], x[:, :-1, 1:] - x[:, 1:, :-1], axis=0)
        normal /= np.linalg.norm(normal, axis=0) + 1e-12
        slip = wind - 0.25 * (v[:, 1:, 1:] + v[:, :-1, 1:] + v[:, 1:, :-1] + v[:, :-1, :-1])
        across = (slip * normal).sum(axis=0)
        front = _FRONT_DRAG_PER_M * np.abs(across)
        skin = _SKIN_DRAG_PER_M * np.linalg.norm(slip, axis=0)
        # Divided as in an implicit time step, so that no gust overshoots.
        damping = 1 + (front + skin) * _SUBSTEPS_PER_WIND * self.substep_s
        share = 0.25 * (front * across * normal + skin * slip) / damping
        self.acceleration[:] = np.array([0, -_GRAVITY_M_PER_S2, 0])[:, None, None]
        for rows in (slice(1, None), slice(-1)):
            self.acceleration[:, rows, 1:] += share
            self.acceleration[:, rows, :-1] += share

    def _bend_and_damp(self) -> None:
        """Apply bending, linear because the rest shape is flat, and friction between neighbors."""
        for axis, step_m in zip((1, 2), self.steps_m, strict=True):
            x, v = np.moveaxis(self.positions, axis, 0), np.moveaxis(self.velocities, axis, 0)
            # Both are bounded so that the explicit time step is stable on the finest grid.
            stiffness = min(_BENDING_M4_PER_S2 / step_m**4, 0.1 / self.substep_s**2)
            bend = self.substep_s * stiffness * (x[2:] - 2 * x[1:-1] + x[:-2])
            v[1:-1] += 2 * bend
            v[2:] -= bend
            v[:-2] -= bend
            drag = min(_DAMPING_PER_S * self.substep_s, 0.1) * (v[1:] - v[:-1])
            v[:-1] += drag
            v[1:] -= drag

    def _satisfy_constraints(self) -> float:
        """Make one pass over links and tethers; return the largest stretch before it."""
        max_stretch = 0.0
        self.positions[:, :, :1] = self.pole
        for start, end, rest_m in self.links:
            left, right = self.positions[start], self.positions[end]
            span = right - left
            length = np.linalg.norm(span, axis=0) + 1e-12
            max_stretch = max(max_stretch, float(length.max()) / rest_m)
            span *= 0.5 - 0.5 * rest_m / length
            left += span
            right -= span
            self.positions[:, :, :1] = self.pole
        for anchor, reach_m in self.tethers:
            span = self.positions - anchor
            share = np.minimum(reach_m / (np.linalg.norm(span, axis=0) + 1e-12), 1)
            self.positions = anchor + share * span
        self.positions[:, :, :1] = self.pole
        return max_stretch


def _disjoint_links(shape: tuple[int, int], steps_m: tuple[float, float]) -> Iterator[Links]:
    """Ends and rest lengths of sets of parallel links, disjoint within a set."""
    every, left, right = slice(None), slice(-1), slice(1, None)
    down, across = ([(slice(k, n - 1, 2), slice(k + 1, n, 2)) for k in (0, 1)] for n in shape)
    for start, end in across:
        yield (every, every, start), (every, every, end), steps_m[1]
    for start, end in down:
        yield (every, start, right), (every, end, right), steps_m[0]
    for first, second in ((left, right), (right, left)):
        for start, end in down:
            yield (every, start, first), (every, end, second), float(np.hypot(*steps_m))


class _Gusts:
    """Wind with waves of several lengths that travel along the flag."""

    def __init__(self, x: Floats, below: Floats) -> None:
        length_m = np.geomspace(0.35, 2.0, 10)
        # Multiples of irrational roots are evenly spread, and the waves never synchronize.
        phase, tilt, pace, *gains = np.arange(1, 11) * np.sqrt([[2], [3], [5], [7], [11], [13]]) % 1
        per_m = 2 * np.pi / length_m
        angle = 2 * np.pi * phase + per_m * (x[..., None] + 1.4 * (0.5 - tilt) * below[..., None])
        self.waves = np.concatenate([np.sin(angle), np.cos(angle)], axis=2)
        self.pulse_per_s = per_m * _WIND_M_PER_S * (0.75 + 0.25 * pace)
        strength = 0.6 * np.sign(np.array(gains) - 0.5) + 0.8 * (np.array(gains) - 0.5)
        self.speeds = np.array([[0.3], [0.12], [1.0]]) * strength * np.sqrt(0.1 * length_m)

    def wind(self, time_s: float) -> Floats:
        """Velocities in m/s, of shape (3, rows - 1, columns - 1)."""
        angle = self.pulse_per_s * time_s
        gains = np.concatenate([self.speeds * np.cos(angle), -self.speeds * np.sin(angle)], axis=1)
        veer = 0.13 * np.sin(0.7 * time_s + 0.5) + 0.08 * np.sin(1.7 * time_s)
        speed = 1 + 0.25 * np.sin(0.9 * time_s) + 0.15 * np.sin(2.3 * time_s + 1)
        speed *= _WIND_M_PER_S * (1 - 0.5 * np.exp(-2 * time_s))
        # Not a matrix product: its rounding may depend on the number of threads.
        turbulence = _TURBULENCE * np.einsum("cw,ijw->cij", gains, self.waves)
        return np.asarray(speed * (np.array([1, 0, veer])[:, None, None] + turbulence))
