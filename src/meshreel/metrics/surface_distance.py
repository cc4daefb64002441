"""Distances between animated surfaces whose connectivity differs."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.kernel.closest import TriangleTree
from meshreel.metrics.closest_points import k_d_tree
from meshreel.metrics.normals import DEGENERATE_AREA
from meshreel.metrics.position_errors import PositionErrors
from meshreel.metrics.reference import Reference, reference_of_box, require_equal_frame_counts
from meshreel.metrics.surface_samples import (
    SurfacePoints,
    TriangleSet,
    projected_area,
    sample_on_grid,
    sample_uniformly,
    triangle_set,
)
from meshreel.model.sequence import Faces, Vertices
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import in_threads, n_cores

N_SAMPLES = 50_000
"""Default number of samples per frame and direction."""

GRID_LINES = 1024
"""Lines of V-DMC's grid along the longest side of the bounding box of the original."""

MAX_GRID_POINTS = 4_000_000
"""Maximum expected number of grid points of a frame; beyond it, the grid is coarsened."""

ROUNDING = 1e-12
"""Distances below this fraction of the diagonal are rounding errors and count as 0."""

MAX_POOLED = 1 << 22
"""Maximum number of samples, over all frames, from which a quantile is computed."""

MAX_DISTANCE = 1e100
"""Maximum distance from the original, in diagonals; squares of larger ones may overflow."""


_Frame = tuple[Vertices, Faces]


class SurfaceFrames(Protocol):
    """An animated surface: a repeatable iteration over the positions and faces of its frames."""

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""

    def __iter__(self) -> Iterator[tuple[Vertices, Faces]]:
        """Yield the positions, of shape (V, 3), and faces, of shape (M, 3), of each frame."""


@dataclass(frozen=True)
class SurfaceDistances:
    """Distances from samples of one surface to the closest points of another, over all frames.

    Attributes
    ----------
    mean_percent, rms_percent, p95_percent, max_percent : float
        Mean, root mean square, 95th percentile and maximum, in percent of the diagonal. The
        maximum also includes the vertices.
    normal_angle_mean_deg, normal_angle_p95_deg : float
        Angle in degrees between the face normals at a sample and at its closest point. If that
        lies on an edge, one of the faces of the edge is used.
    """

    mean_percent: float
    rms_percent: float
    p95_percent: float
    max_percent: float
    normal_angle_mean_deg: float
    normal_angle_p95_deg: float


@dataclass(frozen=True, eq=False)
class SurfaceQuality:
    """How far a decoded surface is from its original; their connectivity may differ.

    Samples have equal density on each surface and are the same in every run. The diagonal and the
    longest side are those of the bounding box of the original over all frames, without vertices
    that no face uses. Every PSNR is 10 log10(3 p^2 / mse) in decibels, where p is the longest side
    and mse a mean squared distance, the larger one of both directions. It is averaged over the
    frames that differ, and infinite if none does.

    Attributes
    ----------
    to_decoded : SurfaceDistances
        From samples of the original to the decoded surface.
    to_original : SurfaceDistances
        From samples of the decoded surface to the original.
    psnr_db : float
        Surface PSNR: from the distances of the samples to the other surface.
    d1_psnr_db, d2_psnr_db : float
        PSNR of MPEG's V-DMC: both surfaces are sampled on a grid; distances are those to the
        closest point of the other set (D1), and their components along its normal (D2).
    mean_percent_of_frames, max_percent_of_frames : float64 arrays of shape (T,)
        Mean and maximum distance in each frame, the larger one of both directions.
    n_samples : int
        Samples per frame and direction.
    n_grid_lines : int
        Grid lines along the longest side, from which D1 and D2 are computed: 1024, as V-DMC
        prescribes, or less for surfaces of very large area.
    n_degenerate_face_frames : int
        Excluded faces without area, summed over the frames of both sequences.
    n_frames : int
    diagonal, longest_side : float
        In model units.
    reason : str
        Why surfaces were compared rather than vertices: "the faces differ".
    vertex_errors : PositionErrors or None
        Errors of the vertices, if those of original and decoded correspond nevertheless, as in a
        stream of several segments and its original.

    References
    ----------
    MPEG's software: mpeg-pcc-dmetric 0.14.2, mpeg-pcc-mmetric 1.1.7, and the configuration of
    metrics of the V-DMC test model, ``gridSize`` 1024 and ``resolution`` the longest side.
    """

    to_decoded: SurfaceDistances
    to_original: SurfaceDistances
    psnr_db: float
    d1_psnr_db: float
    d2_psnr_db: float
    mean_percent_of_frames: Floats
    max_percent_of_frames: Floats
    n_samples: int
    n_grid_lines: int
    n_degenerate_face_frames: int
    n_frames: int
    diagonal: float
    longest_side: float
    reason: str
    vertex_errors: PositionErrors | None = None

    @property
    def worse(self) -> SurfaceDistances:
        """The larger error of both directions, for each metric."""
        backward = vars(self.to_original)
        return SurfaceDistances(
            **{name: max(error, backward[name]) for name, error in vars(self.to_decoded).items()}
        )

    def __repr__(self) -> str:
        return (
            f"<SurfaceQuality: mean distance {self.worse.mean_percent:.4g} %, "
            f"largest {self.worse.max_percent:.4g} %, "
            f"surface PSNR {self.psnr_db:.2f} dB, D1 {self.d1_psnr_db:.2f} dB, "
            f"D2 {self.d2_psnr_db:.2f} dB; {counted(self.n_frames, 'frame')}>"
        )

    def as_dict(self) -> dict[str, Any]:
        """All metrics by name in plain Python types; each direction is a nested dict."""
        return {
            **vars(self),
            "vertex_errors": None
            if self.vertex_errors is None
            else vars(self.vertex_errors).copy(),
            "to_decoded": vars(self.to_decoded).copy(),
            "to_original": vars(self.to_original).copy(),
            "mean_percent_of_frames": self.mean_percent_of_frames.tolist(),
            "max_percent_of_frames": self.max_percent_of_frames.tolist(),
        }


def compare_surfaces(
    original: SurfaceFrames,
    decoded: SurfaceFrames,
    *,
    n_samples: int = N_SAMPLES,
    reason: str = "",
    progress: Progress = silent,
) -> SurfaceQuality:
    """Measure the distances between two animated surfaces, frame by frame.

    Parameters
    ----------
    n_samples : int, default 50,000
        Samples per frame and direction.
    reason : str, optional
        Why surfaces are compared rather than vertices; stored in the result.
    progress : callable, optional
        Called as ``progress("comparing", fraction)``.

    Raises
    ------
    InvalidInputError
        If frame counts differ, `n_samples` is not positive, or a frame has no face with an area.
    """
    if n_samples < 1:
        raise InvalidInputError(f"the number of samples must be at least 1; got {n_samples}")
    remark = "only sequences with equal numbers of frames can be compared"
    require_equal_frame_counts(original, decoded, remark)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for vertices, faces in original:
        corners = vertices[faces.ravel()]
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    space = _space_in(low, high, original, decoded)
    n_frames = original.n_frames
    stride = -(-n_frames * n_samples // MAX_POOLED)

    def errors_of(numbered: tuple[int, tuple[_Frame, _Frame]]) -> _FrameErrors:
        number, (frame, frame_hat) = numbered
        triangles = space.triangles(frame, "original", number)
        triangles_hat = space.triangles(frame_hat, "decoded", number)
        subset = slice(number % stride, None, stride)
        return _FrameErrors(
            _one_way(triangles, triangles_hat, space, n_samples, subset),
            _one_way(triangles_hat, triangles, space, n_samples, subset),
            *_grid_errors(triangles, triangles_hat, space),
            triangles.n_degenerate + triangles_hat.n_degenerate,
        )

    pairs = enumerate(zip(original, decoded, strict=True))
    errors: list[_FrameErrors] = []
    while batch := list(islice(pairs, n_cores())):
        errors += in_threads(errors_of, batch)
        progress("comparing", Count(len(errors), n_frames, "frames"))

    percent, peak = 100.0 / space.reference.diagonal_scaled, space.longest
    both = [(error.to_decoded, error.to_original) for error in errors]
    forward, backward = (_pooled(frames, percent) for frames in zip(*both, strict=True))
    return SurfaceQuality(
        to_decoded=forward,
        to_original=backward,
        psnr_db=_psnr_db([max(a.mean_square, b.mean_square) for a, b in both], peak),
        d1_psnr_db=_psnr_db([error.d1 for error in errors], peak),
        d2_psnr_db=_psnr_db([error.d2 for error in errors], peak),
        mean_percent_of_frames=percent * np.array([max(a.mean, b.mean) for a, b in both]),
        max_percent_of_frames=percent * np.array([max(a.largest, b.largest) for a, b in both]),
        n_samples=n_samples,
        n_grid_lines=space.n_lines,
        n_degenerate_face_frames=sum(error.n_degenerate for error in errors),
        n_frames=len(errors),
        diagonal=space.reference.diagonal,
        longest_side=space.longest / space.reference.scale,
        reason=reason,
    )


@dataclass(frozen=True, eq=False)
class _Space:
    """Scaled units in which both sequences are compared, and the grid of D1 and D2."""

    reference: Reference
    low: Floats
    longest: float
    n_lines: int

    @property
    def step(self) -> float:
        return self.longest / (self.n_lines - 1)

    def without_rounding(self, distances: Floats) -> Floats:
        """Return distances with those that are only rounding errors set to 0."""
        return np.where(distances < ROUNDING * self.reference.diagonal_scaled, 0.0, distances)

    @np.errstate(over="ignore", invalid="ignore")
    def triangles(self, frame: _Frame, name: str, number: int) -> TriangleSet:
        """Return the triangles of a frame in scaled units, which must not be empty."""
        vertices, faces = frame
        scaled = self.reference.apply(vertices)
        if not np.all(np.abs(scaled) < MAX_DISTANCE):
            raise InvalidInputError(
                f"frame {number} of the {name} is farther from the original than {MAX_DISTANCE:g} "
                "diagonals; such distances cannot be computed"
            )
        smallest_area = DEGENERATE_AREA * self.reference.diagonal_scaled**2
        triangles = triangle_set(scaled, faces, smallest_area)
        if not len(triangles.areas):
            raise InvalidInputError(
                f"frame {number} of the {name} has no face with an area; "
                "distances between surfaces need at least one"
            )
        return triangles


def _space_in(
    low: Floats, high: Floats, original: Iterable[_Frame], decoded: Iterable[_Frame]
) -> _Space:
    reference = reference_of_box(low, high)
    scaled_low, scaled_high = reference.apply(np.stack([low, high]))
    space = _Space(reference, scaled_low, float((scaled_high - scaled_low).max()), GRID_LINES)
    area = max(
        projected_area(space.triangles(frame, name, number))
        for name, frames in (("original", original), ("decoded", decoded))
        for number, frame in enumerate(frames)
    )
    while space.n_lines > 2 and area > MAX_GRID_POINTS * space.step**2:
        space = replace(space, n_lines=space.n_lines // 2)
    return space


def point_psnr_db(
    frame: _Frame, frame_hat: _Frame, low: Floats, high: Floats
) -> tuple[float, float]:
    """Return D1 and D2 of a frame, as in `compare_surfaces`; infinite for equal surfaces.

    Parameters
    ----------
    frame, frame_hat : tuple of positions of shape (V, 3) and faces of shape (M, 3)
        The original and the decoded surface.
    low, high : float64 arrays of shape (3,)
        Corners of the bounding box of all frames of the original.

    Raises
    ------
    InvalidInputError
        If a surface has no face with an area.
    """
    space = _space_in(low, high, [frame], [frame_hat])
    mean_squares = _grid_errors(
        space.triangles(frame, "original", 0), space.triangles(frame_hat, "decoded", 0), space
    )
    d1, d2 = (_psnr_db([square], space.longest) for square in mean_squares)
    return d1, d2


@dataclass(frozen=True, eq=False)
class _OneWay:
    """Errors of a frame in one direction, in scaled units, with a subset of the samples."""

    mean: float
    mean_square: float
    largest: float
    mean_angle: float
    samples: npt.NDArray[np.float32]
    angles: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _FrameErrors:
    """Errors of a frame in both directions, and its mean squared distances D1 and D2."""

    to_decoded: _OneWay
    to_original: _OneWay
    d1: float
    d2: float
    n_degenerate: int


def _one_way(
    source: TriangleSet, target: TriangleSet, space: _Space, n_samples: int, subset: slice
) -> _OneWay:
    """Return the errors from samples, and vertices, of one surface to another."""
    samples = sample_uniformly(source, n_samples)
    points = np.concatenate([samples.points, source.vertices])
    faces = np.arange(3 * len(target.corners)).reshape(-1, 3)
    closest = TriangleTree(target.corners.reshape(-1, 3), faces).closest(points)
    distances = space.without_rounding(closest.distances)
    angles = _angles_deg(samples.normals, target.normals[closest.faces[:n_samples]])
    sampled = distances[:n_samples]
    return _OneWay(
        float(sampled.mean()),
        float(np.square(sampled).mean()),
        float(distances.max()),
        float(angles.mean()),
        sampled[subset].astype(np.float32),
        angles[subset].astype(np.float32),
    )


def _angles_deg(normals: Floats, others: Floats) -> Floats:
    # atan2 preserves small angles, which an arc cosine would round to 0.
    sines = np.linalg.norm(np.cross(normals, others), axis=1)
    angles: Floats = np.degrees(np.arctan2(sines, np.einsum("na,na->n", normals, others)))
    return angles


def _grid_errors(
    triangles: TriangleSet, triangles_hat: TriangleSet, space: _Space
) -> tuple[float, float]:
    """Return the mean squared distances D1 and D2, each the larger one of both directions."""
    sets = [
        sample_on_grid(surface, space.low, space.step) for surface in (triangles, triangles_hat)
    ]
    trees = [k_d_tree(surface.points, balanced_tree=False) for surface in sets]
    forward = _point_errors(sets[0], sets[1], trees[1], space)
    backward = _point_errors(sets[1], sets[0], trees[0], space)
    return max(forward[0], backward[0]), max(forward[1], backward[1])


def _point_errors(
    source: SurfacePoints, target: SurfacePoints, tree: Any, space: _Space
) -> tuple[float, float]:
    """Return the mean squared distance to the closest points, and that along their normals."""
    distances, closest = tree.query(source.points)
    offsets = source.points - target.points[closest]
    heights = np.abs(np.einsum("na,na->n", offsets, target.normals[closest]))
    d1, d2 = (np.square(space.without_rounding(lengths)).mean() for lengths in (distances, heights))
    return float(d1), float(d2)


def _pooled(frames: Sequence[_OneWay], percent: float) -> SurfaceDistances:
    """Return the errors of all frames in one direction."""
    return SurfaceDistances(
        percent * float(np.mean([frame.mean for frame in frames])),
        percent * float(np.sqrt(np.mean([frame.mean_square for frame in frames]))),
        percent * float(np.percentile(np.concatenate([frame.samples for frame in frames]), 95)),
        percent * max(frame.largest for frame in frames),
        float(np.mean([frame.mean_angle for frame in frames])),
        float(np.percentile(np.concatenate([frame.angles for frame in frames]), 95)),
    )


def _psnr_db(mean_squares: Sequence[float], peak: float) -> float:
    """Return the mean PSNR of the frames that differ; infinite if none does."""
    differing = np.array([square for square in mean_squares if square > 0])
    if not len(differing):
        return float("inf")
    return float(np.mean(10.0 * np.log10(3.0 * peak**2 / differing)))
