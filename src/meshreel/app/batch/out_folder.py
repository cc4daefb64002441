"""The output folder of a batch, local or remote."""

import os
import tempfile
from functools import cached_property
from pathlib import Path

from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.outputs.checks import check_output_folder
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.stores.filesystem import files_below
from meshreel.runtime.stores.transfer import check_remote_folder, read_whole, upload


class OutFolder:
    """A local output folder; names are relative paths with slashes."""

    n_writers: int = 1
    """Number of files to write at the same time."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def check(self) -> None:
        """Refuse a folder that is not writable."""
        check_output_folder(self.path)

    def has(self, name: str) -> bool:
        """Whether a file or folder exists."""
        return (self.path / name).exists()

    def size_bytes(self, name: str) -> int | None:
        """Size of a file; None if it does not exist."""
        path = self.path / name
        return path.stat().st_size if path.is_file() else None

    def is_one_of(self, name: str, files: tuple[Path, ...]) -> bool:
        """Whether an existing file is one of these, also through links."""
        return any((self.path / name).samefile(file) for file in files)

    def read(self, name: str) -> bytes:
        """Return the bytes of a file."""
        return (self.path / name).read_bytes()

    def write(self, name: str, data: bytes, *, overwrite: bool) -> None:
        """Write a file atomically, and create its folders."""
        path = self.path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with replace_when_done(path, overwrite=overwrite) as temporary:
            temporary.write_bytes(data)

    def called(self, name: str) -> str:
        """Path or address of a file, for messages."""
        return str(self.path / name)

    def relative_path_to(self, input_dir: Path | str) -> str:
        """Relative path to the input folder, valid if both are moved; or its remote address."""
        if not isinstance(input_dir, Path):
            return input_dir
        try:
            relative = os.path.relpath(input_dir.resolve(), self.path.resolve())
        except ValueError:  # on another drive
            return input_dir.resolve().as_posix()
        return Path(relative).as_posix()


class _RemoteFolder(OutFolder):
    """A remote folder, which is listed once: `has` and `size_bytes` describe that moment."""

    n_writers = 8

    def __init__(self, address: str) -> None:
        self.address = address.rstrip("/")

    def check(self) -> None:
        check_remote_folder(self.address)

    @cached_property
    def _sizes(self) -> dict[str, int]:
        return {file.name: file.size_bytes for file in files_below(self.address)}

    def has(self, name: str) -> bool:
        return name in self._sizes

    def size_bytes(self, name: str) -> int | None:
        return self._sizes.get(name)

    def is_one_of(self, name: str, files: tuple[Path, ...]) -> bool:
        return False  # the files are local

    def read(self, name: str) -> bytes:
        return read_whole(self.called(name))

    def write(self, name: str, data: bytes, *, overwrite: bool) -> None:
        with tempfile.TemporaryDirectory(prefix="meshreel-") as folder:
            path = Path(folder) / "output"
            path.write_bytes(data)
            upload(path, self.called(name), overwrite=overwrite)

    def called(self, name: str) -> str:
        return f"{self.address}/{name}"

    def relative_path_to(self, input_dir: Path | str) -> str:
        return input_dir if isinstance(input_dir, str) else input_dir.resolve().as_posix()


def out_folder(folder: Path | str) -> OutFolder:
    """The output folder at a path or an address."""
    return _RemoteFolder(folder) if is_remote(folder) else OutFolder(Path(folder))
