"""Files to which a glTF file refers by relative URI."""

import re
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.gltf.document import Document

SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


def referenced_file(document: Document, uri: str, place: str) -> Path:
    """Return the path of a file to which a document refers, after checking its location.

    Raises
    ------
    FormatError
        If it is missing, or outside of the folder without permission.
    """
    name = unquote(uri)
    parts = PurePosixPath(name).parts
    is_remote = SCHEME.match(name) or name.startswith("//")
    if is_remote or "\\" in name or "\0" in name or not parts:
        raise FormatError(
            f"{place}: refers to {uri[:200]!r}; only files in the folder of the glTF file or below "
            "are supported; move the file there"
        )
    path = document.folder.joinpath(*parts)
    with os_errors_naming(path):
        is_inside = ".." not in parts and is_within(path, document.folder)
        exists = path.is_file()
    if not (is_inside or document.allow_outside):
        raise FormatError(f"{place}: {outside_error(name)}")
    if not exists:
        raise FormatError(f"{place}: there is no file {name!r} next to the glTF file")
    return path
