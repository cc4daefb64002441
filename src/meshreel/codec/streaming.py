"""Live encoder: receives frames one by one, and encodes and writes them in blocks."""

import os
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import Sections
from meshreel.codec.block_writer import BlockWriter
from meshreel.codec.config import MAX_BLOCK_POSITIONS, EncoderConfig, config_of
from meshreel.codec.source import CodedMesh
from meshreel.codec.surface.uv_grid import check_uvs
from meshreel.codec.track_bounds import TrackTargets, kept_bounds
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import validate_faces, validate_fps, validate_start, validate_vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import Track, concatenate_tracks, describe_track, validated_tracks
from meshreel.runtime.counting import counted
from meshreel.runtime.outputs.atomic import os_errors_naming_output
from meshreel.runtime.outputs.checks import check_extension, check_output_path
from meshreel.runtime.stores.address import refuse_address

Vertices = npt.NDArray[np.floating]

SHARE_FOR_CODING = 1 / 16
"""Share of the latency that is reserved for coding a block after its last frame."""

FPS_IF_UNKNOWN = 25.0
"""Default frame rate, which converts a latency to frames."""


class Encoder:
    """Encoder of live frames: `push` each, and `close`, or use it in a `with` statement.

    The bytes of a block are written as soon as it is complete and never change. If the process is
    interrupted, `meshreel.open` reads the file up to the last block written. Blocks are coded in
    separate threads while the next frames are pushed.

    The first block determines bounding box, quantization step and number of modes: `quality` is
    relative to the size of its model, and `step` and `max_error` are shares of the diagonal of its
    bounding box. The bounding box of all frames is no smaller, so the bound holds for it too.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    output : path that ends in ``.reel``, or binary file that is open for writing
        An open file stays open.
    fps : float, default 0
        Frames per second; 0 = unknown.
    name, start_s, surface
        As in `MeshSequence`.
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
        block.
    **options
        Options of `meshreel.encode`; of the targets only `quality`, `step`, `max_error` and
        `lossless`, because the others need the whole sequence.

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
        If the file cannot be written; the message names it.

    References
    ----------
    Section III-A of the paper: blocks of k_f frames, and (`blocks`) a basis that is tracked from
    block to block.
    """

    def __init__(
        self,
        faces: npt.ArrayLike,
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
        self.n_frames = 0
        self.latency_s = 0.0
        self._fps, self._name = validate_fps(fps), name
        self._start_s, self._surface = validate_start(start_s), surface
        self._max_latency_s = max_latency_s
        self._config = _checked_config(block_frames, options)
        self._targets = tracks
        self._tracks: list[dict[str, Track]] = []
        self._described: dict[str, str] | None = None
        self._faces = np.asarray(faces)
        self._frames: list[Vertices] = []
        self._first: tuple[int, np.dtype[np.floating]] | None = None
        self._since = 0.0
        self._writer: BlockWriter | None = None
        self._is_closed = False
        self._path = Path(output) if isinstance(output, str | os.PathLike) else None
        if self._path is not None:
            refuse_address(output, "the file of an Encoder, which grows,")
            check_extension(self._path, (".reel",), "meshreel.save writes other formats")
            check_output_path(self._path, overwrite=overwrite)
        self._file: BinaryIO = self._path.open("wb") if self._path else output  # type: ignore[assignment]
        # A block is analyzed while the previous one is written.
        self._analysis_thread = ThreadPoolExecutor(1, "meshreel-encoder")
        self._file_thread = ThreadPoolExecutor(1, "meshreel-writer")
        self._analysis: Future[None] | None = None
        self._writing: Future[None] | None = None

    def push(
        self, frame: npt.ArrayLike, tracks: Mapping[str, Track | npt.ArrayLike] | None = None
    ) -> None:
        """Add a frame; waits only if a block is complete and the previous one is not encoded yet.

        Parameters
        ----------
        frame : float32 or float64 array of shape (V, 3)
            Copied. V and type must equal those of the first frame.
        tracks : mapping of str to Track of a single frame, or to arrays of shape (N,) or (N, C)
            Values by track name; copied. Names, shapes, types, kinds and units must equal those of
            the first frame. Corners are coded separately, because later frames decide which corners
            share their values.

        Raises
        ------
        InvalidInputError
            If the frame or a track differs in shape or type from the first frame, or a position is
            not finite; the frame is skipped, and others can follow. Also if a block cannot be
            encoded with these options.
        """
        if self._is_closed:
            raise InvalidInputError("the encoder is closed; it takes no more frames")
        array = np.asarray(frame)
        self._check(array)
        values = self._checked_tracks(tracks, len(array))
        if not self._frames:
            self._since = time.perf_counter()
        self._frames.append(np.array(array))
        self._tracks.append(values)
        self.n_frames += 1
        if len(self._frames) == self._block_frames(array.shape[0]):
            self._code()

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._writer.size_bytes if self._writer else 0

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
            if self._writer is not None:
                with self._errors_naming_output():
                    self._writer.finish()
        finally:
            self._analysis_thread.shutdown()
            self._file_thread.shutdown()
            self._release()
        if self._writer is None:
            raise InvalidInputError("no frame was pushed; there is nothing to write")

    def __enter__(self) -> "Encoder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # Keep the frames of a recording that an error or Ctrl-C stops.
        try:
            self.close()
        except InvalidInputError:
            if error is None:
                raise

    def __repr__(self) -> str:
        name = f" {self._name!r}" if self._name else ""
        state = "closed" if self._is_closed else "open"
        n_faces = len(np.atleast_1d(self._faces))  # not validated before the first frame
        return (
            f"<Encoder{name}, {state}: {self.n_frames} frames pushed, {self.size_bytes} bytes "
            f"written, {n_faces} faces, {self._fps:g} fps>"
        )

    def _release(self) -> None:
        if self._path is not None:
            with self._errors_naming_output():
                self._file.close()
            if self._writer is None:
                self._path.unlink(missing_ok=True)

    def _errors_naming_output(self) -> AbstractContextManager[None]:
        return os_errors_naming_output(self._path) if self._path else nullcontext()

    def _check(self, array: Vertices) -> None:
        if array.ndim != 2:
            raise InvalidInputError(f"a frame must have shape (V, 3); got {array.shape}")
        validate_vertices(array[None])
        if self._first is None:
            self._faces = validate_faces(self._faces, len(array))
            self._surface = self._surface.validated(len(array), len(self._faces))
            if self._config.uv_bits is not None:
                check_uvs(self._surface, self._config.uv_bits)
            self._first = len(array), array.dtype
        elif self._first != (len(array), array.dtype):
            raise InvalidInputError(
                f"frame {self.n_frames} has {counted(len(array), 'vertex')} of type {array.dtype}; "
                f"the first has {self._first[0]} of type {self._first[1]}"
            )

    def _checked_tracks(
        self, tracks: Mapping[str, Track | npt.ArrayLike] | None, n_verts: int
    ) -> dict[str, Track]:
        """Copy the tracks of a frame; raises InvalidInputError if the first frame had others."""
        of_frame = {
            name: one if isinstance(one, Track) else np.asarray(one)[None]
            for name, one in dict(tracks or {}).items()
        }
        checked = validated_tracks(of_frame, 1, n_verts, len(self._faces), self._surface)
        for name, track in checked.items():
            checked[name] = Track(track.values.copy(), track.domain, track.kind, track.unit)
        described = {name: describe_track(track) for name, track in checked.items()}
        if self._described is None:
            kept_bounds(self._config, checked, self._targets)
            self._described = described
        elif self._described != described:
            raise InvalidInputError(
                f"frame {self.n_frames} has the tracks {described or 'none'}; the first has "
                f"{self._described or 'none'}"
            )
        return checked

    def _block_frames(self, n_verts: int) -> int:
        if self._config.block_frames is not None:
            return self._config.block_frames
        if self._config.method_row.block_frames is not None:
            return self._config.method_row.block_frames
        seconds = self._max_latency_s * (1 - SHARE_FOR_CODING)
        return max(
            1, min(int(seconds * (self._fps or FPS_IF_UNKNOWN)), MAX_BLOCK_POSITIONS // n_verts)
        )

    def _code(self) -> None:
        """Start encoding the frames of a block; raises errors of the previous block."""
        self._wait()
        vertices, since, self._frames = np.stack(self._frames), self._since, []
        tracks, self._tracks = concatenate_tracks(self._tracks), []

        def analyze() -> None:
            if self._writer is None:
                n_verts = vertices.shape[1]
                mesh = CodedMesh(self._faces, n_verts, self._config, self._surface, self._start_s)
                with self._errors_naming_output():
                    self._writer = BlockWriter(
                        self._file, mesh, vertices, tracks, self._targets, self._fps, self._name
                    )
            sections = self._writer.analyze(vertices, tracks)
            if self._writing is not None:
                self._writing.result()
            self._writing = self._file_thread.submit(write, self._writer, sections)

        def write(writer: BlockWriter, sections: Sections) -> None:
            with self._errors_naming_output():
                writer.write(len(vertices), sections)
            self.latency_s = max(self.latency_s, time.perf_counter() - since)

        self._analysis = self._analysis_thread.submit(analyze)

    def _wait(self) -> None:
        """Wait until the previous block is analyzed; raises its error at every call."""
        if self._analysis is not None:
            self._analysis.result()

    def _wait_for_all(self) -> None:
        self._wait()
        if self._writing is not None:
            self._writing.result()


def _checked_config(block_frames: int | str, options: dict[str, Any]) -> EncoderConfig:
    if isinstance(block_frames, str) and block_frames != "auto":
        raise InvalidInputError(f"block_frames must be a number or 'auto'; got {block_frames!r}")
    chosen = None if block_frames == "auto" else block_frames
    config = config_of({**options, "block_frames": chosen})
    config.method_row.check_live(config)
    return config
