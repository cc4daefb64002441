"""Hidden folders for outputs until they are complete, and those that dead processes left."""

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
def hidden_folder(place: Path) -> Iterator[Path]:
    """A new hidden folder in `place`, removed with all its files when the block ends.

    Its name says which process made it. If that is killed, `remove_abandoned` finds it.
    """
    prefix = f".meshreel-{_machine()}-{os.getpid()}-"
    made = Path(tempfile.mkdtemp(prefix=prefix, dir=place))
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)


def remove_abandoned(place: Path) -> None:
    """Remove hidden folders in `place` whose processes were killed.

    Only those that this user's processes made on this machine: whether others live is not known.
    What cannot be removed stays.
    """
    if not hasattr(os, "geteuid"):  # On Windows asking for a process may end it.
        return
    with suppress(OSError), os.scandir(place) as entries:
        for entry in entries:
            if _is_abandoned(entry):
                shutil.rmtree(entry.path, ignore_errors=True)


def _is_abandoned(entry: os.DirEntry[str]) -> bool:
    found = _NAME.match(entry.name)
    if not found or found[1] != _machine() or _lives(int(found[2])):
        return False
    facts = entry.stat(follow_symlinks=False)
    return entry.is_dir(follow_symlinks=False) and facts.st_uid == os.geteuid()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        return True
    return True


@cache
def _machine() -> str:
    """A short hash of this machine's name and of its container, whose process ids count."""
    try:
        container = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        container = 0
    return hashlib.sha256(f"{socket.gethostname()}\0{container}".encode()).hexdigest()[:12]
