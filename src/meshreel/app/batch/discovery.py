"""The sequences under a folder."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.registry import FRAME_FORMATS, SEQUENCE_FORMATS, STREAMS, extension_of
from meshreel.formats.sources import natural_order
from meshreel.runtime.stores.address import is_remote, name_of
from meshreel.runtime.stores.filesystem import RemoteFile, files_below

OUTPUT_EXTENSION = ".reel"
WHOLE_SEQUENCES = tuple(extension for extension in SEQUENCE_FORMATS if extension not in STREAMS)


@dataclass(frozen=True)
class BatchInput:
    """One sequence to encode."""

    name: str
    """Path relative to the input folder, with slashes; "." is that folder itself."""
    source: Path | str
    """Path, or str if remote. Absolute path of a file with a whole sequence, or of a folder of
    frames.
    """
    files: tuple[Path, ...]
    """Its files, if they are local."""
    output: str
    """Path of the stream relative to the output folder, with slashes."""
    remote_files: tuple[RemoteFile, ...] = ()
    """Its files, if they are remote."""

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


def find_inputs(folder: Path | str, *, but_not: Path | None = None) -> list[BatchInput]:
    """Find all sequences in a folder and its subfolders, in natural order.

    An input is a file with a whole sequence, or a folder with frame files. Hidden files, hidden
    folders and streams are skipped; links are followed.

    Parameters
    ----------
    folder : Path, or str of a remote folder
    but_not : Path, optional
        A subfolder to skip: that of the outputs.

    Raises
    ------
    InvalidInputError
        If the folder does not exist, or contains no sequence.
    """
    files: dict[Path, Path | RemoteFile] = {}
    if is_remote(folder):
        top: Path | str = folder.rstrip("/")
        for file in files_below(folder.rstrip("/")):
            if not any(part.startswith(".") for part in Path(file.name).parts):
                files[Path(file.name)] = file
    else:
        top = Path(folder).absolute()
        if not top.is_dir():
            raise InvalidInputError(f"there is no folder {str(top)!r}; name the folder of inputs")
        skipped = but_not.resolve() if but_not else None
        for parent in _folders_under(top):
            if parent == top or parent.resolve() != skipped:
                files |= {
                    path.relative_to(top): path for path in _visible(parent) if path.is_file()
                }
    inputs = list(_inputs_among(files, top))
    if not inputs:
        raise InvalidInputError(
            f"there is no sequence under {folder}; looked for {', '.join(WHOLE_SEQUENCES)} files "
            f"and for folders of frames ({', '.join(FRAME_FORMATS)})"
        )
    return inputs


def _folders_under(folder: Path, ancestors: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Yield a folder and its subfolders; links to a parent folder are not followed."""
    real_folder = folder.resolve()
    if real_folder in ancestors:
        return
    yield folder
    for child in _visible(folder):
        if child.is_dir():
            yield from _folders_under(child, (*ancestors, real_folder))


def _visible(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if not path.name.startswith(".")]


def _inputs_among(files: Mapping[Path, Path | RemoteFile], top: Path | str) -> Iterator[BatchInput]:
    """Yield the inputs among files, by their relative paths."""
    by_folder: dict[Path, list[Path]] = {}
    for path in files:
        by_folder.setdefault(path.parent, []).append(path)
    for folder in natural_order(by_folder):
        companions = _companions(by_folder[folder])
        siblings = _companions(by_folder.get(folder.parent, [])) if folder.name else set()
        if any(path.parent == folder and path in files for path in siblings):
            continue  # the pieces of a sequence whose main file is next to the folder
        paths = [path for path in natural_order(by_folder[folder]) if path not in companions]
        frames = [path for path in paths if path.suffix.lower() in FRAME_FORMATS]
        if frames:
            # The path of the input folder itself is ".", which has no name.
            name = name_of(top) if isinstance(top, str) else top.resolve().name
            output = folder.parent / f"{folder.name or name}{OUTPUT_EXTENSION}"
            yield _input(folder, top, output, [files[path] for path in frames])
        for path in paths:
            if extension_of(path) in WHOLE_SEQUENCES:
                parts = [files[part] for part in (path, *_parts(path, by_folder))]
                if isinstance(top, Path):
                    parts += SEQUENCE_FORMATS[extension_of(path)].other_files(top / path)
                yield _input(path, top, folder / f"{path.stem}{OUTPUT_EXTENSION}", parts)


def _input(path: Path, top: Path | str, output: Path, files: list[Path | RemoteFile]) -> BatchInput:
    local = tuple(file for file in files if isinstance(file, Path))
    remote = tuple(file for file in files if isinstance(file, RemoteFile))
    source = top / path if isinstance(top, Path) else f"{top}/{path.as_posix()}".removesuffix("/.")
    return BatchInput(path.as_posix(), source, local, output.as_posix(), remote)


def _companions(files: list[Path]) -> set[Path]:
    """Files that belong to another file: the mesh of a cache, binary data, a first piece."""
    formats = [(path, SEQUENCE_FORMATS.get(extension_of(path))) for path in files]
    meshes = {path.with_suffix(row.companion) for path, row in formats if row and row.companion}
    return meshes.union(
        *(row.data_files(path, 1) for path, row in formats if row and row.data_files)
    )


def _parts(path: Path, by_folder: Mapping[Path, list[Path]]) -> list[Path]:
    """The existing companion of a file; if it is in a folder of pieces, all pieces."""
    parts = []
    for companion in _companions([path]):
        siblings = by_folder.get(companion.parent, [])
        if companion in siblings:
            parts += [companion] if companion.parent == path.parent else natural_order(siblings)
    return parts
