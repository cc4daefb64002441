"""Segments grow from key frames in both directions, as far as the tolerance is met."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, replace
from functools import cached_property, partial
from itertools import chain, count
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.frame_choice import consecutive_runs
from meshreel.model.sequence import Vertices
from meshreel.registration.capture import Frames, Topology
from meshreel.registration.completing import RegisteredKey, complete_key, may_lack_surface
from meshreel.registration.decimating import decimated_key
from meshreel.registration.filling import Mask, filled_frames, shown_vertices
from meshreel.registration.fitting import TwoSidedFit
from meshreel.registration.folds import Folds
from meshreel.registration.graph import Pose, PosedMesh
from meshreel.registration.refining import KeyMesh
from meshreel.registration.stores import Arrays, Course, TemporaryStore
from meshreel.registration.tracking import ATTEMPTS, Attempt, State, Tracker
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import FrameErrors, Tolerance, check, measure, one_way
from meshreel.runtime.threads import in_threads

REGISTERING = "registering"
"""Name of the stage in which the first meshes of all keys are registered, for progress."""

KEY_MARGIN = 0.25
"""A key is in the middle of a run of frames: not within this fraction of either end."""

SMOOTHNESS = (0.3, 0.1, 0.03, 0.01)
"""Smoothness of the steps of a fit, which ends at the step that meets the tolerance."""

SMOOTHNESS_OF_OPENED = 0.03
"""Smoothness of the step after opening folds."""

MAX_ERROR_TO_FIT = 5.0
"""Largest error, in tolerances, after which further steps of a fit are tried."""

MAX_ERROR_TO_OPEN = 2.0
"""Largest error, in tolerances, after which folds are opened in order to meet the tolerance."""

MAX_ERROR_TO_REFINE = 2.0
"""Largest error, in tolerances, of a frame that a key with more vertices may be able to follow."""

MAX_SMOOTH_STEPS = 2
"""A fit of at most this many steps is too smooth to imitate a part of the surface that tracking has
lost."""

MAX_REPAIRS = 2
"""Largest number of times that the folds of a fit are opened and flattened."""

MAX_SAGITTA = 0.7
"""Largest sagitta of the edges of a refined key (`KeyMesh.refined`), in tolerances."""

MIN_REFINEMENT = 1.2
"""Smallest ratio of the vertices of a refined key and of the raw frame. Below, the frame does not
lack vertices, and its undecimated mesh followed no more frames (four captures, 0.1 and 0.2 %)."""

MAX_ERROR_TO_COMPLETE = 3.0
"""Largest error, in tolerances and where it has surface, of a frame that may complete a key."""

KEY_BITS, MOTION_BITS = 18.0, 1.0
"""Bits of a vertex in the key, and in each other frame, measured in files of quality 70 at fast
motion, where segments end."""


class Success(NamedTuple):
    """A key mesh registered to a frame.

    Attributes
    ----------
    state : State
        State of the tracker at this frame.
    positions : float64 array of shape (V, 3)
        Positions of the key mesh, in longest sides of the box.
    errors : FrameErrors
    n_folded : int
        Faces that fold over.
    """

    state: State
    positions: Floats
    errors: FrameErrors
    n_folded: int


class Failure(NamedTuple):
    """Why a frame could not be followed.

    Attributes
    ----------
    reason : str
    excess : float
        The smallest error of all attempts, in tolerances.
    """

    reason: str
    excess: float


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive frames with the faces of a key.

    Attributes
    ----------
    first : int
        The first frame.
    key : int
        The frame whose mesh this is.
    positions : array of shape (T, V, 3)
        In the unit and the number type of the sequence.
    key_mesh : KeyMesh
        The mesh of the key, decimated or refined, in longest sides of the box.
    errors : tuple of FrameErrors
        Errors of each frame.
    n_folded : tuple of int
        Faces that fold over in each frame.
    reasons : tuple of (int, str)
        The frames at which it ended, and why each could not be followed.
    may_lack_vertices : bool
        Whether the tolerance was nearly met at one of these frames, which has as many components
        as the key: a key with more vertices may be able to follow it.
    filled, unknown : tuple of (int, float)
        Frames that lack surface, and its share: filled as near frames show it, or not shown by any.
    """

    first: int
    key: int
    positions: Vertices
    key_mesh: KeyMesh
    errors: tuple[FrameErrors, ...]
    n_folded: tuple[int, ...]
    reasons: tuple[tuple[int, str], ...]
    may_lack_vertices: bool
    filled: tuple[tuple[int, float], ...] = ()
    unknown: tuple[tuple[int, float], ...] = ()

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def numbers(self) -> range:
        """Numbers of the frames in the sequence."""
        return range(self.first, self.first + self.n_frames)

    def arrays(self) -> Arrays:
        """Return the arrays that make up the segment, by name."""
        numbers, reasons = zip(*self.reasons, strict=True) if self.reasons else ((), ())
        return {
            "positions": self.positions,
            "vertices": self.key_mesh.mesh.vertices,
            "faces": self.key_mesh.mesh.faces,
            "parents": self.key_mesh.parents,
            "weights": self.key_mesh.weights,
            "numbers": np.array([self.first, self.key, self.key_mesh.n_added, *numbers]),
            "reasons": np.array(reasons, np.str_),
            "errors": np.array([*map(astuple, self.errors)]),
            "n_folded": np.array(self.n_folded),
            "may_lack_vertices": np.array(self.may_lack_vertices),
            "filled": np.array(self.filled).reshape(-1, 2),
            "unknown": np.array(self.unknown).reshape(-1, 2),
        }

    @classmethod
    def of_arrays(cls, arrays: Arrays) -> "Segment":
        """Return the segment of these arrays; the inverse of `arrays`."""
        mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
        first, key, n_added, *numbers = arrays["numbers"].tolist()
        return cls(
            first,
            key,
            arrays["positions"],
            KeyMesh(mesh, arrays["parents"], arrays["weights"], n_added),
            tuple(FrameErrors(*row) for row in arrays["errors"].tolist()),
            tuple(arrays["n_folded"].tolist()),
            tuple(zip(numbers, arrays["reasons"].tolist(), strict=True)),
            bool(arrays["may_lack_vertices"]),
            *(
                tuple((int(number), share) for number, share in arrays[name].tolist())
                for name in ("filled", "unknown")
            ),
        )

    def part(self, numbers: range) -> "Segment":
        """Return some of its frames."""
        rows = slice(numbers.start - self.first, numbers.stop - self.first)
        ends = numbers.start - 1, numbers.stop
        return replace(
            self,
            first=numbers.start,
            positions=self.positions[rows],
            errors=self.errors[rows],
            n_folded=self.n_folded[rows],
            reasons=tuple(reason for reason in self.reasons if reason[0] in ends),
            filled=tuple(row for row in self.filled if row[0] in numbers),
            unknown=tuple(row for row in self.unknown if row[0] in numbers),
        )

    @property
    def bits_per_frame(self) -> float:
        """Estimated mean bits of a frame: its share of the key, and its motion."""
        return _bits_per_frame(self.key_mesh, self.n_frames)


def _bits_per_frame(key_mesh: KeyMesh, n_frames: int) -> float:
    bits_of_vertex = KEY_BITS + MOTION_BITS * (n_frames - 1)
    return len(key_mesh.mesh.vertices) * bits_of_vertex / n_frames


def grow_segments(
    frames: Frames,
    topologies: Mapping[int, Topology | None],
    tolerance: Tolerance,
    store: TemporaryStore,
    report: Callable[[str, int], None],
) -> list[Segment]:
    """Divide frames into segments.

    Parameters
    ----------
    topologies : mapping of int to Topology, or to None for frames without a surface
        By the numbers of the frames. Frames without a surface belong to no segment.
    tolerance : Tolerance
        In longest sides of the box.
    store : TemporaryStore
        Holds the registered frames; a `FolderStore` may contain some already.
    report : callable
        Called with the stage and its number of finished frames. A refined key begins again.
    """
    numbers = [number for number, topology in topologies.items() if topology is not None]
    n_finished = len(topologies) - len(numbers)
    n_growing: dict[int, int] = {}  # frames by key

    def report_all(key: int, stage: str, n_frames: int) -> None:
        n_growing[key] = n_frames
        report(stage, n_finished + sum(list(n_growing.values())))

    def divide(run: range) -> list[Segment]:
        key = _choose_key(run, topologies)
        segment = _longest(frames, key, run, tolerance, store, partial(report_all, key))
        segment = filled_segment(segment, frames, tolerance, store, partial(report_all, key))
        n_growing[key] = segment.n_frames
        remaining = range(run.start, segment.numbers.start), range(segment.numbers.stop, run.stop)
        return [segment, *divide_all(filter(None, remaining))]

    def divide_all(runs: Iterable[range]) -> Iterator[Segment]:
        return chain(*in_threads(divide, list(runs)))

    segments = sorted(
        divide_all(run for _, run in consecutive_runs(np.array(numbers))),
        key=lambda segment: segment.first,
    )
    report(REGISTERING, len(topologies))
    return segments


def _choose_key(run: range, topologies: Mapping[int, Topology | None]) -> int:
    """Return the frame of the best topology near the middle of a run."""
    margin = int(KEY_MARGIN * len(run))
    inner = run[margin : len(run) - margin]
    allowed = {number: topology for number in inner if (topology := topologies[number])}
    best = max(allowed.values())
    middle = (run[0] + run[-1]) / 2
    return min(
        (number for number, topology in allowed.items() if topology == best),
        key=lambda number: abs(number - middle),
    )


def _longest(
    frames: Frames,
    key: int,
    run: range,
    tolerance: Tolerance,
    store: TemporaryStore,
    report: Callable[[str, int], None],
) -> Segment:
    """Return the segment of a decimated key within a run, or of a refined one if it is smaller."""
    full, wedges = KeyMesh.of_mesh(frames.mesh(key)), frames.wedges(key)
    initial_key = full if wedges is None else decimated_key(full, wedges, tolerance)
    report_first, report_completing, report_refined = (
        partial(report, stage)
        for stage in (REGISTERING, "completing a mesh", "registering a refined mesh")
    )
    key_mesh = _complete(frames, key, initial_key, run, full.mesh, tolerance, report_completing)
    segment = _grow(frames, key, key_mesh, f"{key}", run, tolerance, store, report_first)
    # Added faces may not belong to the surface. If they are smaller than a patch, no frame fails.
    if key_mesh.added_area > tolerance.patch_area and segment.reasons:
        other = _grow(frames, key, initial_key, f"{key}_given", run, tolerance, store, report_first)
        segment = max(segment, other, key=lambda choice: choice.n_frames)
    if not segment.may_lack_vertices:
        return segment
    refined = full.refined(MAX_SAGITTA * tolerance.length)
    if len(refined.mesh.vertices) < MIN_REFINEMENT * len(full.mesh.vertices):
        return segment
    if _bits_per_frame(refined, len(run)) >= segment.bits_per_frame:  # even if it follows all
        return segment
    refined = _complete(frames, key, refined, run, full.mesh, tolerance, report_completing)
    other = _grow(frames, key, refined, f"{key}_refined", run, tolerance, store, report_refined)
    return min(segment, other, key=lambda choice: choice.bits_per_frame)


def filled_segment(
    segment: Segment,
    frames: Frames,
    tolerance: Tolerance,
    store: TemporaryStore,
    report: Callable[[str, int], None],
) -> Segment:
    """Return the segment with the surface that some frames lack moved as in frames near them.

    Frames that would then miss the tolerance are fitted again. They stay as they are if they still
    miss it, or if more faces would fold over.
    """
    faces, name = segment.key_mesh.mesh.faces, f"{segment.key}_filled"
    lacking = [row for row, errors in enumerate(segment.errors) if errors.unsupported]
    if segment.n_frames == 1 or not lacking:
        return segment

    def positions(row: int) -> Floats:
        return frames.normalized(segment.positions[row])

    def shown(row: int) -> Mask:
        report("filling", row)
        target = frames.mesh(segment.numbers[row])
        return shown_vertices(TriangleMesh(positions(row), faces), target, tolerance)

    is_shown = {row: mask for row in lacking if not (mask := shown(row)).all()}
    if not is_shown:
        return segment
    fit = TwoSidedFit(faces, len(segment.key_mesh.mesh.vertices))
    folds, n_folded = Folds(segment.key_mesh.mesh, tolerance.length), list(segment.n_folded)
    all_errors, filled, unknown = list(segment.errors), [], []
    for number, vertices in zip(segment.numbers, segment.positions, strict=True):
        store.put(name, number, vertices)
    for row, vertices, is_unknown in filled_frames(positions, segment.n_frames, faces, is_shown):
        number, mesh = segment.numbers[row], TriangleMesh(vertices, faces)
        target = frames.mesh(number)
        if share := mesh.vertex_areas[is_unknown].sum() / mesh.areas.sum():
            unknown.append((number, float(share)))
        errors = measure(mesh, target, tolerance)
        if errors.exceeds(tolerance):
            mesh = TriangleMesh(fit.step(mesh, vertices, target, SMOOTHNESS[0]), faces)
            errors = measure(mesh, target, tolerance)
        n_folds = len(folds.find(mesh, target))
        if not errors.exceeds(tolerance) and n_folds <= n_folded[row]:
            store.put(name, number, frames.restored(mesh.vertices))
            n_folded[row] = n_folds
            all_errors[row] = errors
            filled.append((number, errors.unsupported))
    return replace(
        segment,
        positions=store.stack(name, segment.numbers),
        errors=tuple(all_errors),
        n_folded=tuple(n_folded),
        filled=tuple(filled),
        unknown=tuple(unknown),
    )


def _complete(
    frames: Frames,
    key: int,
    key_mesh: KeyMesh,
    run: range,
    cleaned: TriangleMesh,
    tolerance: Tolerance,
    report: Callable[[int], None],
) -> KeyMesh:
    """Return a key extended by the surface that frames of a run show beyond its boundary.

    `cleaned` is the cleaned raw mesh of the key.
    """
    mesh = key_mesh.mesh
    if not may_lack_surface(mesh, tolerance):
        return key_mesh
    follower = Follower(mesh, tolerance)
    directions = [range(key - 1, run.start - 1, -1), range(key + 1, run.stop)]
    patches: dict[range, list[TriangleMesh]] = {numbers: [] for numbers in directions}
    n_seen = count(1)

    def collect_patches(numbers: range) -> None:
        for registered in follower.registered_keys(map(frames.mesh, numbers)):
            patches[numbers] += registered.patches(mesh.vertices, tolerance)
            report(next(n_seen))

    in_threads(collect_patches, directions)
    return complete_key(key_mesh, cleaned, chain(*patches.values()), tolerance)


def _grow(
    frames: Frames,
    key: int,
    key_mesh: KeyMesh,
    name: str,
    run: range,
    tolerance: Tolerance,
    store: TemporaryStore,
    report: Callable[[int], None],
) -> Segment:
    """Return the segment of a key within a run of frames, under a name in the store."""
    mesh = key_mesh.mesh
    store.put(name, key, frames.restored(mesh.vertices))
    before, after = range(key - 1, run.start - 1, -1), range(key + 1, run.stop)
    courses: dict[range, Course] = {}

    def follow(follower: Follower, numbers: range) -> None:
        """Follow frames in order, up to the first that cannot be followed."""
        course = Course(follower.tracker.start())
        courses[numbers] = course
        for number in numbers:
            outcome = follower.follow(course.state, frames.mesh(number))
            if isinstance(outcome, Failure):
                course.reason, course.excess = outcome
                break
            course.state = outcome.state
            course.errors.append(outcome.errors)
            course.n_folded.append(outcome.n_folded)
            store.put(name, number, frames.restored(outcome.positions))
            report(1 + sum(len(other.errors) for other in list(courses.values())))

    directions = [numbers for numbers in (before, after) if numbers]
    if directions:
        in_threads(partial(follow, Follower(mesh, tolerance)), directions)
    earlier, later = (
        [*zip(courses[numbers].errors, courses[numbers].n_folded, strict=True)] if numbers else []
        for numbers in (before, after)
    )
    at_key = measure(mesh, frames.mesh(key), tolerance), 0
    errors, n_folded = zip(*reversed(earlier), at_key, *later, strict=True)
    span = range(key - len(earlier), key + len(later) + 1)
    ends = {side[len(course.errors)]: course for side, course in courses.items() if course.reason}
    n_components = frames.cleaned(key).n_components
    return Segment(
        span.start,
        key,
        store.stack(name, span),
        key_mesh,
        errors,
        n_folded,
        tuple(sorted((number, course.reason) for number, course in ends.items())),
        any(
            course.excess < MAX_ERROR_TO_REFINE
            and frames.cleaned(number).n_components == n_components
            for number, course in ends.items()
        ),
    )


@dataclass
class Fit:
    """An attempt to follow a frame.

    Attributes
    ----------
    pose : Pose
    posed : PosedMesh
        The mesh in this pose, with the details of the last frame.
    mesh : TriangleMesh
        The fitted mesh.
    errors : FrameErrors
        Errors of the fitted mesh.
    n_steps : int
        Steps of the fit.
    n_folded : int
        Faces of the fitted mesh that fold over.
    """

    pose: Pose
    posed: PosedMesh
    mesh: TriangleMesh
    errors: FrameErrors
    n_steps: int
    n_folded: int = 0


class Follower:
    """Follows frames with the mesh of a key, with as little detail as the tolerance allows."""

    def __init__(self, key: TriangleMesh, tolerance: Tolerance) -> None:
        self._key = key
        self._fit = TwoSidedFit(key.faces, len(key.vertices))
        self._folds = Folds(key, tolerance.length)
        self._tolerance = tolerance

    @cached_property
    def tracker(self) -> Tracker:
        """Moves the key from frame to frame."""
        return Tracker(self._key)

    def state_at(self, positions: Floats) -> State:
        """Return the state of the tracker at positions of shape (V, 3)."""
        state = self.tracker.start()
        return self.tracker.arrive(state, *self.tracker.conform(state, positions), positions)

    def conform(self, state: State, positions: Floats, target: TriangleMesh) -> Success | Failure:
        """Return the next frame as `follow`, given positions near its surface."""
        pose, posed = self.tracker.conform(state, positions)
        fit = self._fitted((pose, posed), target)
        if not self._meets(fit.errors):
            return self.follow(state, target)
        self._repair_folds(fit, target)
        self._restore_folds(fit, target)
        next_state = self.tracker.arrive(state, pose, posed, fit.mesh.vertices)
        return Success(next_state, fit.mesh.vertices, fit.errors, fit.n_folded)

    def follow(self, state: State, target: TriangleMesh) -> Success | Failure:
        """Return the next frame, or why no attempt meets the tolerance.

        While faces fold over, the next attempt is tried. Folds in a close fit of the first attempt
        may imitate a part that it lost, such as a finger; they are restored last.
        """
        fits: list[Fit] = []
        accepted: list[Fit] = []
        has_failed = False
        for attempt in ATTEMPTS:
            if attempt.if_failed not in (None, has_failed):
                continue
            fit = self._attempt(state, target, attempt)
            if self._meets(fit.errors):
                self._repair_folds(fit, target)
                if fits or fit.n_steps <= MAX_SMOOTH_STEPS:
                    self._restore_folds(fit, target)
                accepted.append(fit)
                if not fit.n_folded:
                    break
            fits.append(fit)
            has_failed = bool(accepted) or self._is_lost(fit.errors)
        if accepted:
            fit = min(accepted, key=lambda fit: fit.n_folded)
            self._restore_folds(fit, target)
            next_state = self.tracker.arrive(state, fit.pose, fit.posed, fit.mesh.vertices)
            return Success(next_state, fit.mesh.vertices, fit.errors, fit.n_folded)
        nearest = min((fit.errors for fit in fits), key=self._excess)
        return Failure(nearest.exceeds(self._tolerance), self._excess(nearest))

    def registered_keys(self, targets: Iterable[TriangleMesh]) -> Iterator[RegisteredKey]:
        """Yield the mesh registered to the frames next to the key, until it is too far from one.

        The mesh is not stretched over surface that it lacks.
        """
        state = self.tracker.start()
        for target in targets:
            if (found := self._approach(state, target)) is None:
                break
            pose, posed, mesh = found
            yield RegisteredKey(mesh, posed.vertex_rotations, target)
            state = self.tracker.arrive(state, pose, posed, mesh.vertices)

    def _approach(
        self, state: State, target: TriangleMesh
    ) -> tuple[Pose, PosedMesh, TriangleMesh] | None:
        """Return the mesh of the first attempt that is near where the frame has surface, if any."""
        for attempt in ATTEMPTS:
            if attempt.if_failed is not None:
                continue
            pose, posed = self.tracker.track(state, target, attempt)
            mesh = self._key.moved(posed.positions)
            for smoothness in SMOOTHNESS:
                positions = self._fit.step(mesh, posed.positions, target, smoothness, covers=False)
                mesh = mesh.moved(positions)
                if self._excess(one_way(mesh, target, self._tolerance)) <= MAX_ERROR_TO_COMPLETE:
                    return pose, posed, mesh
        return None

    def _meets(self, errors: FrameErrors) -> bool:
        return not errors.exceeds(self._tolerance)

    def _is_lost(self, errors: FrameErrors) -> bool:
        """Whether a mesh is too far from the surface to be fitted more closely."""
        return errors.p99 > MAX_ERROR_TO_FIT * self._tolerance.length

    def _excess(self, errors: FrameErrors) -> float:
        return errors.in_tolerances(self._tolerance)

    def _attempt(self, state: State, target: TriangleMesh, attempt: Attempt) -> Fit:
        """Return an attempt with the closest fit of all its steps."""
        return self._fitted(self.tracker.track(state, target, attempt), target)

    def _fitted(self, start: tuple[Pose, PosedMesh], target: TriangleMesh) -> Fit:
        """Return the closest fit of all steps from a posed mesh.

        The steps end when the tolerance is met, or when they no longer reduce the error. If it is
        nearly met, folds may hide the rest of the surface, so they are opened, and the mesh is
        fitted again.
        """
        (pose, posed), fits = start, list[Fit]()

        def fit_again(mesh: TriangleMesh, smoothness: float) -> None:
            positions = self._fit.step(mesh, posed.positions, target, smoothness)
            fitted = mesh.moved(positions)
            errors = check(fitted, target, self._tolerance)
            fits.append(Fit(pose, posed, fitted, errors, len(fits) + 1))

        def nearest() -> Fit:
            return min(fits, key=lambda fit: self._excess(fit.errors))

        mesh = self._key.moved(posed.positions)
        for smoothness in SMOOTHNESS:
            fit_again(mesh, smoothness)
            mesh, errors = fits[-1].mesh, fits[-1].errors
            is_best = nearest() is fits[-1]
            if self._meets(errors) or self._is_lost(errors) or not is_best:
                break
        if 1 < self._excess(nearest().errors) < MAX_ERROR_TO_OPEN:
            opened = self._folds.open(nearest().mesh, target)
            if opened is not nearest().mesh:
                fit_again(opened, SMOOTHNESS_OF_OPENED)
        return nearest()

    def _repair_folds(self, fit: Fit, target: TriangleMesh) -> None:
        """Open and flatten folds, as long as the tolerance is met, and count those that remain.

        Opening keeps the mesh near the surface. Flattening also mends places where the surface is
        too rough for that, but moves the mesh off creases.
        """
        mesh, n_opposing = fit.mesh, self._n_opposing(fit.mesh, target)
        n_left = n_opposing
        for _ in range(MAX_REPAIRS):
            repaired: list[tuple[TriangleMesh, int]] = []
            for repair in (self._folds.open, self._folds.flatten):
                if n_left:
                    mesh = repair(mesh, target)
                    n_left = self._n_opposing(mesh, target)
                    repaired.append((mesh, n_left))
            while repaired:
                mesh, n_left = repaired.pop()
                errors = check(mesh, target, self._tolerance)
                if self._meets(errors):
                    break
            else:
                break
            if n_left < n_opposing:
                fit.mesh, fit.errors, n_opposing = mesh, errors, n_left
        fit.n_folded = len(self._folds.find(fit.mesh, target))

    def _n_opposing(self, mesh: TriangleMesh, target: TriangleMesh) -> int:
        return len(self._folds.find(mesh, target, min_turn=0.0))

    def _restore_folds(self, fit: Fit, target: TriangleMesh) -> None:
        """Restore the shape of the key at folds, unless the tolerance is then exceeded."""
        if not fit.n_folded:
            return
        mesh = self._folds.restore(fit.mesh, target, fit.posed.base)
        errors, folded = check(mesh, target, self._tolerance), self._folds.find(mesh, target)
        if len(folded) < fit.n_folded and self._meets(errors):
            fit.mesh, fit.errors, fit.n_folded = mesh, errors, len(folded)
