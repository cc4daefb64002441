"""Any input as a sequence: files and addresses, streams in memory, and sequences."""

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

from meshreel.codec.reel_file import ReelFile
from meshreel.errors import Keyword, Message
from meshreel.formats.load import is_path, open_for_encoding, sequence_of
from meshreel.formats.needed_extras import extras_to_read
from meshreel.formats.options import Reading
from meshreel.formats.remote import local_copy
from meshreel.formats.segments import open_any
from meshreel.formats.sources import Source, find_files
from meshreel.formats.supported_options import supported_only
from meshreel.model.frame_choice import frame_range, slice_text
from meshreel.model.notes import Notes
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.runtime.extras import Extra, require
from meshreel.runtime.stores.address import STANDARD_INPUT, is_remote

Stream = bytes | bytearray | memoryview
AnyInput = MeshSequence | FrameSource | ReelFile | Stream | Source


@contextmanager
def local_input(
    source: Source, notes: Notes | None = None, memory: float | str | None = None
) -> Iterator[Source]:
    """Context manager for the files of a source on this machine, as `local_copy`.

    Standard input is copied, because readers seek.
    """
    if source != STANDARD_INPUT:
        with local_copy(source, notes, memory) as files:
            yield files
        return
    with TemporaryDirectory(prefix="meshreel-") as folder:
        path = Path(folder) / "stdin.reel"
        with path.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield path


def opened(
    source: AnyInput, reading: Reading, memory: float | None = None
) -> AbstractContextManager[MeshSequence]:
    """Context manager for the sequence of an input, whose frames may stay in their files.

    Parameters
    ----------
    memory : float, optional
        Memory limit for encoding in bytes: small files are loaded, larger ones are not. Default:
        that of `meshreel.encode`.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`, or if the input is none.
    """
    if isinstance(source, MeshSequence):
        return nullcontext(source)
    if not is_path(source):
        return nullcontext(sequence_of(source))
    return _opened_files(source, reading, memory)  # type: ignore[arg-type]  # see `is_path`


@contextmanager
def _opened_files(source: Source, reading: Reading, memory: float | None) -> Iterator[MeshSequence]:
    with local_input(source) as files:
        yield open_for_encoding(files, memory, reading)


def check_inputs(sources: Iterable[AnyInput | None], *extras: Extra) -> list[Path]:
    """Return the local files of inputs; call it before long work.

    Raises
    ------
    InvalidInputError, FormatError
        If a file is missing, or if `extras` or those that reading needs are not installed.
    """
    paths = [source for source in sources if source is not None and is_path(source)]
    files = []
    for path in paths:
        items = [path] if isinstance(path, str | os.PathLike) else path
        if path != STANDARD_INPUT and not any(map(is_remote, items)):  # type: ignore[arg-type]
            files += find_files(path).with_companions()  # type: ignore[arg-type]
    require([*extras, *extras_to_read(files)])
    return files


def loaded(source: AnyInput, reading: Reading) -> MeshSequence:
    """Return the sequence of an input, with all frames in memory.

    Options that have no effect on the format of a file are ignored.

    Raises
    ------
    InvalidInputError, FormatError
        As `opened`.
    """
    if not is_path(source):
        return sequence_of(source, reading.memory)
    with local_input(source, memory=reading.memory) as files:  # type: ignore[arg-type]
        found = find_files(files)
        return open_any(found, supported_only(reading, found.paths[0]))


def chosen_frames(selection: slice | None, n_frames: int, notes: Notes) -> range:
    """Return the frames of a slice; adds a note if the slice exceeds the ends.

    Raises
    ------
    InvalidInputError
        If the slice selects no frame.
    """
    frames = frame_range(selection, n_frames)
    ends = [] if selection is None else [selection.start, selection.stop]
    if any(end is not None and not -n_frames <= end <= n_frames for end in ends):
        notes.result(
            Message(
                Keyword("frames"),
                f" {slice_text(selection)} exceeds the frames 0:{n_frames}; using "
                f"{frames.start}:{frames.stop}",
            )
        )
    return frames
