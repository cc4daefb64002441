"""Resolution of a source, which is a file, a folder, a pattern or a list, to its files."""

import glob
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TypeVar

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import check_input_file
from meshreel.formats.kinds import FrameFormat, SequenceFormat
from meshreel.formats.registry import FORMATS, FRAME_FORMATS, extension_of, format_of
from meshreel.runtime.stores.address import refuse_address

AnyPath = str | os.PathLike[str]
Source = AnyPath | Sequence[AnyPath]
Named = TypeVar("Named", str, Path, Path | str)

NUMBER_FIELD = re.compile(r"%(0?)(\d{0,2})d")
"""Number of a frame in the name of its file, as in f_%04d.obj."""

WHOLE = re.compile(r"(\d+)")
DECIMAL = re.compile(r"((?<!\d)(?<!\d\.)\d+\.\d+(?!\.?\d)|\d+)")
"""Numbers in names, without and with fractions; 1.2.3 has none."""

MIN_SIMILARITY = 0.8
"""Similarity from which a name is suggested for one that does not exist."""


@dataclass(frozen=True)
class SourceFiles:
    """The files of a source, all of one format, in frame order."""

    paths: tuple[Path, ...]
    """At least one; several of a format that stores whole sequences have one frame each."""
    format: FrameFormat | SequenceFormat
    """Format of all files."""
    name: str
    """Name for the sequence: the stem of a single file, otherwise the name of the folder."""

    @property
    def other_files(self) -> list[Path]:
        """The files that continue a file of a whole sequence."""
        return self.format.other_files(self.paths[0])

    def with_companions(self, topology: AnyPath | None = None) -> list[Path]:
        """Return all files, with the mesh of a point cache: `topology`, or that of its name."""
        files = list(self.paths)
        if topology is not None:
            files.append(Path(topology))
        elif self.format.companion:
            files += [path.with_suffix(self.format.companion) for path in self.paths]
        return files + self.other_files


def find_files(source: Source) -> SourceFiles:
    """Return the files of a source.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        A file; a folder, which means all its frames; a pattern such as ``dir/*.obj`` or
        ``dir/f_%04d.obj``; or a list of frame files. Folders and patterns are sorted in natural
        order, ignoring files that are not meshes; a list keeps its order. A list with one item
        means that item.

    Raises
    ------
    InvalidInputError
        If the file or folder does not exist or is a pipe or a device, the pattern matches nothing,
        or the list is empty.
    FormatError
        If the format is unknown, the files have several formats, or one is empty or a Git LFS
        pointer.
    StoreError
        If the source is a remote address.
    """
    for item in [source] if isinstance(source, str | os.PathLike) else source:
        refuse_address(item, "what is opened here")
    if not isinstance(source, str | os.PathLike):
        return _from_list([Path(path) for path in source])
    path = Path(source)
    if path.is_dir():
        return _from_folder(path)
    check_input_file(path)
    if path.exists():
        return SourceFiles((path,), format_of(path), path.stem)
    if glob.has_magic(str(source)):
        files = [Path(name) for name in glob.glob(str(source), recursive=True)]
        files = natural_order(path for path in files if path.is_file())
        if not files:
            raise InvalidInputError(f"the pattern {str(source)!r} matches no file; check it")
        supported_files = [path for path in files if extension_of(path) in FORMATS]
        if not supported_files:
            format_of(files[0])
        return _check_one_format(supported_files, f"the pattern {str(source)!r}")
    if "%" in path.name:
        return _from_numbers(path)
    raise InvalidInputError(missing_source(path))


def missing_source(path: AnyPath) -> str:
    """Return the message about a file that does not exist, and suggest the most similar name."""
    path, message = Path(path), f"there is no file or folder {str(path)!r}"
    try:
        names = {other.name.lower(): other.name for other in path.parent.iterdir()}
    except OSError:
        return f"{message}; check it"
    similar = get_close_matches(path.name.lower(), sorted(names), n=1, cutoff=MIN_SIMILARITY)
    if not similar:
        return f"{message}; check it"
    return f"{message}; did you mean {str(path.with_name(names[similar[0]]))!r}?"


def natural_order(
    paths: Iterable[Named], name_of: Callable[[Named], str] = str, *, by_value: bool | None = None
) -> list[Named]:
    """Sort paths or addresses so that ``frame_2`` precedes ``frame_10``, ignoring case.

    Parameters
    ----------
    by_value : bool, optional
        Whether ``t_0.25`` precedes ``t_0.5``, as a decimal number, or ``v1.2`` precedes ``v1.10``.
        Default: as `have_decimals` finds.
    """
    items = list(paths)
    if by_value is None:
        by_value = have_decimals([name_of(path) for path in items])
    number = DECIMAL if by_value else WHOLE

    def key(path: Named) -> list[tuple[int, str]]:
        name = name_of(path)
        parts = number.split(name.lower())
        # Odd parts are numbers, whose fractions are in order as text; the name itself breaks ties
        # such as frame_1 and frame_01.
        return [
            (int(p.partition(".")[0]), p.partition(".")[2] if by_value else p) if i % 2 else (-1, p)
            for i, p in enumerate(parts)
        ] + [(-1, name)]

    return sorted(items, key=key)


def have_decimals(names: Sequence[str]) -> bool:
    """Return whether names differ in decimal numbers, not in versions or counts after a point.

    Decimal numbers have several whole parts or fractions that are no counts, as 0.05 beside 0.1,
    and no value twice, as 1.1 and 1.10 would be.
    """
    rows = [DECIMAL.split(name.lower()) for name in names]
    if len({len(row) for row in rows}) != 1:
        return False
    for column in [*zip(*rows, strict=True)][1::2]:
        numbers = {number.partition(".")[::2] for number in column}
        fractions = {fraction for _, fraction in numbers if fraction}
        width = min(map(len, fractions), default=0)
        are_counts = all(len(text) == width or text[0] != "0" for text in fractions)
        n_values = len({(int(whole), fraction.rstrip("0")) for whole, fraction in numbers})
        has_wholes = len({int(whole) for whole, _ in numbers}) > 1
        if fractions and n_values == len(numbers) and (has_wholes or not are_counts):
            return True
    return False


def _from_list(paths: list[Path]) -> SourceFiles:
    if len(paths) == 0:
        raise InvalidInputError("the list of frame files is empty; name at least one")
    if len(paths) == 1:
        return find_files(paths[0])
    for path in paths:
        check_input_file(path)
        if not path.is_file():
            raise InvalidInputError(
                f"{path} is a folder; a list must name files"
                if path.is_dir()
                else missing_source(path)
            )
        format_of(path)
    return _check_one_format(paths, "the list")


def _from_folder(folder: Path) -> SourceFiles:
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    frames = [path for path in files if path.suffix.lower() in FRAME_FORMATS]
    if not frames:
        names = natural_order(Path(path.name) for path in files if extension_of(path) in FORMATS)
        advice = f"; it contains {names[0]}: use that file" if names else ""
        if len(names) > 1:
            advice = (
                f"; it contains {names[0]} and {len(names) - 1} more: name one, or encode all "
                "of them with `meshreel batch`"
            )
        raise FormatError(
            f"the folder {folder} contains no frames ({', '.join(FRAME_FORMATS)}){advice}"
        )
    return _check_one_format(natural_order(frames), f"the folder {folder}")


def _from_numbers(pattern: Path) -> SourceFiles:
    """Return the files whose names an output pattern such as f_%04d.obj describes, by number."""
    field = NUMBER_FIELD.search(pattern.name)
    files: list[Path] = []
    if field is not None and pattern.parent.is_dir():
        name = re.compile(re.escape(pattern.name).replace(field[0], "([0-9]+)", 1))
        matches = ((path, name.fullmatch(path.name)) for path in pattern.parent.iterdir())
        files = natural_order(
            path for path, match in matches if match and field[0] % int(match[1]) == match[1]
        )
    if not files:
        raise InvalidInputError(
            f"there is no file {str(pattern)!r}, and no numbered one; to read frames use a pattern "
            "such as dir/f_%04d.obj or dir/*.obj"
        )
    return _check_one_format(files, f"the pattern {pattern}")


def _check_one_format(paths: list[Path], origin: str) -> SourceFiles:
    counts = Counter(extension_of(path) for path in paths)
    if len(counts) > 1:
        kinds = " and ".join(f"{count} {extension}" for extension, count in counts.items())
        raise FormatError(
            f"{origin} contains files of several formats ({kinds}); "
            f"choose one with a pattern such as {paths[0].parent / f'*{paths[0].suffix}'}"
        )
    file_format = format_of(paths[0])
    is_file = len(paths) == 1 and isinstance(file_format, SequenceFormat)
    if isinstance(file_format, SequenceFormat) and not is_file and file_format.read_meshes is None:
        raise FormatError(
            f"{origin} contains {len(paths)} {file_format.extension} files, each a whole "
            "sequence; choose one"
        )
    for path in paths:
        check_input_file(path)
    name = paths[0].stem if is_file else paths[0].resolve().parent.name
    return SourceFiles(tuple(paths), file_format, name)
