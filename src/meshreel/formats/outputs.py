"""Resolution of an output to its files, and checks before writing."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.kinds import FolderFormat, SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.registry import (
    ADVICE,
    FOLDER_FORMATS,
    format_of,
    is_written,
    written_extensions,
)
from meshreel.formats.sources import NUMBER_FIELD, AnyPath
from meshreel.formats.supported_options import check_write_options
from meshreel.model.notes import listed
from meshreel.runtime.outputs.checks import check_output_paths
from meshreel.runtime.stores.address import refuse_address

OTHER_FIELD = re.compile(r"#{2,}|\$F\d?|<frame>", re.IGNORECASE)
"""Number fields of other programs: ####, $F4, <frame>."""

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
    """Check an output; return the files that saving to it will write.

    Call it before long computations, so that their results are not lost.

    Parameters
    ----------
    output : str or Path
        As in `meshreel.save`.
    n_frames : int, optional
        Number of frames; by default only the first file of a pattern is checked.
    overwrite : bool
        Whether existing files may be replaced.
    start_number : int, optional
        Number of the first file of a pattern; default 0.
    inputs : iterable of Path
        Input files, which are never replaced.
    options : WriteOptions, optional
        Options of the format.

    Raises
    ------
    FormatError
        If the output is a folder, its extension is unknown or read-only, or a required library is
        not installed.
    InvalidInputError
        If the folder of the output is not writable or (except for patterns) does not exist, a file
        is an input, or exists and `overwrite` is false, several frames are written to a file for
        one, or an option or `start_number` has no effect.
    StoreError
        If it is an address.
    """
    refuse_address(output, "the output")
    path = Path(output)
    if (folder_format := FOLDER_FORMATS.get(path.suffix.lower())) is not None:
        return _check_folder(
            path, folder_format, start_number, options, overwrite=overwrite, inputs=list(inputs)
        )
    if path.is_dir() or str(output).endswith(("/", os.sep)):
        raise FormatError(
            f"{str(output)!r} is a folder, which does not select a format; use a pattern such as "
            f"{path / 'frame_%04d.obj'}, or a name with the extension {', '.join(FOLDER_FORMATS)}"
        )
    paths = _files_of(path, n_frames, start_number)
    check_write_options(file_format := format_of(path), options)
    inputs = list(inputs)
    if file_format.data_files is not None:
        check_output_paths([path], overwrite=overwrite, inputs=inputs)
        data_files = file_format.data_files(path, n_frames or 1)
        check_output_paths(data_files, overwrite=overwrite, inputs=inputs, makes_folder=True)
        return [path, *data_files]
    check_output_paths(paths, overwrite=overwrite, inputs=inputs, makes_folder=is_pattern(path))
    return paths


def is_pattern(output: AnyPath) -> bool:
    """Whether an output has a number field, for one file per frame."""
    return NUMBER_FIELD.search(Path(output).name) is not None


def numbering(output: AnyPath, frames: range, start_number: int | None) -> int | None:
    """Return the number of the first file: `start_number`, or for a pattern that of its frame.

    Parameters
    ----------
    frames : range
        Frame numbers.
    """
    return frames.start if start_number is None and is_pattern(output) else start_number


def _check_folder(
    path: Path,
    folder_format: FolderFormat,
    start_number: int | None,
    options: WriteOptions,
    *,
    overwrite: bool,
    inputs: list[Path],
) -> list[Path]:
    """Check an output folder; return its files as `check_output` does.

    Folders with other files of these kinds are rejected, because programs use all files there.
    """
    _check_start_number(path, start_number)
    if NUMBER_FIELD.search(path.name):
        raise InvalidInputError(
            f"{path} has a number field, but a {folder_format.extension} folder contains all "
            f"frames; give a name such as {path.with_name(f'frames{path.suffix}')}"
        )
    check_write_options(folder_format, options)
    if folder_format.extra is not None:
        folder_format.extra.load()
    paths = folder_format.files(path, options)
    check_output_paths(paths, overwrite=overwrite, inputs=inputs, makes_folder=True)
    extensions = {file.suffix for file in paths} | {".png", ".exr"}
    other_files = set(path.iterdir()) - set(paths) if path.is_dir() else set()
    if conflicts := sorted(
        other.name for other in other_files if other.suffix.lower() in extensions
    ):
        raise InvalidInputError(
            f"{path} contains files that must not be mixed with the output: {listed(conflicts)}; "
            "remove them, or choose another folder"
        )
    return paths


def _files_of(path: Path, n_frames: int | None, start_number: int | None) -> list[Path]:
    fields = list(NUMBER_FIELD.finditer(path.name))
    if not is_written(file_format := format_of(path)):
        raise FormatError(
            f"{path}: {file_format.extension} files can be read, but not written; "
            + ADVICE.get(file_format.extension, f"writable are {', '.join(written_extensions())}")
        )
    _check_start_number(path, start_number)
    if isinstance(file_format, SequenceFormat):
        if fields:
            raise InvalidInputError(
                f"{path} has a number field, but a {file_format.extension} file contains all "
                f"frames; give a name such as {path.with_name(f'frames{path.suffix}')}"
            )
        if file_format.extra is not None:
            file_format.extra.load()
        return [path, path.with_suffix(file_format.companion)] if file_format.companion else [path]
    if len(fields) > 1:
        raise InvalidInputError(f"{path} has {len(fields)} number fields; one is needed")
    if fields:
        first = start_number or 0
        numbers = range(first, first + (1 if n_frames is None else n_frames))
        return numbered_paths(path, fields[0], numbers)
    if match := OTHER_FIELD.search(path.name):
        field = match[0]
        digits = len(field) if field[0] == "#" else int(field[-1]) if field[-1].isdigit() else 4
        name = path.name.replace(field, f"%0{digits}d")
        raise InvalidInputError(
            f"{path}: {field} is not a number field here; use {path.with_name(name)}"
        )
    if n_frames is not None and n_frames > 1:
        pattern = path.with_name(f"{path.stem}_%04d{path.suffix}")
        raise InvalidInputError(
            f"{path} stores one frame, but there are {n_frames}; use a pattern such as {pattern}, "
            f"or {path.with_suffix('.npz')} for all frames in one file"
        )
    return [path]


def _check_start_number(path: Path, start_number: int | None) -> None:
    if start_number is None:
        return
    if start_number < 0:
        raise InvalidInputError(Keyword("start_number"), f" must be 0 or more; got {start_number}")
    if not is_pattern(path):
        raise InvalidInputError(
            Keyword("start_number"),
            f" numbers the files of a pattern, but {path} is none; "
            f"use a pattern such as {path.with_name('frame_%04d.obj')}",
        )


def numbered_paths(path: Path, field: re.Match[str], numbers: Iterable[int]) -> list[Path]:
    """Return a path for each number, in place of the number field of its name."""
    fill, width = field.groups()
    before, after = path.name[: field.start()], path.name[field.end() :]
    return [path.with_name(f"{before}{number:{fill}{width}d}{after}") for number in numbers]
