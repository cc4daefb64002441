"""The sequences under a folder."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.registry import FRAME_FORMATS, SEQUENCE_FORMATS, extension_of
from meshreel.formats.sources import natural_order
from meshreel.runtime.stores.address import is_remote, name_of
from meshreel.runtime.stores.filesystem import RemoteFile, files_below

OUTPUT_EXTENSION = ".reel"
WHOLE_SEQUENCES = tuple(
    extension for extension in SEQUENCE_FORMATS if extension != OUTPUT_EXTENSION
)


@dataclass(frozen=True)
class BatchInput:
    """One sequence to encode.

    Attributes
    ----------
    name : str
        Path relative to the input folder, with slashes; "." is that folder itself. For one of
        several animations of a file, followed by "#" and its name.
    source : Path, or str if remote
        Absolute path of a file with a whole sequence, or of a folder of frames.
    files : tuple of Path
        Its files, if they are local.
    output : str
        Path of the stream relative to the output folder, with slashes.
    remote_files : tuple of RemoteFile
        Its files, if they are remote.
    animation : str, optional
        The animation to read from a file with several; default: as `meshreel.load` selects.
    """

    name: str
    source: Path | str
    files: tuple[Path, ...]
    output: str
    remote_files: tuple[RemoteFile, ...] = ()
    animation: str | None = None

    @property
    def path(self) -> str:
        """Path relative to the input folder, without the name of an animation."""
        return self.name if self.animation is None else self.name.removesuffix(f"#{self.animation}")

    @property
    def size_bytes(self) -> int:
        """Total size of its files."""
        local_bytes = sum(path.stat().st_size for path in self.files)
        return local_bytes + sum(file.size_bytes for file in self.remote_files)

    def fingerprint(self) -> str:
        """A hash of the names, sizes and modification times of its files, not of their bytes."""
        digest = hashlib.sha256()
        for path in self.files:
            status = path.stat()
            digest.update(f"{path.name}\0{status.st_size}\0{status.st_mtime_ns}\0".encode())
        for file in self.remote_files:
            digest.update(f"{name_of(file.name)}\0{file.size_bytes}\0{file.version}\0".encode())
        return digest.hexdigest()


def find_inputs(folder: Path | str, *, but_not: Path | str | None = None) -> list[BatchInput]:
    """Find all sequences in a folder and its subfolders, in natural order.

    An input is a file with a whole sequence, or a folder with frame files. Hidden files, hidden
    folders and streams are skipped; links are followed.

    Parameters
    ----------
    folder : Path, or str of a remote folder
    but_not : Path or str, optional
        A subfolder to skip: that of the outputs.

    Raises
    ------
    InvalidInputError
        If the folder does not exist, or contains no sequence.
    """
    if is_remote(folder):
        found = list(_remote_inputs(folder, but_not))
    else:
        found = list(_local_inputs(Path(folder), None if is_remote(but_not) else but_not))
    if not found:
        raise InvalidInputError(
            f"there is no sequence under {folder}; looked for {', '.join(WHOLE_SEQUENCES)} files "
            f"and for folders of frames ({', '.join(FRAME_FORMATS)})"
        )
    return found


def _local_inputs(folder: Path, but_not: Path | str | None) -> Iterator[BatchInput]:
    if not folder.is_dir():
        raise InvalidInputError(f"there is no folder {str(folder)!r}; name the folder of inputs")
    top = folder.absolute()
    passed_over = Path(but_not).resolve() if but_not else None
    for place in _folders_under(top):
        if place == top or not (place.resolve() == passed_over or _is_of_pieces(place)):
            yield from _inputs_in(place, top)


def _remote_inputs(folder: str, but_not: Path | str | None) -> Iterator[BatchInput]:
    """Find the sequences among the files that a store lists."""
    top = folder.rstrip("/")
    passed_over = f"{but_not}".rstrip("/") + "/" if is_remote(but_not) else None
    by_folder: dict[Path, dict[Path, RemoteFile]] = {}
    for file in files_below(top):
        is_hidden = any(part.startswith(".") for part in Path(file.name).parts)
        is_output = passed_over is not None and f"{top}/{file.name}".startswith(passed_over)
        if not is_hidden and not (is_output and passed_over != f"{top}/"):
            path = Path(file.name)
            by_folder.setdefault(path.parent, {})[path] = file
    for place in natural_order(by_folder):
        files = by_folder[place]
        named = _companions(list(by_folder.get(place.parent, {}))) if place.name else set()
        if not any(one.parent == place and one in files for one in named):
            yield from _remote_inputs_in(top, place, files)


def _remote_inputs_in(top: str, place: Path, files: dict[Path, RemoteFile]) -> Iterator[BatchInput]:
    beside = _companions(list(files))
    order = [path for path in natural_order(files) if path not in beside]
    frames = [path for path in order if path.suffix.lower() in FRAME_FORMATS]
    if frames:
        output = place.parent / f"{place.name or name_of(top)}{OUTPUT_EXTENSION}"
        yield BatchInput(
            place.as_posix(), f"{top}/{place.as_posix()}".removesuffix("/."), (),
            output.as_posix(), tuple(files[path] for path in frames),
        )  # fmt: skip
    for path in order:
        if extension_of(path) in WHOLE_SEQUENCES:
            parts = [files[path], *(files[one] for one in _companions([path]) if one in files)]
            output = place / f"{path.stem}{OUTPUT_EXTENSION}"
            address = f"{top}/{path.as_posix()}"
            yield BatchInput(path.as_posix(), address, (), output.as_posix(), tuple(parts))


def _folders_under(folder: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Yield a folder and its subfolders; links to a parent folder are not followed."""
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
        # The path of the input folder itself is ".", which has no name.
        output = place.parent / f"{place.name or folder.resolve().name}{OUTPUT_EXTENSION}"
        yield BatchInput(place.as_posix(), folder, frames, output.as_posix())
    for path in files:
        if extension_of(path) in WHOLE_SEQUENCES and path not in beside:
            output = place / f"{path.stem}{OUTPUT_EXTENSION}"
            parts = [part for one in _companions([path]) for part in _parts(one, path)]
            parts = [path, *parts, *SEQUENCE_FORMATS[extension_of(path)].other_files(path)]
            yield BatchInput((place / path.name).as_posix(), path, tuple(parts), output.as_posix())


def _companions(files: list[Path]) -> set[Path]:
    """Files that belong to another file: the mesh of a cache, binary data, a first piece."""
    formats = [(path, SEQUENCE_FORMATS.get(extension_of(path))) for path in files]
    meshes = {
        path.with_suffix(found.companion) for path, found in formats if found and found.companion
    }
    return meshes.union(
        *(found.data_files(path, 1) for path, found in formats if found and found.data_files)
    )


def _parts(companion: Path, path: Path) -> list[Path]:
    """The existing companion of a file; if it is in a folder of pieces, all pieces."""
    if not companion.exists():
        return []
    if companion.parent == path.parent:
        return [companion]
    return natural_order(one for one in _visible(companion.parent) if one.is_file())


def _is_of_pieces(folder: Path) -> bool:
    """Whether a folder contains the pieces of a sequence whose main file is next to the folder."""
    beside = [path for path in _visible(folder.parent) if path.is_file()]
    return any(one.parent == folder and one.exists() for one in _companions(beside))


def _visible(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if not path.name.startswith(".")]
