"""Local copies of remote inputs and outputs.

Readers, writers and their libraries need paths: inputs are downloaded to a temporary folder, and
outputs are uploaded from one when they are complete. Only ``.reel`` files are read remotely, block
by block: see `meshreel.runtime.stores.ranged_file`.
"""

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from meshreel.errors import InvalidInputError, MeshReelError, StoreError
from meshreel.formats.file_references import DOWNLOADED, download_sibling
from meshreel.formats.notes import listed
from meshreel.formats.outputs import is_pattern
from meshreel.formats.registry import FORMATS, FRAME_FORMATS, extension_of
from meshreel.formats.sources import AnyPath, Source, natural_order
from meshreel.runtime.counting import counted
from meshreel.runtime.stores.address import folder_of, is_remote, name_of, without_query
from meshreel.runtime.stores.filesystem import files_below, files_in, matches
from meshreel.runtime.stores.transfer import check_outputs, download, sibling, upload_all


@contextmanager
def local_copy(source: Source, notes: list[str] | None = None) -> Iterator[Source]:
    """Context manager for a local copy of a remote source, removed on exit; or a local source.

    A folder means its frames, a pattern its matches. The mesh of a point cache is downloaded too;
    referenced files are downloaded when they are needed.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `meshreel.load`.
    notes : list of str, optional
        Receives a sentence on the download.

    Raises
    ------
    StoreError
        If a file does not exist or cannot be reached.
    """
    several = [source] if isinstance(source, str | os.PathLike) else list(source)
    if not any(map(is_remote, several)):
        yield source
        return
    if not all(map(is_remote, several)):
        raise InvalidInputError(
            "some frames are remote and some are local files; use only one kind"
        )
    addresses = [os.fspath(one) for one in several]
    place = Path(tempfile.mkdtemp(prefix="meshreel-")).resolve()
    folder = place / _folder_name(addresses[0])
    try:
        yield _downloaded(addresses, folder, notes)
    except MeshReelError as error:
        local, address = f"{folder}{os.sep}", f"{_folder(addresses[0])}/"
        error.args = tuple(  # the user knows the file by its address
            part.replace(local, address) if isinstance(part, str) else part for part in error.args
        )
        raise
    finally:
        for folder in [one for one in DOWNLOADED if one.is_relative_to(place)]:
            del DOWNLOADED[folder]
        shutil.rmtree(place, ignore_errors=True)


@contextmanager
def local_file(requested: AnyPath, notes: list[str] | None = None) -> Iterator[Path]:
    """Context manager for the local copy of a single file; see `local_copy`."""
    with local_copy(requested, notes) as source:
        yield Path(cast("AnyPath", source))


@dataclass(frozen=True)
class Output:
    """The requested output, and the local path to write."""

    requested: AnyPath
    local: AnyPath
    """str or path. The same for a local output; a path in a temporary folder for a remote one."""

    @property
    def is_remote(self) -> bool:
        """Whether the written files are uploaded afterwards."""
        return is_remote(self.requested)

    def name(self, path: AnyPath) -> str:
        """Return the path or address that the user knows for a written local file."""
        if not self.is_remote:
            return str(path)
        within = Path(path).relative_to(Path(self.local).parent).as_posix()
        return sibling(os.fspath(self.requested), within)


@contextmanager
def uploaded(output: AnyPath, *, overwrite: bool) -> Iterator[Output]:
    """Context manager for the local path of an output; uploads a remote one on success.

    Uploads are atomic per file. If an upload fails, the files are kept and the error names them.

    Parameters
    ----------
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    InvalidInputError, StoreError
        As `meshreel.runtime.stores.transfer.check_outputs`, before and after the block.
    """
    if not is_remote(output):
        yield Output(output, output)
        return
    address = os.fspath(output)
    check_outputs([] if is_pattern(name_of(address)) else [address], overwrite=overwrite)
    place = Path(tempfile.mkdtemp(prefix="meshreel-"))
    target = Output(address, place / name_of(address))
    try:
        yield target
        made = {path: target.name(path) for path in sorted(_files(place))}
        if Path(target.local).is_dir():
            _check_mixture(address, set(made.values()))
        try:
            upload_all(made, overwrite=overwrite)
        except InvalidInputError:
            raise
        except StoreError as error:
            kept, place = place, Path(tempfile.mkdtemp(prefix="meshreel-"))
            raise StoreError(f"{error}; the output is kept in {kept}") from None
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _check_mixture(address: str, made: set[str]) -> None:
    """Reject a remote folder with other files, because programs use all files there."""
    there = {f"{address.rstrip('/')}/{one.name}" for one in files_below(address)}
    if others := sorted(there - made):
        raise InvalidInputError(
            f"{address} contains files that must not be mixed with the output: {listed(others)}; "
            "remove them, or choose another folder"
        )


def _folder(address: str) -> str:
    """Address of the folder with the frames of an input."""
    name = name_of(address)
    is_file = extension_of(name) in FORMATS or _has_magic(name)
    return folder_of(address) if is_file else without_query(address).rstrip("/")


def _folder_name(address: str) -> str:
    """Local name for that folder, which becomes the name of a sequence of frames."""
    return re.sub(r"[^\w. -]", "_", name_of(_folder(address))).strip(". ") or "frames"


def _downloaded(addresses: list[str], folder: Path, notes: list[str] | None) -> Source:
    """Download files into a new folder; return the copies as a source."""
    files = [file for address in addresses for file in _resolve(address)]
    names = [name_of(file) for file in files]
    if len(set(names)) < len(names):
        raise InvalidInputError("two remote frames have the same file name; rename one of them")
    folder.mkdir()
    for file, name in zip(files, names, strict=True):
        download(file, folder / name)
    if len(files) == 1:
        DOWNLOADED[folder] = without_query(files[0])
        _fetch_companion(folder / names[0])
    if notes is not None:
        size_mb = sum(path.stat().st_size for path in _files(folder)) / 1e6
        what = files[0] if len(files) == 1 else f"{counted(len(files), 'file')} of {addresses[0]}"
        notes.append(f"downloaded {what} ({size_mb:.3g} MB) to read it")
    if len(files) == 1 and len(addresses) == 1 and addresses[0] == files[0]:
        return folder / names[0]
    return [folder / name for name in names]


def _resolve(address: str) -> list[str]:
    """Addresses of the files that an address means: itself, frames of a folder, or matches."""
    if extension_of(name_of(address)) in FORMATS and not _has_magic(name_of(address)):
        return [address]
    if _has_magic(address):
        found = _natural_order(matches(address))
        if not found:
            raise StoreError(f"the pattern {address} matches no file; check it")
        return found
    found = [one for one in files_in(address) if Path(name_of(one)).suffix.lower() in FRAME_FORMATS]
    if not found:
        raise StoreError(
            f"{address} is neither a folder of frames ({', '.join(FRAME_FORMATS)}) nor a file with "
            "a known extension"
        )
    return _natural_order(found)


def _natural_order(addresses: Iterable[str]) -> list[str]:
    of_name = {name_of(address): address for address in addresses}
    return [of_name[path.name] for path in natural_order(map(Path, of_name))]


def _has_magic(text: str) -> bool:
    return "*" in text or "[" in text


def _fetch_companion(path: Path) -> None:
    """Download the mesh next to a point cache, if there is one."""
    found = FORMATS[extension_of(path)]
    if found.companion:
        download_sibling(path.with_suffix(found.companion))


def _files(place: Path) -> list[Path]:
    return [path for path in place.rglob("*") if path.is_file()]
