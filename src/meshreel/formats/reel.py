"""Streams of meshreel (``.reel``): read whole or with frames decoded on demand, and written."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from io import BytesIO, FileIO, IOBase
from itertools import pairwise, starmap
from pathlib import Path
from typing import Any, BinaryIO, cast

from meshreel.codec.decoder import decode
from meshreel.codec.inspect import StreamInfo, bound_notes, file_info
from meshreel.codec.memory import memory_limit
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.formats.file_errors import check_input_file, errors_naming
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames
from meshreel.formats.kinds import EVERY_DOMAIN, SequenceFormat
from meshreel.formats.options import Origin, Reading, WriteOptions, origin_of
from meshreel.formats.registry import FORMATS as ALL_FORMATS
from meshreel.formats.registry import STREAMS, extension_of
from meshreel.formats.sources import missing_source
from meshreel.kernel.files import OpenFile
from meshreel.model.extent import Extent
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence, Vertices, positions_size_bytes
from meshreel.model.timing import Timing
from meshreel.model.validation import validate_finite
from meshreel.runtime.stores.address import is_remote, without_query
from meshreel.runtime.stores.ranged_file import open_ranged


def open(
    path: str | os.PathLike[str] | bytes | bytearray | memoryview | BinaryIO,
    *,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
) -> ReelFile:
    """Open a `.reel`, or the one in an `.mp4`, for random access: reads only its index.

    Parameters
    ----------
    path : str, path, bytes or binary file
        A file, or an address such as ``s3://bucket/walk.reel`` (extra ``[s3]``): then only the
        required blocks are fetched, with one request each. Or a stream, or an open file that can
        seek, which is closed together with the result.
    n_modes : int, optional
        Decode only the first `n_modes` modes of each block, for a coarser animation; other modes,
        at least up to the 16th, stay at their mean over the block, and corrections are not applied.
        Only for streams of method `reel`.
    segment : int, optional
        Open this segment alone, numbered from 0 as `meshreel.info` lists them; its frames count
        from 0. Default: all segments.
    memory : float or str, optional
        Memory limit for decoding the mesh, a block, or the frames or values that a call returns,
        such as "2GiB", or in bytes. Default: 2 GiB.

    Raises
    ------
    InvalidInputError
        If there is no such file, `n_modes` is below 1 or not supported by the stream, the segment
        does not exist, or the path is a pipe or a device.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the file is not a stream that this version supports, or its first block is incomplete.
    MemoryLimitError
        If the index exceeds the memory limit; reading raises it for the mesh, blocks and frames.
    OSError
        If the file cannot be read.
    StoreError
        If a remote file does not exist or cannot be reached, or its server does not support byte
        ranges.

    Examples
    --------
    >>> with meshreel.open("walk.reel") as reel:
    ...     vertices, faces = reel[1234]
    ...     part = reel[100:200]
    ...     for frame in reel:
    ...         show(frame.vertices, frame.faces)
    """
    memory_limit(memory)  # an invalid size must not be reported as an error of the file
    if isinstance(path, bytes | bytearray | memoryview):
        path = BytesIO(path)
    if isinstance(path, IOBase):
        return ReelFile(cast("BinaryIO", path), n_modes, memory, segment)
    if not isinstance(path, str | os.PathLike):
        raise InvalidInputError(
            "meshreel.open takes the path of a .reel file, its bytes, or a binary file; got "
            f"{type(path).__name__}"
        )
    with ExitStack() as on_error:
        file = on_error.enter_context(_open_binary(path))
        with errors_naming(path):
            place = path if is_remote(path) else os.path.abspath(path)
            reopen = partial(open, place, n_modes=n_modes, memory=memory)
            reel = ReelFile(file, n_modes, memory, segment, reopen=reopen)
        on_error.pop_all()
    return reel


def read_info(
    path: str | os.PathLike[str],
    segment: int | None = None,
    memory: float | str | None = None,
) -> StreamInfo:
    """Return the contents of a `.reel` file, for all segments or one of them.

    Parameters and errors are those of `open`.
    """
    limit = memory_limit(memory)
    with _open_binary(path) as file, errors_naming(path):
        reel = OpenFile(file, limit.limit_bytes)
        return file_info(reel, segment, limit, is_remote=is_remote(path))


def _open_binary(path: str | os.PathLike[str]) -> BinaryIO:
    if is_remote(path):
        return open_ranged(str(path))
    check_input_file(Path(path))
    if extension_of(path) in ALL_FORMATS.keys() - {*STREAMS} and Path(path).is_file():
        raise InvalidInputError(f"{path} is not a .reel file; meshreel.load reads it")
    try:
        return Path(path).open("rb")
    except FileNotFoundError:
        raise InvalidInputError(missing_source(path)) from None


def origin_of_file(path: str | os.PathLike[str]) -> Origin | None:
    """Return the origin that a stream declares for its frames; None for other files."""
    if extension_of(without_query(path)) not in STREAMS:
        return None
    with open(path) as reel:
        return origin_of(reel)


def note_video(path: str | os.PathLike[str], notes: Notes) -> None:
    """Note that the video and the sound of an `.mp4` are left out."""
    if extension_of(without_query(path)) == ".mp4":
        notes.left_out("the video, which is the texture, and its sound")


def open_reel(path: Path, reading: Reading) -> MeshSequence:
    """Open the sequence of a `.reel` file; its default name is the file stem.

    Positions above `max_loaded_bytes` are decoded when they are read, a segment at a time; memory
    is then limited for each block instead of for the sequence.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the file is not a complete stream that this version supports; errors name the file.
    """
    note_video(path, reading.notes)
    if reading.max_loaded_bytes is not None:
        sequence = _open_stored(path, reading)
        if sum(map(positions_size_bytes, sequence.segments)) > reading.max_loaded_bytes:
            return sequence
    with errors_naming(path):
        sequence = decode(path.read_bytes(), memory=reading.memory, progress=reading.progress)
    reading.progress("reading", 1.0)
    timing = sequence.timing.at_rate(reading.fps)
    return sequence.replace(timing=timing, name=sequence.name or path.stem)


class _SelfClosingFile(FileIO):
    """A file for reading that is closed when nothing refers to it anymore."""

    def __del__(self) -> None:
        self.close()


def _open_stored(path: Path, reading: Reading) -> MeshSequence:
    """Open the sequence of a complete `.reel` file, whose frames stay in the file."""
    file = cast("BinaryIO", _SelfClosingFile(path))
    with errors_naming(path):
        reel = ReelFile(file, memory=reading.memory)
        reel.require_whole()
    name, timing = reel.name or path.stem, reel.timing.at_rate(reading.fps)
    segments = [
        _stored_segment(reel, number, path, name, timing.part(frames))
        for number, frames in enumerate(starmap(range, pairwise(reel.starts)))
    ]
    return MeshSequence.of_segments(segments, name, timing)


def _stored_segment(
    reel_file: ReelFile, number: int, path: Path, name: str, timing: Timing
) -> StoredFrames:
    """Return the frames of a segment.

    Nothing decoded is kept in it: the file keeps the last segments that were read, so that a
    sequence of many segments takes little memory.
    """

    def read(get: Callable[[ReelFile], Any]) -> Any:
        with errors_naming(path):
            return get(reel_file.segments[number])

    def pieces(frames: range) -> Iterator[tuple[int, Vertices]]:
        with errors_naming(path):
            for start, vertices in reel_file.segments[number].pieces(frames):
                yield start, _check_finite(vertices, start)

    def read_extent() -> Extent:
        survey = FrameSurvey()
        for _, vertices in pieces(range(n_frames)):
            survey.add(vertices)
        return survey.extent

    n_frames = reel_file.starts[number + 1] - reel_file.starts[number]
    return StoredFrames(
        n_frames=n_frames,
        n_verts=read(lambda segment: segment.n_verts),
        dtype=read(lambda segment: segment.dtype),
        name=name,
        read_range=lambda start, stop: read(
            lambda segment: _check_finite(segment.read(start, stop), start)
        ),
        read_faces=lambda: read(lambda segment: segment.faces),
        read_surface=lambda: read(lambda segment: segment.surface),
        read_tracks=lambda: read(lambda segment: {**segment.tracks}),
        read_extent=read_extent,
        timing=timing,
        files=(path,),
        keeps_mesh=False,
        pieces=pieces,
        error_bound=read(lambda segment: segment.error_bound),
    )


def _check_finite(vertices: Vertices, first_frame: int) -> Vertices:
    """Return decoded positions; raises CorruptStreamError unless all are finite."""
    try:
        validate_finite(vertices, first_frame=first_frame)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from None
    return vertices


def write_reel(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write all frames as a `.reel` file; notes give the error."""
    # Reading does not need the encoder.
    from meshreel.codec.achieved import measure_stream
    from meshreel.codec.encoder import encode

    segments = [segment.gather() for segment in stream.segments()]
    sequence = MeshSequence.of_segments(segments, stream.name, stream.timing)
    data = encode(
        sequence,
        max_error=options.max_error,
        quality=options.quality,
        kg=options.kg,
        lossless=options.lossless,
    )
    path.write_bytes(data)
    stream.notes += bound_notes(sequence, data)
    if options.lossless:
        stream.notes.result("encoded losslessly")
    elif stream.wants_notes:
        achieved = measure_stream(sequence, data)
        stream.notes.result(
            f"encoded with a largest error of {achieved.max_error_percent:.4f} % of the diagonal "
            f"and a KG error of {achieved.kg_error_percent:.4f} %"
        )


FORMATS = (
    SequenceFormat(
        ".reel",
        "meshreel",
        open_reel,
        write_reel,
        holds_segments=True,
        write_options=frozenset({"max_error", "quality", "kg", "lossless"}),
        holds_materials=True,
        track_domains=EVERY_DOMAIN,
    ),
    SequenceFormat(".mp4", "meshreel with a texture video", open_reel),
)
