"""Hidden folders for incomplete outputs, and removal of those of dead processes."""

import hashlib
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

_NAME = re.compile(r"\.meshreel-([0-9a-f]{12})-([0-9]{1,9})-")


@contextmanager
def hidden_folder(parent: Path) -> Iterator[Path]:
    """A new hidden folder in `parent`, removed with all its files when the block ends.

    Its name contains the process id, so that `remove_abandoned` can find it if the process dies.
    """
    prefix = f".meshreel-{_machine()}-{os.getpid()}-"
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_abandoned(parent: Path) -> None:
    """Remove hidden folders in `parent` whose processes died, as far as possible.

    Only those of this user and this machine: it is unknown whether other processes are alive.
    """
    if not hasattr(os, "geteuid"):  # on Windows os.kill(process, 0) may end the process
        return
    with suppress(OSError), os.scandir(parent) as entries:
        for entry in entries:
            if _is_abandoned(entry):
                shutil.rmtree(entry.path, ignore_errors=True)


def _is_abandoned(entry: os.DirEntry[str]) -> bool:
    match = _NAME.match(entry.name)
    if not match or match[1] != _machine() or _is_alive(int(match[2])):
        return False
    status = entry.stat(follow_symlinks=False)
    return entry.is_dir(follow_symlinks=False) and status.st_uid == os.geteuid()


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # a process of another user
        return True
    return True


@cache
def _machine() -> str:
    """A short hash of the names of this machine and container, which scope process ids."""
    try:
        container = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        container = 0
    return hashlib.sha256(f"{socket.gethostname()}\0{container}".encode()).hexdigest()[:12]
