"""Local copies of remote inputs.

Readers and their libraries need paths, so inputs are downloaded to a temporary folder. Only
``.reel`` files are read remotely, block by block: see `meshreel.runtime.stores.ranged_file`.
"""

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.codec.memory import memory_limit
from meshreel.errors import InvalidInputError, MeshReelError, StoreError
from meshreel.formats.file_references import DOWNLOADS, download_sibling
from meshreel.formats.registry import FORMATS, FRAME_FORMATS, extension_of
from meshreel.formats.sources import Source, natural_order
from meshreel.model.notes import Notes
from meshreel.runtime.counting import counted
from meshreel.runtime.stores.address import folder_of, is_remote, name_of, without_query
from meshreel.runtime.stores.filesystem import files_in, matches
from meshreel.runtime.stores.transfer import download


@contextmanager
def local_copy(
    source: Source, notes: Notes | None = None, memory: float | str | None = None
) -> Iterator[Source]:
    """Context manager for a local copy of a remote source, removed on exit; or a local source.

    A folder means its frames, a pattern its matches. The mesh of a point cache is downloaded too;
    referenced files are downloaded when they are needed.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `meshreel.load`.
    notes : Notes, optional
        Receives a sentence on the download.
    memory : float or str, optional
        Largest size of a file whose server announces none. Default: the limit of decoding.

    Raises
    ------
    StoreError
        If a file does not exist, cannot be reached, or is not sent as announced.
    """
    sources = [source] if isinstance(source, str | os.PathLike) else list(source)
    if not any(map(is_remote, sources)):
        yield source
        return
    if not all(map(is_remote, sources)):
        raise InvalidInputError(
            "some frames are remote and some are local files; use only one kind"
        )
    addresses = [os.fspath(address) for address in sources]
    root = Path(tempfile.mkdtemp(prefix="meshreel-")).resolve()
    # The local name of the folder also names a sequence of frames.
    name = re.sub(r"[^\w. -]", "_", name_of(_folder(addresses[0]))).strip(". ")
    folder = root / (name or "frames")
    try:
        yield _download(addresses, folder, memory_limit(memory).limit_bytes, notes)
    except MeshReelError as error:
        prefix, address = f"{folder}{os.sep}", f"{_folder(addresses[0])}/"
        # Users know files by their address. Parts of the message may contain paths too: of
        # several files, of references, or in texts of libraries.
        error.path = error.path.replace(prefix, address)
        error.args = tuple(
            part.replace(prefix, address) if isinstance(part, str) else part for part in error.args
        )
        raise
    finally:
        for folder in [path for path in DOWNLOADS if path.is_relative_to(root)]:
            del DOWNLOADS[folder]
        shutil.rmtree(root, ignore_errors=True)


def _folder(address: str) -> str:
    """Address of the folder with the frames of an input."""
    name = name_of(address)
    is_file = extension_of(name) in FORMATS or _has_magic(name)
    return folder_of(address) if is_file else without_query(address).rstrip("/")


def _download(
    addresses: list[str], folder: Path, limit_bytes: float, notes: Notes | None
) -> Source:
    """Download files into a new folder; return the copies as a source."""
    files = remote_files(addresses)
    names = [name_of(file) for file in files]
    if len(set(names)) < len(names):
        raise InvalidInputError("two remote frames have the same file name; rename one of them")
    folder.mkdir()
    for file, name in zip(files, names, strict=True):
        download(file, folder / name, limit_bytes)
    if len(files) == 1:
        DOWNLOADS[folder] = without_query(files[0]), limit_bytes
        path = folder / names[0]
        if companion := FORMATS[extension_of(path)].companion:  # the mesh of a point cache
            download_sibling(path.with_suffix(companion))
    if notes is not None:
        size_mb = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
        source = files[0] if len(files) == 1 else f"{counted(len(files), 'file')} of {addresses[0]}"
        notes.result(f"downloaded {source} ({size_mb:.3g} MB) to read it")
    if len(files) == 1 and len(addresses) == 1 and addresses[0] == files[0]:
        return folder / names[0]
    return [folder / name for name in names]


def remote_files(source: Source) -> list[str]:
    """Return the addresses of the files of a remote source; raises as `local_copy`."""
    addresses = [source] if isinstance(source, str | os.PathLike) else source
    return [file for address in addresses for file in _resolve(os.fspath(address))]


def _resolve(address: str) -> list[str]:
    """Addresses of the files that an address means: itself, frames of a folder, or matches."""
    if extension_of(name_of(address)) in FORMATS and not _has_magic(name_of(address)):
        return [address]
    if _has_magic(address):
        addresses = natural_order(matches(address), name_of)
        if not addresses:
            raise StoreError(f"the pattern {address} matches no file; check it")
        return addresses
    addresses = [
        file for file in files_in(address) if Path(name_of(file)).suffix.lower() in FRAME_FORMATS
    ]
    if not addresses:
        raise StoreError(
            f"{address} is neither a folder of frames ({', '.join(FRAME_FORMATS)}) nor a file with "
            "a known extension"
        )
    return natural_order(addresses, name_of)


def _has_magic(text: str) -> bool:
    return "*" in text or "[" in text
