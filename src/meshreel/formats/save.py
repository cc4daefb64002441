"""A `MeshSequence` to files of other programs."""

from contextlib import ExitStack
from pathlib import Path

from meshreel.atomic_write import replace_when_done
from meshreel.formats.registry import SequenceFormat, format_of
from meshreel.formats.sources import AnyPath
from meshreel.formats.targets import check_save_target
from meshreel.progress import Progress, silent
from meshreel.sequence import MeshSequence


def save(
    sequence: MeshSequence,
    target: AnyPath,
    *,
    overwrite: bool = False,
    progress: Progress = silent,
) -> list[Path]:
    """The files written, in the order of the frames.

    All files appear together when the last one is complete; on an error none does.

    Parameters
    ----------
    sequence : MeshSequence
        What to write.
    target : str or Path
        ``name.npz`` or ``name.reel`` for all frames in one file; a pattern with a number field
        such as ``dir/frame_%04d.obj`` for a file a frame, numbered from 0; or ``name.obj`` for
        a sequence of one frame. Endings: ``.npz .reel .obj .ply .off .stl``.
    overwrite : bool, default False
        Whether files that are there already may be replaced.
    progress : Progress, default silent
        Told the share of frames written.

    Notes
    -----
    ``.npz``, ``.ply``, ``.obj`` and ``.off`` hold every float32 and float64 exactly (but
    `meshreel.formats.load.load` reads the text of the last two as float32 where that suffices).
    ``.stl`` is float32, and forgets vertices that no face uses or that always coincide.

    Raises
    ------
    FormatError, InvalidInputError
        As `meshreel.formats.targets.check_save_target`, before anything is written.
    """
    paths = check_save_target(target, sequence.n_frames, overwrite=overwrite)
    found = format_of(paths[0])
    with ExitStack() as renames:  # the files get their names when the stack unwinds
        temporaries = [
            renames.enter_context(replace_when_done(path, overwrite=overwrite)) for path in paths
        ]
        if isinstance(found, SequenceFormat):
            found.write(temporaries[0], sequence)
            progress("writing", 1.0)
            return paths
        encode = found.encoder(sequence.faces)
        for index, temporary in enumerate(temporaries):
            temporary.write_bytes(encode(sequence.vertices[index]))
            progress("writing", (index + 1) / sequence.n_frames)
    return paths
