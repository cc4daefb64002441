"""Saving of sequences and streams in any format."""

import os
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.open_stream import whole_file
from meshreel.codec.option import check_names, lists_fields
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.load import is_path, sequence_of
from meshreel.formats.options import WriteOptions
from meshreel.formats.outputs import DEFAULT_OPTIONS, check_output
from meshreel.formats.rigs import FittedRig
from meshreel.formats.save import save_part
from meshreel.formats.sources import AnyPath
from meshreel.model.notes import Notes
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource
    from meshreel.model.sequence import FrameSource


@lists_fields(WriteOptions)
def save(
    sequence: "AnySource | FrameSource | bytes | bytearray | memoryview",
    output: AnyPath,
    *,
    overwrite: bool = False,
    start_number: int | None = None,
    options: WriteOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
    notes: list[str] | None = None,
    **settings: Any,
) -> list[Path]:
    """Save a sequence; return the written files in frame order.

    All files appear together when the last one is complete; on an error none appears.

    Parameters
    ----------
    sequence : MeshSequence, ReelFile, FrameSource, or bytes of a stream
        Read a frame at a time. For a file of `meshreel.open`, the error that glTF declares is
        against the original, if the stream guarantees an error bound. Bytes are written unchanged
        to a ``.reel``, unless there are options.
    output : str or Path
        ``name.npz``, ``.reel``, ``.abc``, ``.usd``, ``.glb`` and others for all frames in one
        file (`meshreel formats` lists them); a pattern with a number field such as
        ``dir/frame_%04d.obj`` for one file per frame, whose folder is created if it is missing;
        ``name.obj`` for a sequence of one frame; or ``name.vat`` for a folder of vertex animation
        textures. Images of ``name.usdc`` are written to a folder ``name_textures``.
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
    **settings
        Fields of `options` by name, such as ``max_error=0.1``:
    options
        The fields of `WriteOptions`.

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
        If the output is an address.
    """
    check_names(settings, [field.name for field in fields(WriteOptions)])
    options = replace(options, **settings)
    if not isinstance(output, str | os.PathLike) or is_path(sequence):
        raise InvalidInputError(
            "save takes a sequence and then a path, save(sequence, 'walk.npz'); got "
            f"{type(sequence).__name__} and {type(output).__name__}; meshreel.load reads files, "
            "meshreel.encode returns the bytes of a .reel"
        )
    is_stream = isinstance(sequence, bytes | bytearray | memoryview) and options == DEFAULT_OPTIONS
    if is_stream and Path(output).suffix.lower() == ".reel":
        data = bytes(sequence)  # type: ignore[arg-type]
        whole_file(data)  # raises unless the stream is complete
        paths = check_output(output, overwrite=overwrite)
        with replace_all_when_done(paths, overwrite=overwrite) as [hidden_path]:
            hidden_path.write_bytes(data)
        return paths
    source = sequence if isinstance(sequence, ReelFile) else sequence_of(sequence)
    new_notes = None if notes is None else Notes()
    paths = save_part(
        source, range(source.n_frames), output,
        overwrite=overwrite, start_number=start_number, options=options, progress=progress,
        notes=new_notes, fit_rig=_fit_rig,
    )  # fmt: skip
    if notes is not None:
        notes.extend(new_notes or ())
    return paths


def _fit_rig(
    stream: SegmentedStream, options: WriteOptions, max_bones: int | None
) -> FittedRig | None:
    from meshreel.operations.rigs import fit_rig  # slow to import

    return fit_rig(stream, options, max_bones)
