"""Fitting of rigs to animations: bones, then correctives, until bounds are met."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from meshreel.arrays import Bytes, Floats, Integers
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.error_bounds import bound_of as error_bound_of
from meshreel.errors import ConnectivityChangeError, InvalidInputError, Keyword
from meshreel.metrics.normals import normal_angles
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.geometry.connectivity import component_labels
from meshreel.model.rig import FULL, Correctives, Rig, RigErrors, Skeleton
from meshreel.model.rig_bounds import (
    DEFAULT_BOUNDS,
    DEFAULT_KG_PERCENT,
    DEFAULT_LARGEST_PERCENT,
    MAX_BONES,
    Bounds,
)
from meshreel.model.rig_keys import SHORT
from meshreel.model.sequence import Faces, MeshSequence, Vertices
from meshreel.rigging.correctives import MAX_TARGETS, CorrectiveSearch
from meshreel.rigging.decomposition import Decomposition, Skin
from meshreel.rigging.skeleton import (
    MAX_BITS,
    MIN_BITS,
    Steps,
    build_skeleton,
    fit_tracks,
    round_to,
)
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.threads import one_blas_thread

MIN_GROWTH, MAX_GROWTH = 0.05, 0.5
"""Share of the bones that are added at a time: about that by which the KG error is too large."""

AIM_SHARE = 0.8
"""Share of the bound of the largest error above which vertices count more."""

NEAR_KG, NEAR_LARGEST = 1.3, 2.0
"""Errors, in multiples of the bounds, from which further rounds may still meet them."""

GROWING_ROUNDS, FINAL_ROUNDS = 3, 10
N_RIGID_BONES = 8
"""Number of bones from which the rest pose is fitted; fewer would distort it."""

MIN_GAIN, MAX_STALLED, ENOUGH = 0.2, 3, 0.6
"""More bones are of no use if the logarithm of the KG error falls by less than this share of the
growth of the number of bones, this many times in a row; or if the KG error is this share of its
bound while the largest error is not met."""

FIT_KG, FIT_LARGEST = 0.95, 0.985
"""Shares of the bounds for the skin before quantization."""

ROUNDING_SHARE, MAX_ROUNDING = 0.45, 1e-3
"""Root mean squared rounding error of rotations, translations and positions each: as share of the
remaining error, and relative to the deviation of the vertices from the centroid of a frame, so that
resting vertices do not tremble."""

PRUNING = 1.0
"""Error that removing an influence may add, in rounding errors."""

KEY_TOLERANCE = 2.0
"""Largest error from removed keys, in rounding errors."""

MIN_LEVELS = 2047
"""Minimum number of positive quantization levels of coordinates in the rest pose."""

CORRECTIVE_ROUNDS = 4
"""Rounds with the same number of correctives."""

CORRECTIVE_ROUNDING = 0.1
"""Rounding error of each corrective, as share of the root mean squared error that is allowed."""

MAX_ATTEMPTS = 5
"""Quantizations, each twice as fine."""

N_SAMPLED, MAX_SAMPLED_FRAMES, MIN_SAMPLES_PER_BONE = 800, 40, 8
"""Vertices and frames of a sample, and how many of the vertices a bone moves at least."""


def bounds_of(
    sequence: MeshSequence,
    *,
    quality: float | None,
    kg: float | None,
    max_error: float | str | None,
    unit: str | None = None,
) -> Bounds:
    """Return the given bounds, or those of a quality: the position errors of a .reel.

    Parameters
    ----------
    quality : float, optional
        Quality of the .reel, 1 to 100; excludes the bounds.
    kg : float, optional
        As of `Bounds`, with its default.
    max_error : float or str, optional
        Largest error, as of `meshreel.rig`.
    unit : str, optional
        Length unit of the model.

    Raises
    ------
    ConnectivityChangeError
        If the faces change.
    InvalidInputError
        If a value is out of range, or a quality and a bound are given.
    """
    if quality is None:
        diagonal = float(np.linalg.norm(sequence.extent.high - sequence.extent.low)) or 1.0
        largest = (
            DEFAULT_LARGEST_PERCENT
            if max_error is None
            else error_bound_of(max_error, unit).percent(diagonal)
        )
        return Bounds(DEFAULT_KG_PERCENT if kg is None else kg, largest)
    for name, bound in (("kg", kg), ("max_error", max_error)):
        if bound is not None:
            raise InvalidInputError(
                Keyword("quality"), " of a rig sets its error bounds; omit it, or ", Keyword(name)
            )
    _check_faces(sequence)
    without_tracks = sequence.replace(tracks={})
    stream = encode(without_tracks, quality=quality, order="keep", attributes="none")
    errors = position_errors(sequence.vertices, decode(stream).vertices)
    return Bounds(max(errors.kg_error_percent, 1e-6), max(errors.max_error_percent, 1e-6))


def _check_faces(sequence: MeshSequence) -> None:
    if len(sequence.segments) > 1:
        raise ConnectivityChangeError(
            "a rig needs the same faces in all frames; they change between the "
            f"{len(sequence.segments)} segments of this sequence; register it first (meshreel "
            "register)"
        )


def fit_sequence(
    sequence: MeshSequence,
    times_s: Floats | None = None,
    *,
    bones: int | None = None,
    bounds: Bounds = DEFAULT_BOUNDS,
    progress: Progress = silent,
) -> Rig:
    """Return a rig with few bones, and correctives where these do not suffice.

    Parameters
    ----------
    times_s : float64 array of shape (T,), optional
        Times of the keys; by default those of the sequence, or frame numbers if it has none.
    bones : int, optional
        Maximum number of bones, up to 256, which is the default.

    Raises
    ------
    ConnectivityChangeError
        If the faces change.
    InvalidInputError
        If the bounds cannot be met, naming what was reached; or if an argument is out of range.
    """
    _check_faces(sequence)
    if times_s is None:
        times_s = sequence.timing.seconds(sequence.n_frames)
    if times_s is None:
        times_s = np.arange(sequence.n_frames, dtype=np.float64)
    max_bones = MAX_BONES if bones is None else bones
    if not 1 <= max_bones <= MAX_BONES:
        raise InvalidInputError(Keyword("rig"), f" takes 1 to {MAX_BONES} bones; got {max_bones}")
    search = _Search(sequence.vertices, sequence.faces, times_s, bounds, progress)
    with one_blas_thread():  # its idle threads would spin after each of many products
        rig = search.run(max_bones)
    errors = rig.errors
    if bounds.excess(errors.kg_percent, errors.largest_percent) > 1:
        more_bones = f" or up to {MAX_BONES} bones" if max_bones < MAX_BONES else ""
        raise InvalidInputError(
            f"{counted(rig.n_bones, 'bone')} and {counted(rig.n_targets, 'corrective target')} "
            f"reach a KG error of {errors.kg_percent:.3g} % and a largest error of "
            f"{errors.largest_percent:.3g} % of the diagonal; {bounds.kg:g} % and "
            f"{bounds.largest:g} % are allowed; allow larger errors (",
            Keyword("max_error"),
            ", ",
            Keyword("kg"),
            f"){more_bones}, or write morph targets (omit ",
            Keyword("rig"),
            ")",
        )
    progress("rigging", 1.0)
    return rig


def suffices_for_sample(sequence: MeshSequence, bounds: Bounds, max_bones: int) -> bool:
    """Return whether bones alone move a sample of the vertices within the bounds.

    A fraction of the work of `fit_sequence`, which usually fails if this is false: cloth, fluids,
    and bounds below the noise of a capture need more bones than a file can pay for.
    """
    n_verts = sequence.n_verts
    sample = np.unique(np.linspace(0, n_verts - 1, min(n_verts, N_SAMPLED)).astype(np.int64))
    frames = np.unique(np.linspace(0, sequence.n_frames - 1, MAX_SAMPLED_FRAMES).astype(np.int64))
    vertices = sequence.vertices[frames][:, sample]
    components = component_labels(sequence.faces, n_verts)[sample]
    times_s = frames.astype(np.float64)
    search = _Search(vertices, sequence.faces, times_s, bounds, silent, components)
    with one_blas_thread():
        n_bones = min(max_bones, -(-len(sample) // MIN_SAMPLES_PER_BONE))
        return any(True for _ in search.grow(n_bones))


class _Search:
    """The search for a rig within bounds; works in units of about the size of the box."""

    def __init__(
        self,
        vertices: Vertices,
        faces: Faces,
        times_s: Floats,
        bounds: Bounds,
        progress: Progress,
        components: Integers | None = None,
    ) -> None:
        self._vertices, self._faces, self._times_s = vertices, faces, times_s
        self._bounds, self._progress = bounds, progress
        reference = bounding_box_reference(vertices)
        # Files store the origin in float32.
        self._origin = reference.center.astype(np.float32).astype(np.float64)
        self._unit = 1 / reference.scale
        n_frames, n_verts = vertices.shape[:2]
        scaled = (vertices - self._origin) * reference.scale
        self._frames = np.ascontiguousarray(scaled.transpose(0, 2, 1)).reshape(-1, n_verts)
        spread = np.square(scaled - scaled.mean(axis=1, keepdims=True)).sum()
        self._deviation = math.sqrt(spread / (n_frames * n_verts))
        self._diagonal = reference.diagonal_scaled
        labels = component_labels(faces, n_verts) if components is None else components
        self._decomposition = Decomposition(self._frames, self._frames[:3].T, labels)
        self._initial_excess = 0.0

    def run(self, max_bones: int) -> Rig:
        """Return the first rig within the bounds, or the best one."""
        for _ in self.grow(max_bones):
            rig = self._quantize()
            if self._excess(rig) <= 1:
                return rig
        return self._with_correctives(self._quantize())

    def grow(self, max_bones: int) -> Iterator[None]:
        """Yield whenever the errors before quantization are small enough, after adding bones.

        Each time, they become smaller; ends if more bones are of no use, or there are enough.
        """
        fit = self._decomposition
        rms_limit = self._rms_limit()
        max_bones = min(max_bones, self._vertices.shape[1])
        fit.add_bones(fit.component_seeds(max_bones, 0.1 * rms_limit))
        target, previous_kg, growth, n_stalled = 1.0, math.inf, MAX_GROWTH, 0
        while True:
            for _ in range(GROWING_ROUNDS):
                self._round()
            residuals = fit.residuals()
            kg, largest = self._fit_errors(residuals)
            self._show_progress((kg, largest))
            is_near = kg <= NEAR_KG * target and largest <= NEAR_LARGEST * target
            if is_near or fit.n_bones == max_bones:
                residuals = self._refine(residuals, target)
                kg, largest = self._fit_errors(residuals)
                self._show_progress((kg, largest))
            if max(kg, largest) <= target:
                yield
                target *= 0.95
            gain = math.log(previous_kg / kg) / max(growth, MIN_GROWTH) if kg > 0 else 0.0
            n_stalled = n_stalled + 1 if gain < MIN_GAIN else 0
            if fit.n_bones == max_bones or n_stalled == MAX_STALLED or kg < ENOUGH * target:
                break
            previous_kg = kg
            growth = min(max(0.9 * kg / target - 1, MIN_GROWTH), MAX_GROWTH)
            n_new = min(max(1, round(growth * fit.n_bones)), max_bones - fit.n_bones)
            fit.add_bones(fit.seeds(residuals, n_new))

    def _rms_limit(self) -> float:
        """Return the root mean squared error that is allowed."""
        return self._bounds.kg / 100 * self._deviation

    def _refine(self, residuals: Floats, target: float) -> Floats:
        """Fit until the errors meet the target, the worst vertices most; return the residuals."""
        fit = self._decomposition
        bound = AIM_SHARE * self._bounds.largest / 100 * self._diagonal
        for _ in range(FINAL_ROUNDS):
            fit.aim(residuals, bound)
            self._round()
            residuals = fit.residuals()
            if max(self._fit_errors(residuals)) <= target:
                break
        return residuals

    def _round(self) -> None:
        fit = self._decomposition
        fit.round(fits_rest=fit.n_bones >= N_RIGID_BONES)

    def _show_progress(self, errors: tuple[float, float]) -> None:
        excess = max(*errors, 1.0)
        self._initial_excess = max(self._initial_excess, excess, 1 + 1e-9)
        share = 1 - math.log(excess) / math.log(self._initial_excess)
        self._progress("rigging", 0.95 * share)

    def _fit_errors(self, residuals: Floats) -> tuple[float, float]:
        """Return KG and largest error, as multiples of what is allowed before quantization."""
        vectors = residuals.reshape(-1, 3, residuals.shape[1])
        squares = np.einsum("tiv,tiv->tv", vectors, vectors)
        kg = _percent(math.sqrt(squares.mean()), self._deviation)
        largest = _percent(math.sqrt(squares.max()), self._diagonal)
        return kg / (FIT_KG * self._bounds.kg), largest / (FIT_LARGEST * self._bounds.largest)

    def _excess(self, rig: Rig) -> float:
        return self._bounds.excess(rig.errors.kg_percent, rig.errors.largest_percent)

    def _quantize(self) -> Rig:
        """Return the current skin as it is stored, with the coarsest rounding that suffices."""
        fit = self._decomposition
        residuals = fit.residuals()
        rms = math.sqrt(np.square(residuals).sum() / (residuals.size / 3))
        remaining = math.sqrt(max(self._rms_limit() ** 2 - rms**2, (0.1 * self._rms_limit()) ** 2))
        rounding = min(ROUNDING_SHARE * remaining, MAX_ROUNDING * self._deviation)
        best: Rig | None = None
        for attempt in range(MAX_ATTEMPTS):
            rig = self._quantize_with(max(rounding / 2**attempt, 1e-7))
            if best is not None and self._excess(rig) > FIT_LARGEST * self._excess(best):
                break  # rounding does not matter
            best = rig
            if self._excess(best) <= 1:
                break
        assert best is not None
        return best

    def _quantize_with(self, rounding: float) -> Rig:
        fit = self._decomposition.copy()
        fit.prune(PRUNING * rounding)
        skin, skeleton = build_skeleton(fit.skin)
        weights = byte_weights(skin.weights)
        skin = replace(skin, weights=weights / FULL)
        dense = skin.dense_weights()
        distances = np.linalg.norm(skin.rest[:, np.newaxis] - skeleton.joints, axis=2)
        masses = np.maximum(dense.sum(axis=0), 1e-9)
        radii = np.sqrt((dense * np.square(distances)).sum(axis=0) / masses)
        radius = math.sqrt((dense * np.square(distances)).sum() / len(dense))
        bits = math.ceil(math.log2(math.sqrt(0.5) * radius / rounding + 1)) + 1
        exponent = math.floor(math.log2(2 * rounding * self._unit))
        unit = self._unit
        # Rounded joints are shorter in compressed files, and as good.
        joints = round_to(skeleton.joints * unit, exponent)
        transforms = skin.transforms.copy()
        transforms[..., 3] *= unit
        tracks = fit_tracks(
            transforms,
            Skeleton(skeleton.parents, joints),
            radii * unit,
            self._times_s,
            Steps(min(max(bits, MIN_BITS), MAX_BITS), exponent),
            KEY_TOLERANCE * rounding * unit,
        )
        rig = Rig(
            self._faces,
            self._times_s,
            np.zeros((len(weights), 3), np.int16),
            1.0,
            np.zeros(3),
            self._origin,
            skin.bones.astype(np.uint8),
            weights,
            Skeleton(skeleton.parents, joints),
            tracks,
            Correctives.none(len(self._times_s), len(weights)),
            RigErrors(0.0, 0.0, 0.0),
        )
        # Refit the rest pose to the rounded bones; matrices are in scaled units.
        matrices = rig.matrices.astype(np.float64)
        matrices[..., 3] /= unit
        fit.set_skin(Skin(skin.rest, skin.bones, skin.weights, matrices))
        fit.fit_rest()
        rest = fit.rest * unit
        low, high = rest.min(axis=0), rest.max(axis=0)
        offset = round_to((low + high) / 2, exponent)
        reach = max(float(np.abs(rest - offset).max()), 1e-30)
        levels = min(max(MIN_LEVELS, math.ceil(reach / (rounding * unit))), SHORT)
        scale = float(np.float32(reach / levels * SHORT))
        coordinates = np.rint((rest - offset) / scale * SHORT).astype(np.int16)
        return self._with_errors(replace(rig, coordinates=coordinates, scale=scale, offset=offset))

    def _with_errors(self, rig: Rig) -> Rig:
        """Return the rig with its errors."""
        positions_hat = rig.positions() + self._origin
        positions = position_errors(self._vertices, positions_hat)
        angle = normal_angles(self._vertices, positions_hat, self._faces).mean_deg
        errors = RigErrors(positions.kg_error_percent, positions.max_error_percent, angle)
        return replace(rig, errors=errors)

    def _with_correctives(self, rig: Rig) -> Rig:
        """Return the rig with as few correctives as meet the bounds, or with all of them."""
        if self._excess(rig) <= 1 or len(self._times_s) < 2:
            return rig
        residuals = (self._vertices - rig.positions() - self._origin).astype(np.float32)
        rounding = CORRECTIVE_ROUNDING * self._rms_limit() * self._unit
        search = CorrectiveSearch(residuals, rig.blended(), rig.scale, rounding)
        share = (FIT_KG * self._bounds.kg / rig.errors.kg_percent) ** 2
        n_targets = min(search.count_for(min(share, 0.5)), MAX_TARGETS, len(self._times_s))
        bound = AIM_SHARE * self._bounds.largest / 100 * self._diagonal * self._unit
        max_targets = min(MAX_TARGETS, len(self._times_s))
        best, best_excess, n_rounds = rig.correctives, self._excess(rig), 0
        while best_excess > FIT_LARGEST:
            correctives, mean, largest = search.round(n_targets, bound)
            kg = _percent(mean, self._deviation * self._unit)
            excess = self._bounds.excess(kg, _percent(largest, self._diagonal * self._unit))
            if excess < best_excess:
                best, best_excess = correctives, excess
            n_rounds += 1
            if n_rounds == CORRECTIVE_ROUNDS:
                if n_targets == max_targets:
                    break
                n_new = max(1, round(min(max(excess - 1, 0.15), 0.5) * n_targets))
                n_targets, n_rounds = min(n_targets + n_new, max_targets), 0
            self._progress("rigging", 0.95 + 0.05 * n_targets / MAX_TARGETS)
        displacements, correctives = best.nonnegative()
        coordinates = np.rint(rig.coordinates + SHORT * displacements)
        if np.abs(coordinates).max() > SHORT:
            return self._with_errors(replace(rig, correctives=best))
        best_rig = replace(rig, coordinates=coordinates.astype(np.int16), correctives=correctives)
        return self._with_errors(best_rig)


def _percent(value: float, reference: float) -> float:
    if reference > 0:
        return 100 * value / reference
    return 0.0 if value <= 1e-12 else math.inf


def byte_weights(weights: Floats) -> Bytes:
    """Return weights of shape (V, 4) rounded to bytes with sum 255.

    The largest weight takes the difference, which is at most 2.
    """
    rounded = np.rint(weights * FULL).astype(np.int64)
    largest = weights.argmax(axis=1)
    rounded[np.arange(len(weights)), largest] += FULL - rounded.sum(axis=1)
    return rounded.astype(np.uint8)
