"""The functions of `meshreel` that also accept files: `encode`, `decode`, `info`, and others."""

import os
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast, overload

from meshreel.codec import decoder, encoder
from meshreel.codec import inspect as streams
from meshreel.codec.encoder import EncodeCall, encode_call
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.memory import bytes_of, memory_limit
from meshreel.codec.option import takes_fields
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.formats.file_errors import check_input_file, errors_naming, os_errors_naming
from meshreel.formats.load import is_path
from meshreel.formats.options import Reading
from meshreel.formats.reel import open as open_reel
from meshreel.formats.reel import read_info
from meshreel.formats.sources import AnyPath, Source
from meshreel.model.notes import NoteKind, Notes
from meshreel.model.sequence import MeshSequence
from meshreel.operations.inputs import AnyInput, Stream, loaded, opened
from meshreel.operations.registering import (
    check_scheduler,
    extras_to_register,
    open_part,
    register_frames,
)
from meshreel.registration.options import RegisterOptions
from meshreel.runtime.extras import require
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.stores.transfer import read_whole

if TYPE_CHECKING:
    from meshreel.metrics.compare import Quality
    from meshreel.metrics.surface_distance import SurfaceQuality
    from meshreel.model.rig import Rig

Result = TypeVar("Result")


@takes_fields(EncodeCall)
def encode(sequence: AnyInput, call: EncodeCall) -> bytes:  # noqa: D103  see below
    if isinstance(sequence, MeshSequence):
        data = encode_call(sequence, call)
        _warn(streams.bound_notes(sequence, data))
        return data
    reading = Reading(matches_frames=call.order in (None, "drop"))
    memory = None if call.memory is None else bytes_of(call.memory, "memory")
    with opened(sequence, reading, memory) as source:
        _warn(reading.notes)
        data = encode_call(source, call)
        _warn(streams.bound_notes(source, data))
        return data


encode.__doc__ = encoder.encode.__doc__


def decode(
    data: Stream | AnyPath | ReelFile,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """Decode a `.reel` stream to a sequence with the same segments.

    Parameters
    ----------
    data : bytes, path, or ReelFile
        A complete stream from `encode`, its file, or its address, such as
        ``s3://bucket/walk.reel`` (extra ``[s3]``).
    frames : slice, optional
        Frames to return, as ``sequence[frames]``; only the blocks that contain them are decoded.
        Default: all.
    n_modes : int, optional
        Number of leading modes to decode in each block; fewer give a coarser animation, faster,
        without corrections. In streams of `reel` further modes, at least up to the 16th, keep their
        mean over the block; the paper's methods omit further rows of coefficients (the paper's
        k_l); streams of `lossless` and `grid` have no modes. Default: all. For a `ReelFile`, pass
        it to `meshreel.open`.
    segment : int, optional
        Decode this segment alone, numbered from 0 as `info` lists them; its frames count from 0.
        Default: all. For a `ReelFile`, pass it to `meshreel.open`.
    memory : float or str, optional
        Memory limit for frames and tracks together, for the mesh, and for a block, such as "2GiB"
        or a number of bytes: a small file may contain a long animation in which little changes, or
        be crafted to exhaust memory. Default: 2 GiB. For a `ReelFile`, pass it to `meshreel.open`.
    progress : callable, optional
        Called with the stage and the completed fraction, 0..1.

    Raises
    ------
    InvalidInputError
        If the file or segment does not exist, `frames` selects no frame, or `n_modes` is below 1 or
        does not apply to this stream.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If `data` is not a complete stream that this build reads; the error names the file.
    MemoryLimitError
        If decoding would exceed `memory`; raised before the allocation.
    """
    if isinstance(data, ReelFile):
        for name, value in {"n_modes": n_modes, "segment": segment, "memory": memory}.items():
            if value is not None:
                raise InvalidInputError(f"for a ReelFile, pass {name} to meshreel.open")
        return data[slice(None) if frames is None else frames]
    if frames is not None and is_remote(data):
        with open_reel(data, n_modes=n_modes, segment=segment, memory=memory) as reel:
            return reel[frames]
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
        memory,
    )


def info(data: Stream | AnyPath | ReelFile, *, segment: int | None = None) -> StreamInfo:
    """Contents of a `.reel` stream, its segments, and its bytes by section.

    Parameters
    ----------
    data : bytes, path, or ReelFile
        A complete stream, its file, or its address. Of a remote file only the index and the section
        headers are fetched; checksums are not verified.
    segment : int, optional
        Describe this segment alone. For a `ReelFile`, pass it to `meshreel.open`.

    Raises
    ------
    InvalidInputError
        If the file does not exist.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If `data` is not a complete stream that this build reads; the error names the file.
    """
    if isinstance(data, ReelFile):
        if segment is not None:
            raise InvalidInputError("for a ReelFile, pass segment to meshreel.open")
        return data.info()
    if is_remote(data):
        return read_info(data, segment)
    return _with_stream(data, "info", lambda stream: streams.info(stream, segment))


@takes_fields(RegisterOptions)
def register(source: AnyInput, options: RegisterOptions) -> MeshSequence:
    """Replace the meshes of a raw capture by few meshes that follow its surface.

    A capture has a new mesh in every frame. Registration deforms the mesh of a key frame to fit
    the frames before and after it, as far as the tolerance is met, so that many frames share one
    connectivity: a segment. `meshreel.encode` compresses such segments many times better.

    Parameters
    ----------
    source : MeshSequence, path, bytes, or ReelFile
        Raw frames, as `encode` accepts them. Frames that stay in their files are read four times.
    options
        The fields of `RegisterOptions`.
    progress : callable, optional
        Called with the stage and the completed fraction, 0..1.

    Returns
    -------
    MeshSequence
        Frames that cannot be followed are segments of their own, with their raw mesh. Segments of
        several frames have the texture coordinates, groups and materials of their key frame, and
        the other values of vertices, such as colors, as tracks. A warning names what was removed or
        omitted. `meshreel.compare(source, result)` measures its distance from the raw surface.

    Raises
    ------
    InvalidInputError
        If the tolerance or the quality is not valid, no frame has a face with an area, `folder`
        contains something else, the textures do not fit the frames, the frames have values called
        ``scanned`` while holes are kept, or the extra [register] is not installed.
    FormatError
        If a texture cannot be read, or its output has another format.
    """
    require(extras_to_register(options))
    check_scheduler(options)
    reading, notes = Reading(matches_frames=False, finds_hard_edges=False), Notes()
    with opened(source, reading) as frames:
        _warn([note for note in reading.notes if note.kind is not NoteKind.SEGMENTS])
        parts = open_part(cast("Source", source), reading) if is_path(source) else None
        registered = register_frames(frames, options, notes, options.progress, parts)
        registered.bake(registered.sequence, options.progress)
    _warn([*registered.registration.changes, *notes])
    return registered.sequence


def rig(
    source: AnyInput,
    bones: int | None = None,
    *,
    max_error: float | str | None = None,
    kg: float | None = None,
    quality: float | None = None,
    unit: str | None = None,
    progress: Progress = silent,
) -> "Rig":
    """Fit bones, at most four weights per vertex and a rest pose to an animation.

    Bones are added until the errors are within their bounds, and then corrective morph targets.
    Errors are those of what engines show: quantized weights, keys and positions, in float32.
    ``meshreel.save(sequence, "walk.glb", rig=True)`` and ``.usdc`` write such a rig.

    Parameters
    ----------
    source : MeshSequence, path, bytes, or ReelFile
        An animation with the same faces in all frames, as `encode` accepts it.
    bones : int, optional
        Maximum number of bones, 1 to 256. Default: 256.
    max_error : float or str, default 1
        Largest distance of a vertex from its position, in percent of the diagonal of the bounding
        box of all frames, or text such as "0.5u" (model units) or "1mm" (with `unit`).
    kg : float, default 0.5
        Largest KG error, in percent.
    quality : float, optional
        In place of `max_error` and `kg`: errors of positions are at most those of a .reel of this
        quality, 1 to 100. Normals of bones are worse.
    unit : {"mm", "cm", "m", "km", "in", "ft"}, optional
        Length unit of the model, for a `max_error` that is a length.
    progress : callable, optional
        Called with the stage and the completed fraction, 0..1.

    Returns
    -------
    Rig
        Immutable: rest pose, weights, skeleton, keys, correctives and `errors`; ``positions()``
        returns the vertices in all frames.

    Raises
    ------
    ConnectivityChangeError
        If the faces change; `register` makes them constant.
    InvalidInputError
        If 256 bones and 64 corrective targets do not meet the bounds, or a bound or `bones` is out
        of range.

    Notes
    -----
    Skinning decomposition of Le and Deng, "Smooth skinning decomposition with rigid bones",
    SIGGRAPH Asia 2012.
    """
    from meshreel.rigging.fitting import bounds_of, fit_sequence  # slow to import

    reading = Reading()
    sequence = loaded(source, reading)
    _warn(reading.notes, stacklevel=3)
    bounds = bounds_of(sequence, quality=quality, kg=kg, max_error=max_error, unit=unit)
    return fit_sequence(sequence, bones=bones, bounds=bounds, progress=progress)


@overload
def compare(
    original: AnyInput,
    decoded: AnyInput,
    *,
    surface: Literal[True],
    n_samples: int | None = None,
    progress: Progress = silent,
) -> "SurfaceQuality": ...


@overload
def compare(
    original: AnyInput,
    decoded: AnyInput,
    *,
    surface: Literal[False],
    n_samples: None = None,
    progress: Progress = silent,
) -> "Quality": ...


@overload
def compare(
    original: AnyInput,
    decoded: AnyInput,
    *,
    surface: bool | None = None,
    n_samples: int | None = None,
    progress: Progress = silent,
) -> "Quality | Any": ...


def compare(
    original: AnyInput,
    decoded: AnyInput,
    *,
    surface: bool | None = None,
    n_samples: int | None = None,
    progress: Progress = silent,
) -> "Quality | SurfaceQuality | Any":
    """All quality metrics of a decoded sequence, computed in float64.

    Sequences of the same mesh are compared vertex by vertex: the result is a `Quality`. If their
    vertex counts or triangles differ, or change over time, the distances between their surfaces
    are measured: the result is a `SurfaceQuality`.

    Parameters
    ----------
    original, decoded : MeshSequence, path, bytes, or ReelFile
        Sequences, inputs of `load`, or `.reel` streams, of equal frame counts. Meshes are the
        same if they have equal vertex counts and the same oriented triangles; the order of the
        triangles, and the vertex at which each begins, may differ. So may the order of vertices,
        if the decoded one is that of a stream of the original with ``order="drop"``.
    surface : bool, optional
        True measures distances between surfaces in any case; False compares vertices, and fails
        if the meshes differ. Default: as above.
    n_samples : int, optional
        Samples per frame on each surface. Default: 50,000.
    progress : callable, optional
        Called as ``progress("comparing", fraction)``.

    Raises
    ------
    InvalidInputError
        If there is no such file, frame counts differ, a frame has no face with an area where
        surfaces are compared, or `n_samples` is given where vertices are compared.
    """
    from meshreel.operations.compare import compare as measure  # slow to import

    reading = Reading(progress=progress)
    quality = measure(original, decoded, reading, Notes(), surface=surface, n_samples=n_samples)
    _warn(reading.notes, stacklevel=3)
    return quality


def _with_stream(
    stream: Any, caller: str, function: Callable[[bytes], Result], memory: float | str | None = None
) -> Result:
    """Call `function` with the bytes of a stream or of its file, which fits in `memory` if remote.

    Errors name the file.
    """
    if isinstance(stream, Stream):
        return function(bytes(stream))
    if is_remote(stream):
        data = read_whole(stream, memory_limit(memory).limit_bytes)
        with errors_naming(stream):
            return function(data)
    if isinstance(stream, str | os.PathLike):
        path = Path(stream)
        check_input_file(path)
        if not path.is_file():
            problem = "is a folder" if path.is_dir() else "does not exist"
            raise InvalidInputError(f"{str(path)!r} {problem}; give the path of a .reel file")
        with os_errors_naming(path):
            data = path.read_bytes()
        with errors_naming(path):
            return function(data)
    raise InvalidInputError(
        f"{caller} takes the bytes of a .reel stream, or the path of a .reel file; got "
        f"{type(stream).__name__}"
    )


def _warn(notes: Iterable[str], stacklevel: int = 4) -> None:
    """Warn once of each change or omission."""
    for note in dict.fromkeys(notes):
        warnings.warn(note, stacklevel=stacklevel)
