"""Files in stores of fsspec."""

from pathlib import Path
from tempfile import TemporaryDirectory

import fsspec

import meshreel


def put(sequence, address):
    """Save a sequence and copy its files to a store; return their addresses."""
    folder, _, name = address.rpartition("/")
    with TemporaryDirectory() as local:
        names = [path.name for path in meshreel.save(sequence, Path(local, name))]
        names = [*dict.fromkeys([*names, *(path.name for path in Path(local).iterdir())])]
        addresses = [f"{folder}/{one}" for one in names]
        for one, target in zip(names, addresses, strict=True):
            store, path = fsspec.core.url_to_fs(target)
            store.put_file(str(Path(local, one)), path)
    return addresses
