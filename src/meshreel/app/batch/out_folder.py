"""The folder of outputs of a batch, on this machine or in a store."""

import os
import tempfile
from functools import cached_property
from pathlib import Path
from typing import Protocol

from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.outputs.checks import check_output_folder
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.stores.listing import files_below
from meshreel.runtime.stores.transfer import check_outputs, read_whole, upload_all


class OutFolder(Protocol):
    """A folder of outputs; names are paths within it, with slashes."""

    def check(self) -> None:
        """Refuse a folder that takes no files, before any work."""

    def has(self, name: str) -> bool:
        """Whether anything of this name was there when the batch was planned."""

    def size_bytes(self, name: str) -> int | None:
        """Of a file that was there then; None if there was none."""

    def is_one_of(self, name: str, files: tuple[Path, ...]) -> bool:
        """Whether a file that is there is one of these, under whatever name."""

    def read(self, name: str) -> bytes:
        """The bytes of a file that is there."""

    def write(self, name: str, data: bytes, *, overwrite: bool) -> None:
        """Write a file whole or not at all; its folders are made."""

    def called(self, name: str) -> str:
        """What a file is called to users."""

    def seen_to(self, input_dir: Path | str) -> str:
        """The folder of inputs as seen from here: it stays true when both are moved together."""


class LocalFolder:
    """A folder of this machine."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def check(self) -> None:
        """Refuse what is no folder, or takes no files."""
        check_output_folder(self.path)

    def has(self, name: str) -> bool:
        """Whether anything of this name is there."""
        return (self.path / name).exists()

    def size_bytes(self, name: str) -> int | None:
        """Of a file; None if there is none."""
        path = self.path / name
        return path.stat().st_size if path.is_file() else None

    def is_one_of(self, name: str, files: tuple[Path, ...]) -> bool:
        """Whether it is one of these, through links, too."""
        return any((self.path / name).samefile(file) for file in files)

    def read(self, name: str) -> bytes:
        """The bytes of a file."""
        return (self.path / name).read_bytes()

    def write(self, name: str, data: bytes, *, overwrite: bool) -> None:
        """Write a file under a hidden name, and rename it."""
        path = self.path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with replace_when_done(path, overwrite=overwrite) as temporary:
            temporary.write_bytes(data)

    def called(self, name: str) -> str:
        """Its path."""
        return str(self.path / name)

    def seen_to(self, input_dir: Path | str) -> str:
        """A path from here; of inputs in a store their address."""
        if not isinstance(input_dir, Path):
            return input_dir
        try:
            seen = os.path.relpath(input_dir.resolve(), self.path.resolve())
        except ValueError:  # on another drive
            return input_dir.resolve().as_posix()
        return Path(seen).as_posix()


class RemoteFolder:
    """A folder in a store, which is listed once."""

    def __init__(self, address: str) -> None:
        self.address = address.rstrip("/")

    def check(self) -> None:
        """Refuse an address where nothing can be written."""
        check_outputs([self.called("manifest.json")], overwrite=True)

    @cached_property
    def _sizes(self) -> dict[str, int]:
        return {one.name: one.size_bytes for one in files_below(self.address)}

    def has(self, name: str) -> bool:
        """Whether there was a file of this name."""
        return name in self._sizes

    def size_bytes(self, name: str) -> int | None:
        """Of a file that was there; None if there was none."""
        return self._sizes.get(name)

    def is_one_of(self, name: str, files: tuple[Path, ...]) -> bool:
        """No: those are of this machine."""
        return False

    def read(self, name: str) -> bytes:
        """The bytes of a file."""
        return read_whole(self.called(name))

    def write(self, name: str, data: bytes, *, overwrite: bool) -> None:
        """Upload a file, which appears whole."""
        with tempfile.TemporaryDirectory(prefix="meshreel-") as place:
            path = Path(place) / "output"
            path.write_bytes(data)
            upload_all({path: self.called(name)}, overwrite=overwrite)

    def called(self, name: str) -> str:
        """Its address."""
        return f"{self.address}/{name}"

    def seen_to(self, input_dir: Path | str) -> str:
        """The address of the inputs, or their path on this machine."""
        return input_dir if isinstance(input_dir, str) else input_dir.resolve().as_posix()


def out_folder(given: Path | str) -> OutFolder:
    """The folder that a path or an address means."""
    return RemoteFolder(given) if is_remote(given) else LocalFolder(Path(given))
