"""Files that a glTF file names: in its folder, or below it."""

import re
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.document import Document
from meshreel.formats.named_files import is_within, outside_error

SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


def file_beside(document: Document, uri: str, place: str) -> Path:
    """The file that a URI names, in the folder of the document or below, if it must be there.

    Raises
    ------
    FormatError
        If it is where it may not be, or not there.
    """
    name = unquote(uri)
    parts = PurePosixPath(name).parts
    is_remote = SCHEME.match(name) or name.startswith("//")
    if is_remote or "\\" in name or "\0" in name or not parts:
        raise FormatError(
            f"{place}: is in {uri[:200]!r}; only files in the folder of the glTF file, or in "
            "folders within it, are read; put it there"
        )
    path = document.folder.joinpath(*parts)
    with os_errors_naming(path):
        is_here = ".." not in parts and is_within(path, document.folder)
        is_there = path.is_file()
    if not (is_here or document.allow_outside):
        raise FormatError(f"{place}: {outside_error(name)}")
    if not is_there:
        raise FormatError(f"{place}: there is no file {name!r} beside the glTF file; put it there")
    return path
