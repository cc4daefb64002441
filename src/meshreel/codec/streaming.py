"""Live encoder: receives frames one by one, and encodes and writes them in blocks."""

import os
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Vertices
from meshreel.codec.bitstream.container import Header, Sections, StreamWriter
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.config import MAX_BLOCK_POSITIONS
from meshreel.codec.images import reencode_images
from meshreel.codec.mesh_edits import MeshEdits
from meshreel.codec.methods import BlockCoder, LiveStart, UnreachableError, method_named
from meshreel.codec.options import config_of
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame, stored_frame
from meshreel.codec.surface.uv_grid import check_uvs, has_uvs
from meshreel.codec.times import write_times
from meshreel.codec.track_bounds import TrackTargets, kept_bounds
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.cells import Cells
from meshreel.model.extent import extent_of
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces
from meshreel.model.surface import PLAIN, Surface, surface_of_cells
from meshreel.model.timing import UNTIMED, Timing
from meshreel.model.tracks import Track, concatenate_tracks, describe_track, validated_tracks
from meshreel.model.validation import validate_faces, validate_vertices
from meshreel.runtime.counting import counted
from meshreel.runtime.outputs.atomic import os_errors_naming_output
from meshreel.runtime.outputs.checks import check_extension, check_output_path
from meshreel.runtime.stores.address import refuse_address

SHARE_FOR_CODING = 1 / 16
"""Share of the latency that is reserved for coding a block after its last frame."""

FPS_IF_UNKNOWN = 25.0
"""Frame rate assumed for converting a latency to frames if the rate is unknown."""


@dataclass(frozen=True, eq=False)
class _Mesh:
    """The mesh of a segment, and properties that its frames share."""

    faces: Faces
    surface: Surface
    given_surface: Surface
    """`surface` as the caller passed it."""
    n_verts: int
    dtype: np.dtype[np.floating]
    first_frame: int
    """Number of the first frame of the segment."""
    tracks: dict[str, str]
    """Description of each track."""


@dataclass(frozen=True, eq=False)
class _Segment:
    """A segment that is being encoded."""

    coder: BlockCoder
    order: Integers
    """Integer array of shape (V,). Given number of each internal vertex."""
    header: Header
    leading: list[tuple[Section, bytes]]
    """Sections before its first block."""


class Encoder:
    """Encoder of live frames: `push` each, and `close`, or use it in a `with` statement.

    The bytes of a block are written as soon as it is complete and never change. If the process is
    interrupted, `meshreel.open` reads the file up to the last block written. Blocks are coded in
    separate threads while the next frames are pushed.

    The first block determines bounding box, quantization step and number of modes: `quality` is
    relative to the size of its model, and `step` and `max_error` are shares of the diagonal of its
    bounding box. The bounding box of all frames is no smaller, so the bound holds for it too.

    A frame with other faces begins a segment, in a new block. `quality` then is relative to the
    model of that block; the bounding box remains that of the first. Values of a track that are too
    large to be coded relative to the range of the first block begin a segment with the same faces.

    Parameters
    ----------
    faces : integer array of shape (M, 3), or Cells
        Faces of the first frame, and of others that are pushed without faces; or cells of a volume
        mesh, whose surface are the faces.
    output : path that ends in ``.reel``, or binary file that is open for writing
        An open file stays open.
    fps : float, default 0
        Frames per second; 0 = unknown.
    name, start_s, surface
        As in `MeshSequence`; `start_s` only if frames are pushed without times.
    block_frames : int or "auto", default "auto"
        Frames per block. "auto": as many as `max_latency_s` allows, or the default of the method
        (`blocks`: 25). Longer blocks take fewer bytes per frame.
    max_latency_s : float, default 2
        Seconds from the push of a frame to its bytes in the file, if frames are pushed at `fps` (25
        if that is unknown) and a block is coded in a sixteenth of its duration.
    overwrite : bool, default False
        Whether an existing file may be replaced.
    tracks : mapping of str to str or float, optional
        Error bounds of tracks, as in `meshreel.encode`. Shares refer to the range of the first
        block of a segment; a track that is constant there is lossless in that segment. The first
        frame needs all of these tracks, further segments do not.
    **options
        Options of `meshreel.encode`; of the targets only `quality`, `step`, `bound`, `max_error`
        and `lossless`, because the others need the whole sequence.

    Attributes
    ----------
    n_frames : int
        Number of frames pushed so far.
    latency_s : float
        Longest time so far from the push of a block's first frame to its bytes in the file, in
        seconds.

    Raises
    ------
    InvalidInputError
        If an option is out of range or needs the whole sequence, there are no faces, the path does
        not end in ``.reel``, or the file exists.
    StoreError
        If the path is the address of a remote file.
    OSError
        If the file cannot be written; the message names it. On a full disk, it is an `OutputError`.

    References
    ----------
    Section III-A of the paper: blocks of k_f frames, and (`blocks`) a basis that is tracked from
    block to block.
    """

    def __init__(
        self,
        faces: npt.ArrayLike | Cells,
        output: str | os.PathLike[str] | BinaryIO,
        *,
        fps: float = 0.0,
        name: str = "",
        start_s: float = 0.0,
        surface: Surface = PLAIN,
        block_frames: int | str = "auto",
        max_latency_s: float = 2.0,
        overwrite: bool = False,
        tracks: TrackTargets | None = None,
        **options: Any,
    ) -> None:
        if not max_latency_s > 0:
            raise InvalidInputError(f"max_latency_s must be above 0; got {max_latency_s}")
        self.n_frames: int = 0
        self._n_meshes = self._n_new_ranges = 0
        self.latency_s: float = 0.0
        self._name = name
        self._timing, self._surface = Timing.of_rate(fps, start_s), surface
        self._times: list[float] = []
        self._max_latency_s = max_latency_s
        if isinstance(block_frames, str) and block_frames != "auto":
            raise InvalidInputError(
                Keyword("block_frames"), f" must be a number or 'auto'; got {block_frames!r}"
            )
        n_frames = None if block_frames == "auto" else block_frames
        self._config = config_of(**{**options, "block_frames": n_frames})
        self._config.check_live()
        self._targets = tracks
        self._faces = faces if isinstance(faces, Cells) else np.asarray(faces)
        self._mesh: _Mesh | None = None  # of the last frame
        self._frames: list[Vertices] = []
        self._tracks: list[dict[str, Track]] = []
        self._block_start_s = 0.0
        self._coded_mesh: _Mesh | None = None  # of the last block
        self._bounding_frame: BoundingFrame | None = None
        self._segment: _Segment | None = None
        self._edits = MeshEdits()
        self._is_closed = False
        self._path = Path(output) if isinstance(output, str | os.PathLike) else None
        if self._path is not None:
            refuse_address(output, "the file of an Encoder, which grows,")
            check_extension(self._path, (".reel",), "meshreel.save writes other formats")
            check_output_path(self._path, overwrite=overwrite)
        self._file: BinaryIO = self._path.open("wb") if self._path else output  # type: ignore[assignment]
        self._writer = StreamWriter(self._file)
        # A block is analyzed while the previous one is written.
        self._analysis_thread = ThreadPoolExecutor(1, "meshreel-encoder")
        self._file_thread = ThreadPoolExecutor(1, "meshreel-writer")
        self._analysis: Future[None] | None = None
        self._writing: Future[None] | None = None

    def push(
        self,
        frame: npt.ArrayLike,
        tracks: Mapping[str, Track | npt.ArrayLike] | None = None,
        *,
        time: float | None = None,
        faces: npt.ArrayLike | None = None,
        surface: Surface | None = None,
    ) -> None:
        """Add a frame; waits only if a block is complete and the previous one is not encoded yet.

        Parameters
        ----------
        frame : float32 or float64 array of shape (V, 3)
            Copied. V and type must equal those of the last frame, unless it begins a segment.
        tracks : mapping of str to Track of a single frame, or to arrays of shape (N,) or (N, C)
            Values by track name; copied. Names, shapes, types, kinds and units must equal those of
            the first frame of the segment. Corners are coded separately, because later frames
            decide which corners share their values.
        time : float, optional
            Time of the frame in seconds, above that of the last frame. All frames have one, or none
            has. Times are stored when the encoder is closed: a file that is cut off has none.
        faces : integer array of shape (M, 3), optional
            Faces of this frame and the next ones; copied. If V or the faces differ from those of
            the last frame, they begin a segment. Default: those of the last frame.
        surface : Surface, optional
            Surface of these faces. Another object than that of the last frame begins a segment.
            Default: none if the faces differ, else that of the last frame.

        Raises
        ------
        InvalidInputError
            If the frame or a track differs in shape or type from the last frame and does not begin
            a segment, faces or surface are invalid, the method needs the same faces in every frame,
            the time is not above the last one, or a position is not finite; the frame is skipped,
            and others can follow. Also if a block cannot be encoded with these options.
        """
        if self._is_closed:
            raise InvalidInputError("the encoder is closed; it takes no more frames")
        array = np.asarray(frame)
        is_timed = bool(self._times) if self.n_frames else time is not None
        if (time is not None) != is_timed or (is_timed and self._timing.start_s):
            raise InvalidInputError(
                f"frame {self.n_frames} has {'no' if time is None else 'a'} time; either all "
                "frames have one and start_s is not set, or none has"
            )
        if time is not None:
            Timing.of_times([*self._times[-1:], time])  # raises unless it is above the last one
        if array.ndim != 2:
            raise InvalidInputError(f"a frame must have shape (V, 3); got {array.shape}")
        validate_vertices(array[None])
        mesh, values = self._mesh_of(array, tracks, faces, surface)
        if time is not None:
            self._times.append(float(time))

        if mesh is not self._mesh:
            if self._frames:
                self._code()
            self._mesh = mesh
            self._n_meshes += 1
        if not self._frames:
            self._block_start_s = perf_counter()
        self._frames.append(np.array(array))
        self._tracks.append(values)
        self.n_frames += 1
        if len(self._frames) == self._block_frames(mesh.n_verts):
            self._code()

    @property
    def n_segments(self) -> int:
        """Number of segments begun so far."""
        return self._n_meshes + self._n_new_ranges

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._writer.size_bytes

    def close(self) -> None:
        """Code the remaining frames and finish the file.

        Raises
        ------
        InvalidInputError
            If no frame was pushed (then no file remains), or a block cannot be encoded.
        """
        if self._is_closed:
            return
        self._is_closed = True
        try:
            if self._frames:
                self._code()
            self._wait_for_all()
            with self._errors_naming_output():
                if self._writer.size_bytes:
                    times = np.array(self._times)
                    self._writer.finish([(Section.TIMES, write_times(times))] if len(times) else [])
        finally:
            self._analysis_thread.shutdown()
            self._file_thread.shutdown()
            if self._path is not None:
                with self._errors_naming_output():
                    self._file.close()
                if not self._writer.size_bytes:
                    self._path.unlink(missing_ok=True)
        if not self.n_frames:
            raise InvalidInputError("no frame was pushed; there is nothing to write")

    def __enter__(self) -> "Encoder":
        return self

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        # Keep the frames of a recording that an error or Ctrl-C stops.
        try:
            self.close()
        except InvalidInputError:
            if kind is None:
                raise

    def __repr__(self) -> str:
        name = f" {self._name!r}" if self._name else ""
        state = "closed" if self._is_closed else "open"
        faces = self._faces if self._mesh is None else self._mesh.faces
        mesh = (
            repr(faces) if isinstance(faces, Cells) else counted(len(np.atleast_1d(faces)), "face")
        )
        segments_text = f" in {self.n_segments} segments" if self.n_segments > 1 else ""
        return (
            f"<Encoder{name}, {state}: {counted(self.n_frames, 'frame')}{segments_text} pushed, "
            f"{counted(self.size_bytes, 'byte')} written, "
            f"{mesh}, {self._timing.fps:g} fps>"
        )

    def _errors_naming_output(self) -> AbstractContextManager[None]:
        name = self._path or Path(str(getattr(self._file, "name", "the output file")))
        return os_errors_naming_output(name)

    def _mesh_of(
        self,
        array: Vertices,
        tracks: Mapping[str, Track | npt.ArrayLike] | None,
        faces: npt.ArrayLike | None,
        surface: Surface | None,
    ) -> tuple[_Mesh, dict[str, Track]]:
        """Return the mesh of a frame, which is the last one or new, and a copy of its tracks."""
        last, n_verts = self._mesh, len(array)
        is_new = last is None or (surface is not None and surface is not last.given_surface)
        if last is not None and not is_new and faces is not None:
            is_new = n_verts != last.n_verts or not np.array_equal(np.asarray(faces), last.faces)

        if last is not None and not is_new:
            if (last.n_verts, last.dtype) != (n_verts, array.dtype):
                raise InvalidInputError(
                    f"frame {self.n_frames} has {counted(n_verts, 'vertex')} of type "
                    f"{array.dtype}; frame {last.first_frame} has {last.n_verts} of type "
                    f"{last.dtype}; another mesh needs its faces with the frame"
                )
            values = _copied_tracks(tracks, n_verts, len(last.faces), last.surface)
            descriptions = {name: describe_track(track) for name, track in values.items()}
            if last.tracks != descriptions:
                raise InvalidInputError(
                    f"frame {self.n_frames} has the tracks {descriptions or 'none'}; frame "
                    f"{last.first_frame} has {last.tracks or 'none'}"
                )
            return last, values

        if last is None:
            surface = self._surface if surface is None else surface
            if isinstance(self._faces, Cells) and faces is None:
                faces, of_cells = surface_of_cells(self._faces, n_verts)
                surface = replace(surface, face_sizes=of_cells.face_sizes, cells=of_cells.cells)
            elif faces is None:
                faces = np.asarray(self._faces)
        elif self._config.positions_only:
            raise InvalidInputError(
                f"frame {self.n_frames} has other faces; method {self._config.method} needs "
                "the same in every frame; use reel or lossless"
            )
        elif faces is None:
            faces = last.faces
        given_surface = surface or PLAIN
        triangles = np.array(validate_faces(faces, n_verts))
        surface = given_surface.validated(n_verts, triangles)
        bits = self._config.uv_bits
        if bits is not None and (last is None or has_uvs(surface)):
            check_uvs(surface, bits)
        if last is None or surface.images:
            surface = reencode_images(
                [surface], self._config.images, self._config.max_image, Notes()
            )(surface)
        values = _copied_tracks(tracks, n_verts, len(triangles), surface)
        kept_bounds(self._config, values, self._targets_of(values, is_first=last is None))
        descriptions = {name: describe_track(track) for name, track in values.items()}
        first_frame = self.n_frames
        mesh = _Mesh(
            triangles, surface, given_surface, n_verts, array.dtype, first_frame, descriptions
        )
        return mesh, values

    def _targets_of(self, tracks: Mapping[str, Track], *, is_first: bool) -> TrackTargets | None:
        """Return the error bounds of a segment; those of the first need all named tracks."""
        if is_first or self._targets is None:
            return self._targets
        return {name: bound for name, bound in self._targets.items() if name in tracks}

    def _block_frames(self, n_verts: int) -> int:
        if self._config.block_frames is not None:
            return self._config.block_frames
        if (default := self._config.longest_block(None, n_verts)) is not None:
            return default
        seconds = self._max_latency_s * (1 - SHARE_FOR_CODING)
        n_frames = int(seconds * (self._timing.fps or FPS_IF_UNKNOWN))
        return max(1, min(n_frames, MAX_BLOCK_POSITIONS // n_verts))

    def _code(self) -> None:
        """Start encoding the frames of a block; raises errors of the previous block."""
        self._wait()
        vertices, block_start_s, self._frames = np.stack(self._frames), self._block_start_s, []
        tracks, self._tracks = concatenate_tracks(self._tracks), []

        mesh = self._mesh
        assert mesh is not None  # there are frames
        is_new, is_first = mesh is not self._coded_mesh, self._coded_mesh is None
        self._coded_mesh = mesh

        def analyze() -> None:
            segment, sections = None if is_new else self._segment, None
            if segment is not None:
                try:
                    sections = segment.coder.code(vertices.take(segment.order, axis=1), tracks)
                except UnreachableError:
                    self._n_new_ranges += 1
            begins_segment = sections is None
            if segment is None or sections is None:
                segment = self._new_segment(mesh, vertices, tracks, is_first=is_first)
                sections = segment.coder.code(vertices.take(segment.order, axis=1), tracks)
            self._segment = segment
            if self._writing is not None:
                self._writing.result()
            self._writing = self._file_thread.submit(write, segment, sections, begins_segment)

        def write(segment: _Segment, sections: Sections, begins_segment: bool) -> None:
            with self._errors_naming_output():
                if begins_segment:
                    self._writer.begin_segment(segment.header, segment.leading)
                self._writer.write_block(len(vertices), sections)
            self.latency_s = max(self.latency_s, perf_counter() - block_start_s)

        self._analysis = self._analysis_thread.submit(analyze)

    def _new_segment(
        self, mesh: _Mesh, first: Vertices, tracks: dict[str, Track], *, is_first: bool
    ) -> _Segment:
        """Return the encoder of a segment, given its first block."""
        if self._bounding_frame is None:
            self._bounding_frame = stored_frame(extent_of(first))
        timing = self._timing if is_first else UNTIMED  # times of further segments follow
        coded = CodedMesh(mesh.faces, mesh.n_verts, self._config, mesh.surface, timing)
        if coded.may_be_edited:
            coded = replace(coded, edit=self._edits.edit_to(mesh.faces, mesh.n_verts))
        method, frame, order = method_named(self._config.method), self._bounding_frame, coded.order
        targets = self._targets_of(tracks, is_first=is_first)
        start = LiveStart(coded, frame, first.take(order, axis=1), tracks, targets)
        coder = method.live_coder(start)
        header = coded.header(frame, first.dtype, n_frames=0, fps=self._timing.fps, name=self._name)
        leading = [*coded.leading_sections(), *coder.leading_sections()]
        return _Segment(coder, order, header, leading)

    def _wait(self) -> None:
        """Wait until the previous block is analyzed; raises its error at every call."""
        if self._analysis is not None:
            self._analysis.result()

    def _wait_for_all(self) -> None:
        self._wait()
        if self._writing is not None:
            self._writing.result()


def _copied_tracks(
    tracks: Mapping[str, Track | npt.ArrayLike] | None, n_verts: int, n_faces: int, surface: Surface
) -> dict[str, Track]:
    """Return copies of the tracks of a frame; raises InvalidInputError if they do not fit it."""
    of_frame = {
        name: values if isinstance(values, Track) else np.asarray(values)[None]
        for name, values in dict(tracks or {}).items()
    }
    return validated_tracks(of_frame, 1, n_verts, n_faces, surface)
