"""Registration of a sequence whose faces change in almost every frame."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from operator import attrgetter
from pathlib import Path

import numpy as np

from meshreel.codec.config import EncoderConfig
from meshreel.codec.option import takes_fields
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.reel_options import VERTEX_ERRORS, ReelOptions, Tune
from meshreel.codec.targets import QUALITIES
from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.model.frame_choice import frames_text
from meshreel.model.notes import Note, NoteKind, Notes
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track
from meshreel.registration.capture import Capture, Frames, Surveyed
from meshreel.registration.cleaning import MAX_CRACK, MIN_COMPONENT_AREA, CleanMesh
from meshreel.registration.folds import Folds
from meshreel.registration.growing import Segment
from meshreel.registration.holes import SCANNED, scanned_faces
from meshreel.registration.options import RegisterOptions
from meshreel.registration.refining import KeyMesh
from meshreel.registration.runs import Open, Runs
from meshreel.registration.stores import FolderStore, TemporaryStore
from meshreel.registration.transfer import (
    SurfacePoints,
    attributes_of,
    interpolated,
    items_at_corners,
    transferred_tracks,
)
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import PRECISION, FrameErrors, Tolerance, measure
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import REGISTER_SCIPY
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import one_blas_thread, results_in_order
from meshreel.runtime.workers.executors import executor_of

MIN_UNSUPPORTED_PERCENT = 0.05
"""Notes mention the share of the registered surface that raw frames lack if it is at least this."""

SAMPLING_MARGIN = 1.05
"""Factor on measured distances: a smaller tolerance is checked at denser samples. Of 100 frames one
needed 1.04, all others at most 1.02."""

MAX_STATED_SHARE = 0.75
"""Notes state a tolerance that every frame meets if it is below this share of the given one."""

MAX_CUTS = 8
"""Maximum number of cuts that notes list."""


@dataclass(frozen=True)
class Distances:
    """Distances of registered surfaces from the raw ones, over all frames.

    Attributes
    ----------
    mean_percent, p95_percent, p99_percent, max_percent : float
        Means of the frames, and the maximum of all, in percent of the diagonal of the box of all
        frames; in each frame the worse direction.
    psnr_db, total_psnr_db : float
        Surface PSNR: 10 log10(3 p^2 / mse), with the longest side p of the box, where raw frames
        have surface; and that of the whole surfaces.
    n_folded : int
        Faces in all frames that fold over: they oppose the raw surface and a neighbor, which they
        do not in the key.
    unsupported_percent : float
        Mean share of the registered surface that raw frames lack, as at holes of a scan and between
        bodies that touch; only `total_psnr_db` counts its distances.
    """

    mean_percent: float
    p95_percent: float
    p99_percent: float
    max_percent: float
    psnr_db: float
    total_psnr_db: float
    n_folded: int
    unsupported_percent: float

    @classmethod
    def of_frames(cls, errors: Sequence[FrameErrors], scale: float, n_folded: int) -> "Distances":
        """Summarize errors in longest sides of the box; `scale` is its diagonal in these."""
        names = "mean", "p95", "p99", "unsupported", "mean_square", "total_mean_square"
        means = np.mean([*map(attrgetter(*names), errors)], axis=0)
        mean, p95, p99, unsupported, *mean_squares = means.tolist()
        psnr, total_psnr = (
            float(10 * np.log10(3 / mean_square)) if mean_square else float("inf")
            for mean_square in mean_squares
        )
        return cls(
            100 * mean / scale,
            100 * p95 / scale,
            100 * p99 / scale,
            100 * max(frame.largest for frame in errors) / scale,
            psnr,
            total_psnr,
            n_folded,
            100 * unsupported,
        )

    def __str__(self) -> str:
        beyond = (
            f" without {self.unsupported_percent:.2g} % of the surface, which raw frames lack, "
            f"{self.total_psnr_db:.1f} dB with it"
            if self.unsupported_percent >= MIN_UNSUPPORTED_PERCENT
            else ""
        )
        return (
            f"mean {self.mean_percent:.2g} %, 95 % {self.p95_percent:.2g} %, largest "
            f"{self.max_percent:.2g} % of the diagonal, {self.psnr_db:.1f} dB surface PSNR{beyond}"
        )


@dataclass(frozen=True, eq=False)
class Registration:
    """A registered sequence, and how far it is from the raw frames.

    Attributes
    ----------
    sequence : MeshSequence
        Segments of constant connectivity. Frames that could not be followed are segments of their
        own.
    raw : MeshSequence
        The sequence of raw frames.
    segments : tuple of Segment
        The registered segments.
    frames : Frames
        The raw frames.
    tolerance : Tolerance
        In longest sides of the box.
    diagonal : float
        Diagonal of the box, in its longest sides.
    changes : tuple of Note
        What was removed or left out.
    """

    sequence: MeshSequence
    raw: MeshSequence
    segments: tuple[Segment, ...]
    frames: Frames
    tolerance: Tolerance
    diagonal: float
    changes: tuple[Note, ...]

    @property
    def distances(self) -> Distances:
        """Distances from the raw frames."""
        errors = [frame for segment in self.segments for frame in segment.errors]
        n_folded = sum(sum(segment.n_folded) for segment in self.segments)
        return Distances.of_frames(errors, self.diagonal, n_folded)

    def distances_of(
        self,
        sequence: MeshSequence | ReelFile,
        numbers: Collection[int],
        progress: Progress = silent,
    ) -> Distances:
        """Return the distances of frames of a sequence or a file, such as the encoded one.

        Frames without a surface do not count.
        """
        errors: list[FrameErrors] = []
        n_folded, n_frames = 0, len(numbers)
        progress("measuring", Count(0, n_frames, "frames"))
        for segment in self.segments:
            nearest = min(max(segment.key, segment.first), segment.numbers[-1])  # to the key
            folds = Folds(self._mesh(sequence, nearest), self.tolerance.length)

            def measure_frame(
                pair: tuple[TriangleMesh, int], folds: Folds = folds
            ) -> tuple[FrameErrors, int]:
                mesh, target = pair[0], self.frames.mesh(pair[1])
                return measure(mesh, target, self.tolerance), len(folds.find(mesh, target))

            chosen = (number for number in segment.numbers if number in numbers)
            pairs = ((self._mesh(sequence, number), number) for number in chosen)
            for frame_errors, n_folds in results_in_order(measure_frame, pairs, lambda _: True):
                errors.append(frame_errors)
                n_folded += n_folds
                progress("measuring", Count(len(errors), n_frames, "frames"))
        return Distances.of_frames(errors, self.diagonal, n_folded)

    def _mesh(self, sequence: MeshSequence | ReelFile, number: int) -> TriangleMesh:
        frame = sequence[number]
        return TriangleMesh(self.frames.normalized(frame.vertices), frame.faces)

    def cuts(self) -> Iterator[str]:
        """Yield a line about each frame at which a segment ended."""
        for segment in self.segments:
            for number, reason in segment.reasons:
                yield f"frame {number} does not continue the mesh of frame {segment.key}: {reason}"

    @property
    def key_vertices(self) -> tuple[int, int]:
        """Vertices of all keys, and of their cleaned frames."""
        n_key = sum(len(segment.key_mesh.mesh.vertices) for segment in self.segments)
        return n_key, sum(len(self.frames.cleaned(one.key).vertices) for one in self.segments)

    def notes(self, *, is_reported: bool = False) -> Iterator[Note]:
        """Yield notes on the result unless a report has it, on changes, and on the first cuts."""
        if not is_reported:
            n_frames = counted(self.sequence.n_frames, "frame")
            text = f"registered {n_frames} in {counted(self.sequence.n_segments, 'segment')}"
            text = f"{text}; distance from the raw surface: {self.distances}"
            yield Note(NoteKind.RESULT, text)
            if smaller := self.smaller_tolerance:
                yield Note(NoteKind.RESULT, f"every frame meets a tolerance of {smaller}, too")
            n_key, n_raw = self.key_vertices
            if n_key < n_raw:
                text = f"kept {n_key} of {counted(n_raw, 'vertex')} of keys, as the quality allows"
                yield Note(NoteKind.CHANGED, text)
        yield from self.changes
        cuts = [*self.cuts()]
        if len(cuts) > MAX_CUTS:
            cuts[MAX_CUTS:] = [f"{len(cuts) - MAX_CUTS} more frames do not continue a mesh"]
        yield from (Note(NoteKind.RESULT, cut) for cut in cuts)

    def tuned(
        self, config: EncoderConfig, notes: Notes, *, bakes_textures: bool = False
    ) -> EncoderConfig:
        """Return options that let vertices slide along the surface, unless that would be visible.

        Sliding shifts vertex values, and textures that are not baked for the decoded surface. An
        explicit tune or bound of vertex errors is kept.
        """
        if not isinstance(config, ReelOptions) or config.tune or config.lossless:
            return config
        if config.target.kind in VERTEX_ERRORS:
            return config
        segments = self.sequence.segments
        has_values = any({*segment.tracks} - {SCANNED} for segment in segments)
        is_textured = any(segment.surface.attributes for segment in segments)
        if has_values or (is_textured and not bakes_textures):
            return config
        text = Message(
            "vertices may slide along the decoded surface, which takes fewer bits; ",
            Keyword("tune"),
            " visual keeps their places",
        )
        notes.result("sliding vertices", text)
        return replace(config, tune=Tune.SURFACE.value)

    @property
    def tolerance_percent(self) -> float:
        """The tolerance in percent of the diagonal."""
        return 100 * self.tolerance.length / self.diagonal

    @property
    def met_percent(self) -> float:
        """A tolerance that every frame meets, in percent of the diagonal: two digits, rounded up.

        Meshes meet it at the distances measured for the given tolerance, with a margin for the
        denser samples of a smaller one.
        """
        largest = max(frame.min_tolerance for segment in self.segments for frame in segment.errors)
        share = max(SAMPLING_MARGIN * largest / self.tolerance.length, PRECISION)
        percent = share * self.tolerance_percent
        digit = 10.0 ** np.floor(np.log10(percent) - 1)
        return min(float(np.ceil(percent / digit) * digit), self.tolerance_percent)

    @property
    def smaller_tolerance(self) -> str:
        """A clearly smaller tolerance that every frame meets; empty if there is none."""
        is_smaller = self.met_percent < MAX_STATED_SHARE * self.tolerance_percent
        return f"{self.met_percent:.2g} %" if is_smaller else ""


@takes_fields(RegisterOptions)
def register(sequence: MeshSequence, options: RegisterOptions) -> Registration:
    """Replace the meshes of raw frames by meshes that follow the surface over many frames.

    Parameters
    ----------
    sequence : MeshSequence
        Raw frames, at least one. Frames may stay in their files; each is read four times.
    options
        The fields of `RegisterOptions`; textures are not baked.

    Raises
    ------
    InvalidInputError
        If the quality is not in 1..100, the faces do not change, no frame has a face with an area,
        `folder` contains something else, the frames have values called `SCANNED` while holes are
        kept, or the extra [register] is not installed.
    """
    return register_files(sequence, options, None)


def register_files(
    sequence: MeshSequence, options: RegisterOptions, open_part: Callable[[range], Open] | None
) -> Registration:
    """Register as `register`; workers read their frames from files.

    Parameters
    ----------
    open_part : callable, optional
        Returns a function that opens a range of frames, also on a worker. Default: frames are sent
        to the workers.
    """
    quality, keep_holes, progress = options.quality, options.keep_holes, options.progress
    QUALITIES.check(quality, Keyword("quality"))
    if sequence.n_segments == 1:
        same = f"all {sequence.n_frames} frames have the same faces"
        reason = same if sequence.n_frames > 1 else "there is only one frame"
        raise InvalidInputError(f"{reason}; nothing can be registered; use meshreel encode")
    if keep_holes and any(
        SCANNED in {*frame.tracks, *(each.name for each in frame.surface.attributes)}
        for frame in sequence.segments
    ):
        raise InvalidInputError(
            f"the frames have values called {SCANNED!r}, which is the name of the track of ",
            Keyword("keep_holes"),
            "; omit either",
        )
    REGISTER_SCIPY.load()
    extent = sequence.extent
    scale = float((extent.high - extent.low).max()) or 1.0
    diagonal = float(np.linalg.norm(extent.high - extent.low)) or 1.0
    limit = Tolerance(options.bound.share(diagonal) * diagonal / scale, quality)
    capture = Capture(
        sequence.n_frames,
        np.asarray(extent.low, np.float64),
        scale,
        sequence.dtype,
        limit,
        options.keep_debris,
    )
    frames = Frames(capture, sequence)

    def open_loaded(numbers: range) -> Open:
        return partial(_opened, MeshSequence.of_segments(map(frames.raw, numbers)))

    with executor_of(options.workers, options.scheduler, progress) as (executor, n_workers):
        runs = Runs(frames, open_part or open_loaded, executor, n_workers, progress)
        surveyed = runs.survey()
        topologies = [frame.topology for frame in surveyed]
        if not any(topologies):
            raise InvalidInputError("no frame has a face with an area; nothing can be registered")
        orientations = np.array([frame.orientation for frame in surveyed])
        usual = 1 if orientations.sum() >= 0 else -1
        capture.turned.update(np.flatnonzero(orientations == -usual).tolist())
        digest = blake2b(f"{options.bound!r} {quality}".encode())
        for frame in surveyed:
            digest.update(frame.digest)
        folder, name = options.folder, digest.hexdigest()
        store = TemporaryStore() if folder is None else FolderStore(Path(folder), name)
        with one_blas_thread():
            segments = runs.segments(dict(enumerate(topologies)), store)
    registered = MeshSequence.of_segments(
        _sequences(sequence, segments, frames, limit if keep_holes else None),
        sequence.name,
        sequence.timing,
    )
    changes = [*_changes(surveyed, sorted(capture.turned), registered, segments)]
    if store.is_resumed:
        changes.insert(0, "continued an earlier run")
    if keep_holes and not any(SCANNED in segment.tracks for segment in registered.segments):
        changes.append(f"the raw frames have all faces, so there is no track {SCANNED!r}")
    return Registration(
        registered,
        sequence,
        tuple(segments),
        frames,
        limit,
        diagonal / scale,
        tuple(Note(NoteKind.CHANGED, change) for change in changes),
    )


def _opened(sequence: MeshSequence) -> AbstractContextManager[MeshSequence]:
    return nullcontext(sequence)


def _sequences(
    raw: MeshSequence, segments: Sequence[Segment], frames: Frames, holes: Tolerance | None
) -> Iterator[MeshSequence]:
    """Yield the segments, and single frames as they are.

    Segments have a track of their holes if a tolerance for that is given.
    """
    first = 0
    for segment in segments:
        for number in range(first, segment.first):  # frames without a surface
            yield frames.raw(number)
        first = segment.numbers.stop
        key = frames.raw(segment.key)
        raw_frames = map(frames.raw_frame, segment.numbers)
        tracks = transferred_tracks(raw_frames, map(frames.normalized, segment.positions))
        surface = _key_surface(key, frames.cleaned(segment.key), segment.key_mesh, tracks)
        faces, numbers = segment.key_mesh.mesh.faces, segment.numbers
        if holes is not None:
            positions = map(frames.normalized, segment.positions)
            scanned = scanned_faces(map(frames.mesh, numbers), positions, faces, holes)
            tracks |= {} if scanned is None else {SCANNED: scanned}
        yield key.replace(
            vertices=segment.positions,
            faces=faces,
            timing=raw.timing.part(numbers),
            surface=surface,
            tracks=tracks,
        )
    for number in range(first, raw.n_frames):
        yield frames.raw(number)


def _key_surface(
    key: MeshSequence, cleaned: CleanMesh, key_mesh: KeyMesh, tracks: Mapping[str, Track]
) -> Surface:
    """Return the surface of a key for its decimated or refined mesh, without values in tracks.

    Attributes of vertices become attributes of corners.
    """
    surface, triangles = key.surface, cleaned.raw_faces[key_mesh.parents]
    polygons = items_at_corners(key, Domain.FACE)[triangles[:, 0], 0]
    weights = cleaned.reordered(key_mesh.weights)
    corners = SurfacePoints(triangles.ravel(), weights.reshape(-1, 3))

    def transfer(attribute: Attribute) -> Attribute:
        if attribute.domain is Domain.FACE:
            return attribute.indexed(attribute.per_item()[polygons])
        items = items_at_corners(key, attribute.domain)
        values = interpolated(attribute.per_item(), items, corners)
        return replace(attribute, domain=Domain.CORNER).indexed(values)

    return Surface(
        attributes=tuple(
            transfer(attribute)
            for attribute in attributes_of(key)
            if attribute.kind is Kind.UV or attribute.name not in tracks
        ),
        groups=tuple(replace(group, numbers=group.numbers[polygons]) for group in surface.groups),
        materials=surface.materials,
        images=surface.images,
        is_ordered=False,
    )


def _changes(
    surveyed: Sequence[Surveyed],
    turned_frames: Sequence[int],
    registered: MeshSequence,
    segments: Sequence[Segment],
) -> Iterator[str | Message]:
    if refined := [segment.key for segment in segments if segment.key_mesh.is_refined]:
        yield (
            f"split edges of the mesh of {counted(len(refined), 'key frame')}, which then follows "
            "more frames"
        )
    if larger := [segment.key for segment in segments if segment.key_mesh.n_added]:
        yield (
            f"added surface that other frames show to the mesh of "
            f"{counted(len(larger), 'key frame')}"
        )
    gaps = {
        "filled as frames near in time show it": [segment.filled for segment in segments],
        "no near frame shows it, so its shape is a guess": [each.unknown for each in segments],
    }
    for text, shares in gaps.items():
        if lacking := {number: share for each in shares for number, share in each}:
            percent = 100 * max(lacking.values())
            where = f"{frames_text(sorted(lacking))} (up to {percent:.2g} %)"
            yield f"missing surface of {where}: {text}"
    removed = [frame.removed for frame in surveyed]
    n_degenerate, n_small, n_welded, n_debris, _ = (
        sum(column) for column in zip(*removed, strict=True)
    )
    if n_welded:
        n_vertices = counted(n_welded, "vertex")
        yield f"closed cracks: welded {n_vertices} within {MAX_CRACK:g} tolerances of others"
    if n_degenerate:
        yield f"removed {counted(n_degenerate, 'face')} without area"
    if n_small:
        yield (
            f"removed {counted(n_small, 'component')} smaller than {100 * MIN_COMPONENT_AREA:g} % "
            "of the surface of the frame"
        )
    if n_debris:
        numbers = [number for number, frame in enumerate(removed) if frame.n_debris]
        share = max(frame.debris_share for frame in removed)
        yield Message(
            f"removed {counted(n_debris, 'small component')} that the frames before and after lack "
            f"(up to {100 * share:.2g} % of the surface; {frames_text(numbers)}); ",
            Keyword("keep_debris"), " keeps them",
        )  # fmt: skip
    if turned_frames:
        yield f"turned the faces of {frames_text(turned_frames)}, which were inside out"
    if n_empty := sum(frame.topology is None for frame in surveyed):
        yield f"{counted(n_empty, 'frame')} without a surface: kept unchanged"
    registered_names = set.intersection(*(set(segment.tracks) for segment in registered.segments))
    raw_names = frozenset[str]().union(*(frame.names for frame in surveyed))
    if names := sorted(raw_names - registered_names):
        yield f"left out tracks that are not on the vertices of all frames: {', '.join(names)}"
    if any(frame.has_hard_edges for frame in surveyed):
        yield "left out hard edges of registered frames"
