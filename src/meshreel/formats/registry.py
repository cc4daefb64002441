"""Table of all formats by file extension.

A new format is a line here and a module whose `FORMATS` are the rows of its extensions; it is
imported when a file with that extension is first read or written.
"""

import os
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, cast

from meshreel.errors import FormatError
from meshreel.formats.kinds import FolderFormat, FrameFormat, SequenceFormat

Row = TypeVar("Row", FrameFormat, SequenceFormat, FolderFormat, FrameFormat | SequenceFormat)

NAMES = {"d3plot": ".d3plot"}
"""Extensions of files whose name has none."""

STREAMS = (".reel", ".mp4")
"""Extensions of files with a stream; in .mp4 it is beside a video, the texture, and sound."""

COMPANION = ".obj"
"""Extension of the mesh file that accompanies a point cache."""


class Formats(Mapping[str, Row]):
    """Formats by file extension, whose modules are imported on access.

    Parameters
    ----------
    modules : dict of str to str
        Module of each extension, in `meshreel.formats`.
    """

    def __init__(self, modules: dict[str, str]) -> None:
        self._modules = modules

    def __getitem__(self, extension: str) -> Row:
        """Return the format of an extension."""
        rows = import_module(f"meshreel.formats.{self._modules[extension]}").FORMATS
        return cast("Row", next(row for row in rows if row.extension == extension))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the extensions."""
        return iter(self._modules)

    def __len__(self) -> int:
        """Return the number of extensions."""
        return len(self._modules)

    def __contains__(self, extension: object) -> bool:
        """Whether an extension is known, without importing its module."""
        return extension in self._modules


_FRAME_MODULES = {
    ".obj": "meshes.obj",
    ".ply": "meshes.ply",
    ".off": "meshes.off",
    ".stl": "meshes.stl",
    ".vtu": "vtk.xml_file",
    ".vtp": "vtk.xml_file",
    ".vtk": "vtk.legacy",
    ".drc": "meshes.drc",
}
_SEQUENCE_MODULES = {
    ".npz": "arrays.npz",
    **dict.fromkeys(STREAMS, "reel"),
    ".abc": "alembic.write",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "usd.rigged"),
    **dict.fromkeys((".glb", ".gltf"), "gltf.write"),
    **dict.fromkeys((".pc2", ".mdd"), "point_caches"),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), "arrays.hdf"),
    ".vtkhdf": "vtk.vtkhdf",
    ".pvd": "vtk.pvd",
    **dict.fromkeys((".xdmf", ".xmf"), "vtk.xdmf"),
    ".d3plot": "solvers.d3plot",
    **dict.fromkeys((".case", ".encas"), "solvers.ensight"),
    **dict.fromkeys((".e", ".ex2", ".exo", ".g", ".foam", ".cgns", ".cas"), "vtk.library_readers"),
}
FRAME_FORMATS: Formats[FrameFormat] = Formats(_FRAME_MODULES)
SEQUENCE_FORMATS: Formats[SequenceFormat] = Formats(_SEQUENCE_MODULES)
FORMATS: Formats[FrameFormat | SequenceFormat] = Formats(_FRAME_MODULES | _SEQUENCE_MODULES)
FOLDER_FORMATS: Formats[FolderFormat] = Formats({".vat": "vat.folder"})
"""Formats whose outputs are folders."""

PROGRAMS = {
    ".fbx": "other programs",
    ".blend": "Blender",
    ".ma": "Maya",
    ".mb": "Maya",
    ".max": "3ds Max",
    ".c4d": "Cinema 4D",
    ".hip": "Houdini",
    ".hiplc": "Houdini",
    ".hipnc": "Houdini",
    ".dae": "other programs",
}
"""Extensions of scenes that only their programs read completely, and these programs."""

ADVICE = {
    **dict.fromkeys((".xdmf", ".xmf"), "ParaView and VisIt also read .vtkhdf and .pvd"),
    ".mp4": "`meshreel register --texture` writes them; of other sequences, write a .reel",
}
"""Advice for formats that are read, but not written; otherwise all written formats are listed."""


def extension_of(path: str | os.PathLike[str]) -> str:
    """Return the extension that selects the format of a path, in lower case; empty for none."""
    name = Path(path).name.lower()
    return NAMES.get(name, Path(name).suffix)


def format_of(path: Path) -> FrameFormat | SequenceFormat:
    """Return the format of a path by its extension, ignoring case.

    Raises
    ------
    FormatError
        If the extension is unknown; for `PROGRAMS` the message lists formats that they exchange.
    """
    extension = extension_of(path)
    if extension in PROGRAMS:
        raise FormatError(
            f"{extension} files are neither read nor written; exchange animations with "
            f"{PROGRAMS[extension]} as Alembic (.abc), USD (.usdc) or glTF (.glb)",
            path=path,
        )
    if extension not in FORMATS:
        raise FormatError(
            f"unknown file extension {extension or '(none)'}; known are {', '.join(FORMATS)}",
            path=path,
        )
    return FORMATS[extension]


def output_format_of(path: Path) -> FrameFormat | SequenceFormat | FolderFormat:
    """Return the format of an output by its extension, which may be a folder format.

    Raises
    ------
    FormatError
        If the extension is unknown.
    """
    return FOLDER_FORMATS.get(path.suffix.lower()) or format_of(path)


def written_extensions() -> list[str]:
    """Return the extensions of all formats that can be written."""
    return [*(entry.extension for entry in FORMATS.values() if is_written(entry)), *FOLDER_FORMATS]


def is_written(entry: FrameFormat | SequenceFormat) -> bool:
    """Whether a format can be written."""
    return (entry.encoder if isinstance(entry, FrameFormat) else entry.write) is not None


def described_formats() -> list[dict[str, Any]]:
    """Return all formats in plain types: capabilities and required extra, for JSON."""
    return [
        {
            "extension": entry.extension,
            "title": entry.title,
            "holds": "one frame" if isinstance(entry, FrameFormat) else "all frames",
            "reads": not isinstance(entry, FolderFormat),
            "writes": isinstance(entry, FolderFormat) or is_written(entry),
            "writes_changing_faces": entry.holds_segments,
            "extra": extra.name if extra else None,
            "library": extra.library if extra else None,
            "reads_without_extra": extra is None or entry.reads_without_extra,
            "is_installed": extra is None or extra.is_installed,
        }
        for entry in (*FORMATS.values(), *FOLDER_FORMATS.values())
        for extra in [entry.extra]
    ]
