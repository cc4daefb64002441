"""The sequences under a folder."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.registry import FRAME_FORMATS, SEQUENCE_FORMATS
from meshreel.formats.sources import natural_order

OUTPUT_ENDING = ".reel"
WHOLE_SEQUENCES = tuple(ending for ending in SEQUENCE_FORMATS if ending != OUTPUT_ENDING)


@dataclass(frozen=True)
class BatchInput:
    """One sequence to encode.

    Attributes
    ----------
    name : str
        Its path within the folder of inputs, with slashes; "." is that folder itself.
    source : Path
        Absolute: a file of a whole sequence, or a folder of frames.
    files : tuple of Path
        The files that it consists of.
    output : str
        Path of the stream within the folder of outputs, with slashes.
    """

    name: str
    source: Path
    files: tuple[Path, ...]
    output: str

    def fingerprint(self) -> str:
        """A hash of the names, sizes and times of change of its files; their bytes are not read."""
        digest = hashlib.sha256()
        for path in self.files:
            facts = path.stat()
            digest.update(f"{path.name}\0{facts.st_size}\0{facts.st_mtime_ns}\0".encode())
        return digest.hexdigest()


def find_inputs(folder: Path, *, but_not: Path | None = None) -> list[BatchInput]:
    """Every sequence in a folder and its sub-folders, in natural order.

    Each file of a whole sequence is one, and each folder that holds frame files. Hidden files and
    folders are passed over, and streams; links are followed.

    Parameters
    ----------
    folder : Path
    but_not : Path, optional
        A sub-folder that is passed over: that of the outputs.

    Raises
    ------
    InvalidInputError
        If there is no such folder, or no sequence in it.
    """
    if not folder.is_dir():
        raise InvalidInputError(f"there is no folder {str(folder)!r}; name the folder of inputs")
    top = folder.absolute()
    passed_over = but_not.resolve() if but_not else None
    found = [
        one
        for place in _folders_under(top)
        if place == top or place.resolve() != passed_over
        for one in _inputs_in(place, top)
    ]
    if not found:
        raise InvalidInputError(
            f"there is no sequence under {folder}; looked for {', '.join(WHOLE_SEQUENCES)} files "
            f"and for folders of frames ({', '.join(FRAME_FORMATS)})"
        )
    return found


def _folders_under(folder: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """The folder and all below it; a link to a folder that holds it ends there."""
    true_place = folder.resolve()
    if true_place in above:
        return
    yield folder
    for child in natural_order(_visible(folder)):
        if child.is_dir():
            yield from _folders_under(child, (*above, true_place))


def _inputs_in(folder: Path, top: Path) -> Iterator[BatchInput]:
    files = natural_order(path for path in _visible(folder) if path.is_file())
    beside = _companions(files)
    frames = tuple(
        path for path in files if path.suffix.lower() in FRAME_FORMATS and path not in beside
    )
    place = folder.relative_to(top)
    if frames:
        # Of the folder of inputs itself the path is ".", which has no name.
        output = place.parent / f"{place.name or folder.resolve().name}{OUTPUT_ENDING}"
        yield BatchInput(place.as_posix(), folder, frames, output.as_posix())
    for path in files:
        if path.suffix.lower() in WHOLE_SEQUENCES:
            output = place / f"{path.stem}{OUTPUT_ENDING}"
            parts = (path, *(one for one in _companions([path]) if one.exists()))
            yield BatchInput((place / path.name).as_posix(), path, parts, output.as_posix())


def _companions(files: list[Path]) -> set[Path]:
    """Meshes that belong to a sequence of the same name beside them, as the faces of its frames."""
    formats = [(path, SEQUENCE_FORMATS.get(path.suffix.lower())) for path in files]
    return {
        path.with_suffix(found.companion) for path, found in formats if found and found.companion
    }


def _visible(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if not path.name.startswith(".")]
