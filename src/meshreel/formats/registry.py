"""Table of all formats by file extension.

A new format is a row here and a module that the row names, which is imported when a file with that
extension is first read or written.
"""

import os
from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.kinds import (
    ALL_TRACKS,
    FolderFormat,
    FrameFormat,
    Lazy,
    SequenceFormat,
    WriteOption,
    scene_format,
)
from meshreel.model.surface import Domain
from meshreel.runtime.extras import ALEMBIC, DRACO_FRAMES, HDF, OPEN_EXR, USD

NAMES = {"d3plot": ".d3plot"}
"""Extensions of files whose name has none."""

COMPANION = ".obj"
"""Extension of the mesh file that accompanies a point cache."""

NOT_OF_CORNERS = frozenset({Domain.VERTEX, Domain.FACE})
"""Domains of the tracks that VTK supports."""

FRAME_FORMATS = {
    found.extension: found
    for found in (
        FrameFormat(
            ".obj",
            "Wavefront OBJ",
            Lazy("meshes.obj:parse_obj"),
            Lazy("meshes.obj_writing:obj_encoder"),
            Lazy("meshes.obj:obj_positions_reader"),
            Lazy("meshes.obj_surface:parse_obj_surface"),
            Lazy("meshes.obj_surface:parse_obj_fields"),
            Lazy("meshes.obj:obj_fields_checker"),
            is_decimal=True,
            holds_tracks=ALL_TRACKS,
        ),
        FrameFormat(
            ".ply",
            "PLY",
            Lazy("meshes.ply:parse_ply"),
            Lazy("meshes.ply_writing:ply_encoder"),
            Lazy("meshes.ply:ply_positions_reader"),
            Lazy("meshes.ply_surface:parse_ply_surface"),
            Lazy("meshes.ply_surface:parse_ply_fields"),
            holds_tracks=ALL_TRACKS,
        ),
        FrameFormat(
            ".off",
            "OFF",
            Lazy("meshes.off:parse_off"),
            Lazy("meshes.off:off_encoder"),
            Lazy("meshes.off:off_positions_reader"),
            Lazy("meshes.off:parse_off_surface"),
            is_decimal=True,
        ),
        FrameFormat(
            ".stl",
            "STL",
            Lazy("meshes.stl:parse_stl"),
            Lazy("meshes.stl:stl_encoder"),
            Lazy("meshes.stl:stl_positions_reader"),
            Lazy("meshes.stl:parse_stl_surface"),
            is_decimal=True,
            has_unshared_vertices=True,
        ),
        FrameFormat(
            ".vtu",
            "VTK cells",
            Lazy("vtk.xml_file:parse_vtk_xml"),
            Lazy("vtk.xml_writing:vtu_encoder"),
            parse_surface=Lazy("vtk.xml_file:parse_vtk_xml_surface"),
            parse_fields=Lazy("vtk.xml_file:parse_vtk_xml_fields"),
            holds_tracks=NOT_OF_CORNERS,
        ),
        FrameFormat(
            ".vtp",
            "VTK polygons",
            Lazy("vtk.xml_file:parse_vtk_xml"),
            Lazy("vtk.xml_writing:vtp_encoder"),
            parse_surface=Lazy("vtk.xml_file:parse_vtk_xml_surface"),
            parse_fields=Lazy("vtk.xml_file:parse_vtk_xml_fields"),
            holds_tracks=NOT_OF_CORNERS,
        ),
        FrameFormat(
            ".vtk",
            "VTK legacy",
            Lazy("vtk.legacy:parse_vtk_legacy"),
            None,
            parse_surface=Lazy("vtk.legacy:parse_vtk_legacy_surface"),
            parse_fields=Lazy("vtk.legacy:parse_vtk_legacy_fields"),
        ),
        FrameFormat(
            ".drc",
            "Draco",
            Lazy("meshes.drc:parse_drc"),
            None,
            parse_surface=Lazy("meshes.drc:parse_drc_surface"),
            parse_fields=Lazy("meshes.drc:parse_drc_fields"),
            extra=DRACO_FRAMES,
        ),
    )
}
GLTF_OPTIONS: frozenset[WriteOption] = frozenset({"targets", "max_error", "normals"})
SEQUENCE_FORMATS = {
    found.extension: found
    for found in (
        SequenceFormat(
            ".npz",
            "NumPy archive",
            Lazy("arrays.npz:open_npz"),
            Lazy("arrays.npz:write_npz"),
            reads=frozenset({"dataset"}),
            holds_tracks=ALL_TRACKS,
        ),
        SequenceFormat(
            ".reel",
            "meshreel",
            Lazy("reel:open_reel"),
            None,
            write_segments=Lazy("reel:write_reel"),
            writes=frozenset({"max_error", "lossless"}),
            holds_materials=True,
            holds_tracks=ALL_TRACKS,
        ),
        scene_format(
            ".abc",
            "Alembic",
            Lazy("alembic.meshes:read_meshes"),
            None,
            ALEMBIC,
            reads_without_extra=True,
            write_segments=Lazy("alembic.write:write_alembic"),
            holds_tracks=ALL_TRACKS,
        ),
        *(
            scene_format(
                extension,
                title,
                Lazy("usd.reading:read_meshes"),
                None,
                USD,
                write_segments=Lazy("usd.writing:write_usd"),
                names_files=True,
                holds_materials=True,
                has_image_folder=extension != ".usdz",
                holds_tracks=ALL_TRACKS,
            )
            for extension, title in (
                (".usd", "USD"),
                (".usda", "USD, text"),
                (".usdc", "USD, binary"),
                (".usdz", "USD, package"),
            )
        ),
        *(
            scene_format(
                extension,
                title,
                Lazy("gltf.read:read_meshes"),
                None,
                write_segments=write,
                names_files=True,
                writes=GLTF_OPTIONS,
                holds_materials=True,
                list_animations=Lazy("gltf.read:list_animations"),
            )
            for extension, title, write in (
                (".glb", "glTF, binary", Lazy("gltf.write:write_glb")),
                (".gltf", "glTF, text", Lazy("gltf.write:write_gltf")),
            )
        ),
        SequenceFormat(
            ".pc2",
            "point cache of 3ds Max",
            Lazy("caches.pc2:open_pc2"),
            Lazy("caches.pc2:write_pc2"),
            reads=frozenset({"topology"}),
            companion=COMPANION,
        ),
        SequenceFormat(
            ".mdd",
            "point cache of LightWave",
            Lazy("caches.mdd:open_mdd"),
            Lazy("caches.mdd:write_mdd"),
            reads=frozenset({"topology"}),
            companion=COMPANION,
        ),
        *(
            SequenceFormat(
                extension,
                "HDF5 datasets",
                Lazy("arrays.hdf:open_hdf_sequence"),
                Lazy("arrays.hdf:write_hdf"),
                HDF,
                frozenset({"dataset", "object", "merge", "skip_bad"}),
                holds_tracks=ALL_TRACKS,
            )
            for extension in (".h5", ".hdf5", ".hdf")
        ),
        scene_format(
            ".vtkhdf",
            "VTKHDF",
            Lazy("vtk.vtkhdf:read_vtkhdf"),
            None,
            HDF,
            write_segments=Lazy("vtk.vtkhdf_writer:write_vtkhdf"),
            holds_tracks=NOT_OF_CORNERS,
        ),
        scene_format(
            ".pvd",
            "ParaView collection",
            Lazy("vtk.pvd:read_pvd"),
            None,
            write_segments=Lazy("vtk.xml_writing:write_pvd"),
            names_files=True,
            holds_tracks=NOT_OF_CORNERS,
            data_files=Lazy("vtk.xml_writing:pvd_pieces"),
        ),
        *(
            scene_format(
                extension,
                "XDMF",
                Lazy("vtk.xdmf:read_xdmf"),
                None,
                HDF,
                write_segments=Lazy("vtk.xdmf_writing:write_xdmf"),
                names_files=True,
                holds_tracks=NOT_OF_CORNERS,
                data_files=Lazy("vtk.xdmf_writing:xdmf_data_files"),
            )
            for extension in (".xdmf", ".xmf")
        ),
        scene_format(
            ".d3plot",
            "LS-DYNA d3plot",
            Lazy("solvers.d3plot:read_d3plot"),
            None,
            other_files=Lazy("solvers.d3plot_files:other_files"),
        ),
        *(
            scene_format(
                extension,
                "EnSight Gold",
                Lazy("solvers.ensight:read_ensight"),
                None,
                names_files=True,
            )
            for extension in (".case", ".encas")
        ),
    )
}
FORMATS: dict[str, FrameFormat | SequenceFormat] = {**FRAME_FORMATS, **SEQUENCE_FORMATS}
FOLDER_FORMATS = {
    found.extension: found
    for found in (
        FolderFormat(
            ".vat",
            "vertex animation textures",
            Lazy("vat.folder:vat_files"),
            Lazy("vat.folder:write_vat"),
            OPEN_EXR,
            frozenset({"layout", "textures", "max_error", "normals"}),
        ),
    )
}
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
            f"{path}: {extension} files are neither read nor written; exchange animations with "
            f"{PROGRAMS[extension]} as Alembic (.abc), USD (.usdc) or glTF (.glb)"
        )
    if extension not in FORMATS:
        raise FormatError(
            f"{path}: unknown file extension {extension or '(none)'}; "
            f"known are {', '.join(FORMATS)}"
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
    return [*(one.extension for one in FORMATS.values() if is_written(one)), *FOLDER_FORMATS]


def is_written(found: FrameFormat | SequenceFormat) -> bool:
    """Whether a format can be written."""
    if isinstance(found, FrameFormat):
        return found.encoder is not None
    return found.write is not None or found.write_segments is not None


def holds_segments(found: FrameFormat | SequenceFormat | FolderFormat) -> bool:
    """Whether frames with different faces can be written in a format."""
    if isinstance(found, FolderFormat):
        return False
    if isinstance(found, FrameFormat):
        return found.encoder is not None
    return found.write_segments is not None


def described_formats() -> list[dict[str, Any]]:
    """Return all formats in plain types: capabilities and required extra, for JSON."""
    return [
        {
            "extension": one.extension,
            "title": one.title,
            "holds": "one frame" if isinstance(one, FrameFormat) else "all frames",
            "reads": not isinstance(one, FolderFormat),
            "writes": isinstance(one, FolderFormat) or is_written(one),
            "writes_changing_faces": holds_segments(one),
            "extra": extra.name if extra else None,
            "library": extra.library if extra else None,
            "reads_without_extra": extra is None
            or (isinstance(one, SequenceFormat) and one.reads_without_extra),
            "is_installed": extra is None or extra.is_installed,
        }
        for one in (*FORMATS.values(), *FOLDER_FORMATS.values())
        for extra in [one.extra]
    ]
