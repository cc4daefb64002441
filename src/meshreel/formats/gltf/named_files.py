"""Files that a glTF file names: in its folder, or below it."""

import re
from pathlib import Path, PurePosixPath, PureWindowsPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.gltf.document import Document
from meshreel.formats.naming import os_errors_naming

SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


def file_beside(document: Document, uri: str, place: str) -> Path:
    """The file that a URI names, in the folder of the document or below it.

    Raises
    ------
    FormatError
        If it is elsewhere, or not there.
    """
    name = unquote(uri)
    parts = PurePosixPath(name).parts
    is_outside = SCHEME.match(name) or PureWindowsPath(name).anchor or ".." in parts
    if is_outside or "\\" in name or "\0" in name or not parts:
        raise FormatError(
            f"{place}: is in {uri[:200]!r}; only files in the folder of the glTF file, or in "
            "folders within it, are read; put it there"
        )
    path = document.folder.joinpath(*parts)
    with os_errors_naming(path):
        is_within = path.resolve().is_relative_to(document.folder.resolve())
        is_there = path.is_file()
    if not is_within:
        raise FormatError(f"{place}: {name!r} is a link that leaves the folder of the glTF file")
    if not is_there:
        raise FormatError(f"{place}: there is no file {name!r} beside the glTF file; put it there")
    return path
