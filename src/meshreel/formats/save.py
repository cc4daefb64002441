"""Saving of sequences and of streamed frames in any format."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import NO_TRACKS, FolderFormat, FrameFormat, SequenceFormat
from meshreel.formats.notes import note_unwritten_materials, note_unwritten_tracks
from meshreel.formats.options import WriteOptions, origin_of
from meshreel.formats.outputs import DEFAULT_OPTIONS, check_output, is_pattern, numbering
from meshreel.formats.registry import FRAME_FORMATS, output_format_of
from meshreel.formats.remote import uploaded
from meshreel.formats.sources import AnyPath
from meshreel.formats.surfaces.images import image_folder, image_names
from meshreel.model.frame_choice import start_of
from meshreel.model.sequence import FrameSource, Vertices
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.tracks import TrackPart, TrackSource
from meshreel.runtime.counting import plural
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.profiling import staged
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.codec.reel_file import ReelFile


def save(
    sequence: "FrameSource | ReelFile",
    output: AnyPath,
    *,
    overwrite: bool = False,
    start_number: int | None = None,
    options: WriteOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> list[Path] | list[str]:
    """Save a sequence; return the written files in frame order, or addresses of a remote output.

    All files appear together when the last one is complete; on an error none appears.

    Parameters
    ----------
    sequence : MeshSequence, FrameSource or ReelFile
        Read a frame at a time. For a `ReelFile` of `meshreel.open`, the error that glTF declares is
        against the original, if the stream guarantees an error bound.
    output : str or Path
        ``name.npz``, ``.reel``, ``.abc``, ``.usd``, ``.glb`` and others for all frames in one
        file (`meshreel formats` lists them), or such an address, like ``s3://bucket/walk.glb``
        (extra ``[remote]``); a pattern with a number field such as ``dir/frame_%04d.obj`` for one
        file per frame, whose folder is created if it is missing; ``name.obj`` for a sequence of
        one frame; or ``name.vat`` for a folder of vertex animation textures. Images of
        ``name.usdc`` are written to a folder ``name_textures``.
    overwrite : bool, default False
        Whether existing files may be replaced. Files that the sequence is read from never are.
    start_number : int, optional
        Number of the first file of a pattern; default 0.
    options : WriteOptions, optional
        Options of the format.
    progress : Progress, default silent
        Called with the share of frames written.
    notes : list of str, optional
        Receives a sentence for each thing that the format cannot store exactly, and the error of
        lossy formats.

    Notes
    -----
    ``.npz``, ``.ply``, ``.obj`` and ``.off`` store float32 and float64 exactly (but
    `meshreel.formats.load.load` reads the text of the last two as float32 if that suffices).
    ``.stl`` stores float32, and loses vertices that are unused or always coincide.

    Raises
    ------
    FormatError, InvalidInputError
        As `meshreel.formats.outputs.check_output`, before anything is written.
    StoreError
        If a remote output cannot be written.
    """
    with uploaded(output, overwrite=overwrite) as target:
        written = save_part(
            sequence,
            range(sequence.n_frames),
            target.local,
            overwrite=overwrite,
            start_number=start_number,
            options=options,
            progress=progress,
            notes=notes,
        )
    return [target.name(path) for path in written] if target.is_remote else written


@staged("writing")
def save_part(
    sequence: "FrameSource | ReelFile",
    wanted: range,
    output: AnyPath,
    *,
    overwrite: bool = False,
    start_number: int | None = None,
    inputs: Iterable[Path] = (),
    options: WriteOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> list[Path]:
    """Save a range of frames; return the written files. See `save`.

    Parameters
    ----------
    wanted : range
        Consecutive frame numbers; the start time is adjusted.
    start_number : int, optional
        Number of the first file of a pattern; default the number of its frame.
    inputs : iterable of Path
        Further input files, which are never replaced.
    sequence, output, overwrite, options, progress, notes
        As in `save`.

    Raises
    ------
    FormatError, InvalidInputError
        As `save`.
    """
    if options.origin is None:
        options = replace(options, origin=origin_of(sequence))
    return save_frames(
        (sequence.read(index, index + 1) for index in wanted),
        sequence.faces,
        output,
        n_frames=len(wanted),
        fps=sequence.fps,
        name=sequence.name,
        start_s=start_of(wanted, sequence.start_s, sequence.fps),
        surface=sequence.surface,
        tracks={name: TrackPart(track, wanted) for name, track in sequence.tracks.items()},
        overwrite=overwrite,
        start_number=numbering(output, wanted, start_number),
        inputs=(*inputs, *getattr(sequence, "files", ())),
        options=options,
        progress=progress,
        notes=notes,
    )


def save_frames(
    blocks: Iterable[Vertices],
    faces: npt.NDArray[np.integer],
    output: AnyPath,
    *,
    n_frames: int,
    fps: float = 0.0,
    name: str = "",
    start_s: float = 0.0,
    surface: Surface = PLAIN,
    tracks: Mapping[str, TrackSource] | None = None,
    overwrite: bool = False,
    start_number: int | None = None,
    inputs: Iterable[Path] = (),
    options: WriteOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> list[Path]:
    """Save streamed frames; return the written files in frame order.

    Needs memory for one block and one frame; only ``.reel`` and glTF need all frames. All files
    appear together when the last one is complete; on an error none appears.

    Parameters
    ----------
    blocks : iterable of float32 or float64 arrays of shape (T, V, 3)
        Positions in model units, in order, all of one type. Blocks may differ in T.
    faces : integer array of shape (M, 3)
        Vertex indices of each triangle, in 0..V-1.
    output, overwrite, start_number, options, progress, notes
        As in `save`.
    inputs : iterable of Path
        Input files, which are never replaced.
    n_frames : int
        Total of all blocks.
    fps, name, start_s, surface
        As in `MeshSequence`.
    tracks : mapping of str to TrackSource, optional
        Tracks with `n_frames` frames; those that the format cannot store are left out with a note.

    Raises
    ------
    FormatError, InvalidInputError
        As `meshreel.formats.outputs.check_output`, before the first block is read; also as
        `FrameStream`.
    """
    if n_frames < 1:
        raise InvalidInputError(f"a sequence needs at least one frame; got n_frames {n_frames}")
    paths = check_output(
        output,
        n_frames,
        overwrite=overwrite,
        start_number=start_number,
        inputs=inputs,
        options=options,
    )
    found = output_format_of(Path(output))
    stream = FrameStream(
        blocks,
        faces,
        n_frames=n_frames,
        fps=fps,
        name=name,
        start_s=start_s,
        surface=surface,
        progress=progress,
        notes=notes,
        tracks=_supported_tracks(found, tracks or {}, notes),
    )
    if isinstance(found, FrameFormat) or (
        isinstance(found, SequenceFormat) and not found.holds_materials
    ):
        note_unwritten_materials(stream.surface, found.extension, stream.notes)
    images = _image_paths(found, paths[0], stream)
    with replace_all_when_done(
        [*images, *paths],
        overwrite=overwrite,
        makes_folder=bool(images) or is_pattern(output) or len(paths) > 1,
    ) as hidden:
        if isinstance(found, FolderFormat):
            found.write(hidden[0].parent, Path(output).stem, stream, options)
            progress("writing", 1.0)
            return paths
        for path, image in zip(hidden, stream.surface.images[: len(images)], strict=False):
            path.write_bytes(image.data)
        temporaries = hidden[len(images) :]
        if isinstance(found, SequenceFormat):
            if found.data_files is not None:
                names = [path.relative_to(paths[0].parent).as_posix() for path in paths[1:]]
                stream.data_files = list(zip(names, temporaries[1:], strict=True))
            _write_sequence(found, temporaries, stream, options)
            progress("writing", 1.0)
            return [*paths, *images]
        encode = frame_encoder(found, stream)
        for index, (frame, temporary) in enumerate(zip(stream.frames(), temporaries, strict=True)):
            temporary.write_bytes(encode(index, frame))
    return paths


def _supported_tracks(
    found: FrameFormat | SequenceFormat | FolderFormat,
    tracks: Mapping[str, TrackSource],
    notes: list[str] | None,
) -> dict[str, TrackSource]:
    """Return the tracks that a format can store; the notes list the others."""
    domains = NO_TRACKS if isinstance(found, FolderFormat) else found.holds_tracks
    note_list = notes if notes is not None else []
    for missing in [one for one in Domain if one not in domains] if domains else []:
        names = [name for name, track in tracks.items() if track.domain is missing]
        note_unwritten_tracks(names, found.extension, note_list, f"tracks of {plural(missing)}")
    if not domains:
        note_unwritten_tracks(tracks, found.extension, note_list)
    return {name: track for name, track in tracks.items() if track.domain in domains}


def _image_paths(
    found: FrameFormat | SequenceFormat | FolderFormat, path: Path, stream: FrameStream
) -> list[Path]:
    """Return the paths of images stored as separate files, and set the stream's image folder."""
    images = stream.surface.images
    if not (images and isinstance(found, SequenceFormat) and found.has_image_folder):
        return []
    folder = image_folder(path)
    stream.image_folder = folder.name
    return [folder / name for name in image_names(images)]


def _write_sequence(
    found: SequenceFormat, paths: list[Path], stream: FrameStream, options: WriteOptions
) -> None:
    """Write all frames to the first path, and the first frame to the companion file, if any."""
    if found.write is None:  # check_output rejects read-only formats
        raise FormatError(f"{found.extension} files are read, but not written")
    if found.companion:
        encode = frame_encoder(FRAME_FORMATS[found.companion], stream)
        paths[1].write_bytes(encode(0, stream.first))
    found.write(paths[0], stream, options)


def frame_encoder(found: FrameFormat, stream: FrameStream) -> Callable[[int, Vertices], bytes]:
    """Return a function from the number and positions of a frame to the bytes of its file."""
    if found.encoder is None:  # check_output rejects read-only formats
        raise FormatError(f"{found.extension} files are read, but not written")
    if not found.holds_tracks:
        encode = found.encoder(stream.faces, stream.surface, stream.notes)
        return lambda index, frame: encode(frame)
    encode_all = found.encoder(stream.faces, stream.surface, stream.notes, stream.tracks)
    return lambda index, frame: encode_all(frame, stream.values(index))
