"""The files that an output means, and whether they may be written."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.kinds import FolderFormat, SequenceFormat
from meshreel.formats.notes import listed
from meshreel.formats.options import WriteOptions
from meshreel.formats.registry import FOLDER_FORMATS, format_of, is_written, written_endings
from meshreel.formats.sources import AnyPath
from meshreel.formats.supported_options import check_write_options
from meshreel.runtime.outputs.checks import check_output_paths

NUMBER_FIELD = re.compile(r"%(0?)(\d{0,2})d")
DEFAULT_OPTIONS = WriteOptions()


def check_output(
    output: AnyPath,
    n_frames: int | None = None,
    *,
    overwrite: bool,
    start_number: int | None = None,
    inputs: Iterable[Path] = (),
    options: WriteOptions = DEFAULT_OPTIONS,
) -> list[Path]:
    """The files that saving to `output` will write, once they are known to be allowed.

    Call it before long work, so that the work is not lost.

    Parameters
    ----------
    output : str or Path
        As in `meshreel.formats.save.save`.
    n_frames : int, optional
        Number of frames; without it only the first file of a pattern is checked.
    overwrite : bool
        Whether files that are there already may be replaced.
    start_number : int, optional
        Number of the first file of a pattern; default 0.
    inputs : iterable of Path
        The files that the frames are made of, which are never replaced.
    options : WriteOptions, optional
        Choices that a format has.

    Raises
    ------
    FormatError
        If the output is a folder, its ending is unknown, files of that kind are not written, or
        the library that writes them is not installed.
    InvalidInputError
        If the folder of the output takes no files or, but for a pattern, does not exist, a file is
        an input, or is there already and `overwrite` is false, several frames are to go into one
        file that holds one, or an option or `start_number` has no effect.
    """
    path = Path(output)
    if (found := FOLDER_FORMATS.get(path.suffix.lower())) is not None:
        return _check_folder(
            path, found, start_number, options, overwrite=overwrite, inputs=list(inputs)
        )
    if path.is_dir() or str(output).endswith(("/", os.sep)):
        raise FormatError(
            f"{str(output)!r} is a folder, which says no format; give a pattern such as "
            f"{path / 'frame_%04d.obj'}, or a name that ends in {', '.join(FOLDER_FORMATS)}"
        )
    paths = _files_of(path, n_frames, start_number)
    check_write_options(chosen := format_of(path), options)
    inputs = list(inputs)
    if isinstance(chosen, SequenceFormat) and chosen.data_files is not None:
        check_output_paths([path], overwrite=overwrite, inputs=inputs)
        beside = chosen.data_files(path, n_frames or 1)
        check_output_paths(beside, overwrite=overwrite, inputs=inputs, makes_folder=True)
        return [path, *beside]
    check_output_paths(paths, overwrite=overwrite, inputs=inputs, makes_folder=is_pattern(path))
    return paths


def is_pattern(output: AnyPath) -> bool:
    """Whether an output has a number field, for a file a frame."""
    return NUMBER_FIELD.search(Path(output).name) is not None


def numbering(output: AnyPath, wanted: range, start_number: int | None) -> int | None:
    """The number of the first file: that which is asked for, else of a pattern that of its frame.

    Parameters
    ----------
    output : str or Path
    wanted : range
        Numbers of the frames.
    """
    return wanted.start if start_number is None and is_pattern(output) else start_number


def _check_folder(
    path: Path,
    found: FolderFormat,
    start_number: int | None,
    options: WriteOptions,
    *,
    overwrite: bool,
    inputs: list[Path],
) -> list[Path]:
    """The files of a folder, as `check_output` gives them.

    Files of another run among them are refused: programs take what they find in a folder.
    """
    _check_start_number(path, start_number)
    if NUMBER_FIELD.search(path.name):
        raise InvalidInputError(
            f"{path} has a number field, but a {found.ending} folder holds all frames; "
            f"give a name such as {path.with_name(f'frames{path.suffix}')}"
        )
    check_write_options(found, options)
    found.extra.load()
    paths = found.files(path, options)
    check_output_paths(paths, overwrite=overwrite, inputs=inputs, makes_folder=True)
    endings = {one.suffix for one in paths} | {".png", ".exr"}
    others = set(path.iterdir()) - set(paths) if path.is_dir() else set()
    if alike := sorted(one.name for one in others if one.suffix.lower() in endings):
        raise InvalidInputError(
            f"{path} holds files that these are not to be mixed with: {listed(alike)}; "
            "remove them, or name another folder"
        )
    return paths


def _files_of(path: Path, n_frames: int | None, start_number: int | None) -> list[Path]:
    fields = list(NUMBER_FIELD.finditer(path.name))
    if not is_written(found := format_of(path)):
        raise FormatError(
            f"{path}: {found.ending} files are read, but not written; "
            f"written are {', '.join(written_endings())}"
        )
    _check_start_number(path, start_number)
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
        first = start_number or 0
        numbers = range(first, first + (1 if n_frames is None else n_frames))
        return [path.with_name(_numbered(path.name, fields[0], number)) for number in numbers]
    if n_frames is not None and n_frames > 1:
        pattern = path.with_name(f"{path.stem}_%04d{path.suffix}")
        raise InvalidInputError(
            f"{path} holds one frame and there are {n_frames}; give a pattern such as {pattern}, "
            f"or {path.with_suffix('.npz')} for all frames in one file"
        )
    return [path]


def _check_start_number(path: Path, start_number: int | None) -> None:
    if start_number is None:
        return
    if start_number < 0:
        raise InvalidInputError(
            f"--start-number (start_number=) must be 0 or more; got {start_number}"
        )
    if not is_pattern(path):
        raise InvalidInputError(
            "--start-number (start_number=) says where the numbers of files begin, and "
            f"{path} has none; give a pattern such as {path.with_name('frame_%04d.obj')}"
        )


def _numbered(name: str, field: re.Match[str], number: int) -> str:
    fill, width = field.groups()
    return f"{name[: field.start()]}{number:{fill}{width}d}{name[field.end() :]}"
