"""Which files a target means, and whether they may be written."""

import os
import re
from pathlib import Path

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.registry import FORMATS, format_of, is_written
from meshreel.formats.sources import AnyPath
from meshreel.outputs.checks import check_output_path

NUMBER_FIELD = re.compile(r"%(0?)(\d{0,2})d")


def check_save_target(
    target: AnyPath, n_frames: int | None = None, *, overwrite: bool
) -> list[Path]:
    """The files that saving to `target` will write, once they are known to be allowed.

    Call it before long work, so that the work is not lost.

    Parameters
    ----------
    target : str or Path
        As in `meshreel.formats.save.save`.
    n_frames : int, optional
        Number of frames; without it only the first file of a pattern is checked.
    overwrite : bool
        Whether files that are there already may be replaced.

    Raises
    ------
    FormatError
        If the target is a folder, its ending is unknown, files of that kind are not written, or
        the library that writes them is not installed.
    InvalidInputError
        If the folder of the target does not exist, a file is there already and `overwrite` is
        false, or several frames are to go into one file that holds one.
    """
    path = Path(target)
    if path.is_dir() or str(target).endswith(("/", os.sep)):
        raise FormatError(
            f"{str(target)!r} is a folder, which says no format; give a pattern such as "
            f"{path / 'frame_%04d.obj'}"
        )
    paths = _files_of(path, n_frames)
    for file in paths:
        check_output_path(file, overwrite=overwrite)
    return paths


def _files_of(path: Path, n_frames: int | None) -> list[Path]:
    fields = list(NUMBER_FIELD.finditer(path.name))
    if not is_written(found := format_of(path)):
        written = [one.ending for one in FORMATS.values() if is_written(one)]
        raise FormatError(
            f"{path}: {found.ending} files are read, but not written; "
            f"written are {', '.join(written)}"
        )
    if isinstance(found, SequenceFormat):
        if fields:
            raise InvalidInputError(
                f"{path} has a number field, but a {found.ending} file holds all frames; "
                f"give a name such as {path.with_name(f'frames{path.suffix}')}"
            )
        if found.extra is not None:
            found.extra.load()
        return [path, path.with_suffix(found.companion)] if found.companion else [path]
    if len(fields) > 1:
        raise InvalidInputError(f"{path} has {len(fields)} number fields; one is needed")
    if fields:
        numbers = range(1 if n_frames is None else n_frames)
        return [path.with_name(_numbered(path.name, fields[0], number)) for number in numbers]
    if n_frames is not None and n_frames > 1:
        pattern = path.with_name(f"{path.stem}_%04d{path.suffix}")
        raise InvalidInputError(
            f"{path} holds one frame and there are {n_frames}; give a pattern such as {pattern}, "
            f"or {path.with_suffix('.npz')} for all frames in one file"
        )
    return [path]


def _numbered(name: str, field: re.Match[str], number: int) -> str:
    fill, width = field.groups()
    return f"{name[: field.start()]}{number:{fill}{width}d}{name[field.end() :]}"
