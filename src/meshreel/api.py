"""The functions of `meshreel` that take files too; the work is done in other rooms."""

import inspect
import os
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from meshreel.codec import decoder, encoder
from meshreel.codec import inspect as streams
from meshreel.codec.config import check_names
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.memory import bytes_of
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming, refuse_pipe
from meshreel.formats.load import load, open_for_encoding
from meshreel.formats.options import ReadOptions
from meshreel.formats.reel.reading import open as open_reel
from meshreel.formats.reel.reading import read_info
from meshreel.formats.remote import local_copy
from meshreel.formats.sources import AnyPath, Source
from meshreel.model.frame_choice import start_of
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.tracks import copied
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.stores.transfer import read_whole

if TYPE_CHECKING:
    from meshreel.metrics.compare import Quality

Options = ParamSpec("Options")
Result = TypeVar("Result")
Stream = bytes | bytearray | memoryview
AnySequence = FrameSource | ReelFile | Stream | Source


def _taking_files(
    encode: Callable[Concatenate[FrameSource, Options], bytes],
) -> Callable[Concatenate[AnySequence, Options], bytes]:
    """The function, for files too, with the same options: they are said in one place."""
    signature = inspect.signature(encode)

    @wraps(encode, assigned=("__doc__", "__name__", "__qualname__"))
    def encode_any(sequence: Any, *args: Options.args, **kwargs: Options.kwargs) -> bytes:
        if not kwargs.keys() <= signature.parameters.keys():
            check_names(kwargs, signature.parameters)
        with local_copy(sequence) if _is_path(sequence) else nullcontext(sequence) as given:
            source = _source(given, kwargs.get("memory"))
            return encode(source, *args, **kwargs)

    first, *others = signature.parameters.values()
    parameters = [first.replace(annotation="AnySequence"), *others]
    encode_any.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return encode_any  # type: ignore[return-value]  # mypy takes the first for a name


encode = _taking_files(encoder.encode)


def decode(
    data: Stream | AnyPath | ReelFile,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """The sequence that a `.reel` stream holds, or a segment of it.

    Parameters
    ----------
    data : bytes, path, or ReelFile
        A whole stream, from `encode`, or the file that holds it, or its address, such as
        ``s3://bucket/walk.reel`` (extra ``[remote]``).
    frames : slice, optional
        Frames to give back, as Python slices count them, without a step; only the blocks that
        hold some of them are decoded. Default: all.
    n_modes : int, optional
        Stop after so many modes of each block: a coarser animation, sooner. Default: all. Streams
        of `reel` only; corrections are left out then. Of a `ReelFile`, `meshreel.open` takes it.
    segment : int, optional
        Number of a segment, from 0, as `info` lists them. Needed if the stream has several, whose
        meshes differ. Of a `ReelFile`, `meshreel.open` takes it.
    memory : float or str, optional
        The most that frames and tracks together, the mesh, or a block may take while they are
        decoded, as in "2GiB", or bytes: a small file may hold a long animation in which little
        changes, or be made to exhaust memory. Default: 8 GiB. Of a `ReelFile`, `meshreel.open`
        takes it.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If there is no such file or segment, there are several segments and none is chosen,
        `frames` names no frame or has a step, or `n_modes` is below 1 or not for this stream.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a whole stream that this build reads; the error names the file.
    MemoryLimitError
        If more memory would be needed; nothing was allocated for it.
    """
    if isinstance(data, ReelFile):
        chosen = {"n_modes": n_modes, "segment": segment, "memory": memory}
        for name, value in chosen.items():
            if value is not None:
                raise InvalidInputError(f"{name} of a ReelFile is chosen by meshreel.open")
        return _of_reel(data, frames)
    if frames is not None and is_remote(data):
        with open_reel(data, n_modes=n_modes, segment=segment, memory=memory) as reel:
            return _of_reel(reel, frames)
    return _with_stream(
        data,
        "decode",
        lambda stream: decoder.decode(
            stream,
            frames=frames,
            n_modes=n_modes,
            segment=segment,
            memory=memory,
            progress=progress,
        ),
    )


def info(data: Stream | AnyPath | ReelFile, *, segment: int | None = None) -> StreamInfo:
    """Contents of a `.reel` stream, its segments, and its bytes by section.

    Parameters
    ----------
    data : bytes, path, or ReelFile
        A whole stream, or the file that holds it, or its address: of a remote file only the index
        and the heads of sections are fetched, and checksums are not compared.
    segment : int, optional
        Describe this segment alone. Of a `ReelFile`, `meshreel.open` takes it.

    Raises
    ------
    InvalidInputError
        If there is no such file.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a whole stream that this build reads; the error names the file.
    """
    if isinstance(data, ReelFile):
        if segment is not None:
            raise InvalidInputError("segment of a ReelFile is chosen by meshreel.open")
        return data.info()
    if is_remote(data):
        return read_info(data, segment)
    return _with_stream(data, "info", lambda stream: streams.info(stream, segment))


def compare(
    original: AnySequence, decoded: AnySequence, *, progress: Progress = silent
) -> "Quality":
    """Every quality figure of a decoded sequence, computed in float64.

    Parameters
    ----------
    original, decoded : MeshSequence, path, bytes, or ReelFile
        Sequences, what `load` reads, or `.reel` streams. Of equal frame and vertex counts, with
        the same oriented triangles; their order, and the vertex at which each begins, may differ.
    progress : callable, optional
        Called as ``progress("comparing", fraction)``.

    Raises
    ------
    InvalidInputError
        If there is no such file, or frame counts, vertex counts or triangles differ, naming both
        or the first face.
    """
    from meshreel.metrics.compare import compare as measure  # which takes half a second

    return measure(_loaded(original), _loaded(decoded), progress=progress)


def _with_stream(given: Any, function: str, use: Callable[[bytes], Result]) -> Result:
    """Result of a function of the bytes of a stream; errors name the file."""
    if isinstance(given, Stream):
        return use(bytes(given))
    if is_remote(given):
        data = read_whole(given)
        with errors_naming(given):
            return use(data)
    if isinstance(given, str | os.PathLike):
        path = Path(given)
        refuse_pipe(path)
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "does not exist"
            raise InvalidInputError(f"{str(path)!r} {what}; give the path of a .reel file")
        with os_errors_naming(path):
            data = path.read_bytes()
        with errors_naming(path):
            return use(data)
    raise InvalidInputError(
        f"{function} takes the bytes of a .reel stream, or the path of a .reel file; got "
        f"{type(given).__name__}"
    )


def _source(given: Any, memory: Any) -> FrameSource:
    """Frames to be encoded, which may stay in their files."""
    if _is_path(given):
        notes: list[str] = []
        most = None if memory is None else bytes_of(memory, "memory")
        source = open_for_encoding(given, most, ReadOptions(notes=notes))
        _warn(notes)
        return source
    return _sequence(given)


def _loaded(given: Any) -> MeshSequence:
    """All frames, in memory."""
    if _is_path(given):
        notes: list[str] = []
        with local_copy(given) as files:
            sequence = load(files, notes=notes)
        _warn(notes)
        return sequence
    source = _sequence(given)
    if isinstance(source, MeshSequence):
        return source
    return MeshSequence(
        source.read(0, source.n_frames),
        source.faces,
        source.fps,
        source.name,
        source.start_s,
        source.surface,
        {name: copied(track, range(source.n_frames)) for name, track in source.tracks.items()},
    )


def _sequence(given: Any) -> FrameSource:
    if isinstance(given, Stream):
        return decoder.decode(bytes(given))
    if isinstance(given, ReelFile):
        return _of_reel(given, None)
    if all(hasattr(given, name) for name in ("faces", "extent", "read")):
        source: FrameSource = given
        return source
    raise InvalidInputError(
        f"a sequence is a MeshSequence, the path of a file or folder, a list of paths, or the "
        f"bytes of a .reel stream; got {type(given).__name__}; of arrays, "
        "meshreel.MeshSequence(vertices, faces) makes one"
    )


def _is_path(given: Any) -> bool:
    """Whether it is what `load` reads: a path, or several."""
    several = given if isinstance(given, list | tuple) else [given]
    return all(isinstance(one, str | os.PathLike) for one in several)


def _of_reel(reel: ReelFile, frames: slice | None) -> MeshSequence:
    wanted = reel.frame_range(frames)
    reel.require_frames(wanted)
    return MeshSequence(
        reel.read(wanted.start, wanted.stop),
        reel.faces,
        reel.fps,
        reel.name,
        start_of(wanted, reel.start_s, reel.fps),
        reel.surface,
        {name: copied(track, wanted) for name, track in reel.tracks.items()},
    )


def _warn(notes: list[str]) -> None:
    """Tell the caller what reading changed or left out, each only once."""
    for note in dict.fromkeys(notes):
        warnings.warn(note, stacklevel=4)
