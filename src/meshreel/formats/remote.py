"""Remote inputs and outputs as files of this machine, while they are worked with.

Readers and writers of formats take paths, and many of their libraries nothing else: inputs are
downloaded into a temporary folder, and outputs uploaded from one when they are complete. Only a
``.reel`` is read where it is, block by block: see `meshreel.runtime.stores.ranged_file`.
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
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.notes import listed
from meshreel.formats.outputs import is_pattern
from meshreel.formats.registry import FORMATS, FRAME_FORMATS
from meshreel.formats.sources import AnyPath, Source, natural_order
from meshreel.runtime.counting import counted
from meshreel.runtime.stores.address import folder_of, is_remote, name_of, plain
from meshreel.runtime.stores.listing import files_below, files_in, matches
from meshreel.runtime.stores.transfer import beside, check_outputs, download, exists, upload_all

_DOWNLOADED: dict[Path, str] = {}
"""Temporary folders with the address of a file that was downloaded there, while they last."""


@contextmanager
def at_hand(source: Source, notes: list[str] | None = None) -> Iterator[Source]:
    """The source; of a remote one a copy on this machine, which is removed afterwards.

    A folder means its frames, a pattern the files that match it. A mesh that belongs to a point
    cache is taken along, and files that others name as they are asked for.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As `meshreel.load` takes it.
    notes : list of str, optional
        Gains a sentence on what was downloaded.

    Raises
    ------
    StoreError
        If a file is not there, or cannot be reached.
    """
    several = [source] if isinstance(source, str | os.PathLike) else list(source)
    if not any(map(is_remote, several)):
        yield source
        return
    if not all(map(is_remote, several)):
        raise InvalidInputError(
            "some frames are remote and some are files of this machine; give either"
        )
    addresses = [os.fspath(one) for one in several]
    place = Path(tempfile.mkdtemp(prefix="meshreel-")).resolve()
    folder = place / _folder_name(addresses[0])
    try:
        yield _downloaded(addresses, folder, notes)
    except MeshReelError as error:
        if str(folder) not in str(error):
            raise
        # Users know the file by its address.
        text = str(error).replace(f"{folder}{os.sep}", f"{_folder(addresses[0])}/")
        raise type(error)(text) from None
    finally:
        for folder in [one for one in _DOWNLOADED if one.is_relative_to(place)]:
            del _DOWNLOADED[folder]
        shutil.rmtree(place, ignore_errors=True)


@contextmanager
def file_at_hand(given: AnyPath, notes: list[str] | None = None) -> Iterator[Path]:
    """One file, as `at_hand` gives it."""
    with at_hand(given, notes) as source:
        yield Path(cast("AnyPath", source))


def fetch_beside(path: Path) -> bool:
    """Download a file that another names, if that was downloaded; whether it is there now.

    Parameters
    ----------
    path : Path
        Where it should be.

    Raises
    ------
    StoreError
        If the store cannot be asked.
    """
    for place, address in _DOWNLOADED.items():
        if path.is_relative_to(place):
            other = beside(address, path.relative_to(place).as_posix())
            if not exists(other):
                return False
            path.parent.mkdir(parents=True, exist_ok=True)
            download(other, path)
            return True
    return False


@dataclass(frozen=True)
class Output:
    """Where an output is written, and what it is called.

    Attributes
    ----------
    given : str or path
    local : str or path
        The same; of a remote one a path in a temporary folder.
    """

    given: AnyPath
    local: AnyPath

    @property
    def is_remote(self) -> bool:
        """Whether what is written is uploaded afterwards."""
        return is_remote(self.given)

    def name(self, path: AnyPath) -> str:
        """What a file is called to users that was written to a local path."""
        if not self.is_remote:
            return str(path)
        within = Path(path).relative_to(Path(self.local).parent).as_posix()
        return beside(os.fspath(self.given), within)


@contextmanager
def uploaded(output: AnyPath, *, overwrite: bool) -> Iterator[Output]:
    """Where to write an output; a remote one is uploaded when the block succeeds.

    Its files appear whole. If they cannot be uploaded they are kept, and the error says where.

    Parameters
    ----------
    output : str or path
    overwrite : bool
        Whether files that are there may be replaced.

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
            raise StoreError(f"{error}; what was to be there is kept in {kept}") from None
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _check_mixture(address: str, made: set[str]) -> None:
    """Refuse a remote folder that holds other files: programs take what they find there."""
    there = {f"{address.rstrip('/')}/{one.name}" for one in files_below(address)}
    if others := sorted(there - made):
        raise InvalidInputError(
            f"{address} holds files that these are not to be mixed with: {listed(others)}; remove "
            "them, or name another folder"
        )


def _folder(address: str) -> str:
    """The address of the folder that the frames of an input are in."""
    name = name_of(address)
    is_file = Path(name).suffix.lower() in FORMATS or _has_magic(name)
    return folder_of(address) if is_file else plain(address).rstrip("/")


def _folder_name(address: str) -> str:
    """What that folder is called here: a sequence of frames has its name."""
    return re.sub(r"[^\w. -]", "_", name_of(_folder(address))).strip(". ") or "frames"


def _downloaded(addresses: list[str], folder: Path, notes: list[str] | None) -> Source:
    """Copies of remote files in a folder, which is made, as a source."""
    files = [file for address in addresses for file in _meant(address)]
    names = [name_of(file) for file in files]
    if len(set(names)) < len(names):
        raise InvalidInputError("two remote frames have one name; give them names of their own")
    folder.mkdir()
    for file, name in zip(files, names, strict=True):
        download(file, folder / name)
    if len(files) == 1:
        _DOWNLOADED[folder] = plain(files[0])
        _fetch_companion(folder / names[0])
    if notes is not None:
        size_mb = sum(path.stat().st_size for path in _files(folder)) / 1e6
        what = files[0] if len(files) == 1 else f"{counted(len(files), 'file')} of {addresses[0]}"
        notes.append(f"downloaded {what} ({size_mb:.3g} MB) to read it")
    if len(files) == 1 and len(addresses) == 1 and addresses[0] == files[0]:
        return folder / names[0]
    return [folder / name for name in names]


def _meant(address: str) -> list[str]:
    """Addresses of the files that one means: itself, frames of a folder, matches of a pattern."""
    if Path(name_of(address)).suffix.lower() in FORMATS and not _has_magic(name_of(address)):
        return [address]
    if _has_magic(address):
        found = _natural(matches(address))
        if not found:
            raise StoreError(f"the pattern {address} matches no file; check it")
        return found
    found = [one for one in files_in(address) if Path(name_of(one)).suffix.lower() in FRAME_FORMATS]
    if not found:
        raise StoreError(
            f"{address} is no folder of frames ({', '.join(FRAME_FORMATS)}), and its ending is "
            "that of no format; name a file"
        )
    return _natural(found)


def _natural(addresses: Iterable[str]) -> list[str]:
    of_name = {name_of(one): one for one in addresses}
    return [of_name[path.name] for path in natural_order(map(Path, of_name))]


def _has_magic(text: str) -> bool:
    return "*" in text or "[" in text


def _fetch_companion(path: Path) -> None:
    """The mesh beside a point cache, if there is one."""
    found = FORMATS[path.suffix.lower()]
    if isinstance(found, SequenceFormat) and found.companion:
        fetch_beside(path.with_suffix(found.companion))


def _files(place: Path) -> list[Path]:
    return [path for path in place.rglob("*") if path.is_file()]
