"""Which file endings there are, and who reads and writes them."""

import os
from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.alembic.meshes import read_meshes as read_alembic
from meshreel.formats.alembic.write import write_alembic
from meshreel.formats.arrays.hdf import open_hdf_sequence, write_hdf
from meshreel.formats.arrays.npz import write_npz
from meshreel.formats.arrays.npz_frames import open_npz
from meshreel.formats.caches.mdd import mdd_opener, write_mdd
from meshreel.formats.caches.pc2 import pc2_opener, write_pc2
from meshreel.formats.caches.topology import COMPANION, topology_reader
from meshreel.formats.extras import ALEMBIC, HDF, USD
from meshreel.formats.gltf.read import read_meshes as read_gltf
from meshreel.formats.gltf.write import write_glb, write_gltf
from meshreel.formats.kinds import FrameFormat, SequenceFormat, WriteOption, scene_format
from meshreel.formats.meshes.obj import obj_positions_like, parse_obj
from meshreel.formats.meshes.obj_surface import parse_obj_surface
from meshreel.formats.meshes.obj_writing import obj_encoder
from meshreel.formats.meshes.off import off_positions_like, parse_off
from meshreel.formats.meshes.off_surface import parse_off_surface
from meshreel.formats.meshes.off_writing import off_encoder
from meshreel.formats.meshes.ply import parse_ply, ply_positions_like
from meshreel.formats.meshes.ply_surface import parse_ply_surface
from meshreel.formats.meshes.ply_writing import ply_encoder
from meshreel.formats.meshes.stl import (
    parse_stl,
    parse_stl_surface,
    stl_encoder,
    stl_positions_like,
)
from meshreel.formats.reel import open_reel, write_reel
from meshreel.formats.usd.reading import read_meshes as read_usd
from meshreel.formats.usd.writing import write_usd
from meshreel.formats.vtk.legacy import parse_vtk_legacy, parse_vtk_legacy_surface
from meshreel.formats.vtk.pvd import read_pvd
from meshreel.formats.vtk.vtkhdf import read_vtkhdf
from meshreel.formats.vtk.vtkhdf_writer import write_vtkhdf
from meshreel.formats.vtk.xdmf import read_xdmf
from meshreel.formats.vtk.xml_file import parse_vtk_xml, parse_vtk_xml_surface

FRAME_FORMATS = {
    found.ending: found
    for found in (
        FrameFormat(
            ".obj",
            "Wavefront OBJ",
            parse_obj,
            obj_encoder,
            obj_positions_like,
            parse_obj_surface,
            is_decimal=True,
        ),
        FrameFormat(
            ".ply",
            "PLY",
            parse_ply,
            ply_encoder,
            ply_positions_like,
            parse_ply_surface,
        ),
        FrameFormat(
            ".off",
            "OFF",
            parse_off,
            off_encoder,
            off_positions_like,
            parse_off_surface,
            is_decimal=True,
        ),
        FrameFormat(
            ".stl",
            "STL",
            parse_stl,
            stl_encoder,
            stl_positions_like,
            parse_stl_surface,
            is_decimal=True,
            has_corners_only=True,
        ),
        FrameFormat(".vtu", "VTK cells", parse_vtk_xml, None, parse_surface=parse_vtk_xml_surface),
        FrameFormat(
            ".vtp", "VTK polygons", parse_vtk_xml, None, parse_surface=parse_vtk_xml_surface
        ),
        FrameFormat(
            ".vtk", "VTK legacy", parse_vtk_legacy, None, parse_surface=parse_vtk_legacy_surface
        ),
    )
}
GLTF_OPTIONS: frozenset[WriteOption] = frozenset({"targets", "max_error", "normals"})
SEQUENCE_FORMATS = {
    found.ending: found
    for found in (
        SequenceFormat(".npz", "NumPy archive", open_npz, write_npz, reads=frozenset({"dataset"})),
        SequenceFormat(
            ".reel",
            "meshreel",
            open_reel,
            write_reel,
            writes=frozenset({"max_error"}),
            holds_materials=True,
        ),
        scene_format(".abc", "Alembic", read_alembic, write_alembic, ALEMBIC),
        *(
            scene_format(
                ending,
                title,
                read_usd,
                write_usd,
                USD,
                names_files=True,
                holds_materials=True,
                has_image_folder=ending != ".usdz",
            )
            for ending, title in (
                (".usd", "USD"),
                (".usda", "USD, text"),
                (".usdc", "USD, binary"),
                (".usdz", "USD, package"),
            )
        ),
        *(
            scene_format(
                ending,
                title,
                read_gltf,
                write,
                names_files=True,
                writes=GLTF_OPTIONS,
                holds_materials=True,
            )
            for ending, title, write in (
                (".glb", "glTF, binary", write_glb),
                (".gltf", "glTF, text", write_gltf),
            )
        ),
        SequenceFormat(
            ".pc2",
            "point cache of 3ds Max",
            pc2_opener(topology_reader(FRAME_FORMATS)),
            write_pc2,
            reads=frozenset({"topology"}),
            companion=COMPANION,
        ),
        SequenceFormat(
            ".mdd",
            "point cache of LightWave",
            mdd_opener(topology_reader(FRAME_FORMATS)),
            write_mdd,
            reads=frozenset({"topology"}),
            companion=COMPANION,
        ),
        *(
            SequenceFormat(
                ending,
                "HDF5 datasets",
                open_hdf_sequence,
                write_hdf,
                HDF,
                frozenset({"dataset", "object", "merge", "skip_bad"}),
            )
            for ending in (".h5", ".hdf5", ".hdf")
        ),
        scene_format(".vtkhdf", "VTKHDF", read_vtkhdf, write_vtkhdf, HDF),
        scene_format(".pvd", "ParaView collection", read_pvd, None, names_files=True),
        scene_format(".xdmf", "XDMF", read_xdmf, None, HDF, names_files=True),
        scene_format(".xmf", "XDMF", read_xdmf, None, HDF, names_files=True),
    )
}
FORMATS: dict[str, FrameFormat | SequenceFormat] = {**FRAME_FORMATS, **SEQUENCE_FORMATS}


def format_of(path: Path) -> FrameFormat | SequenceFormat:
    """The format that the ending of a path stands for, in whatever case it is written.

    Raises
    ------
    FormatError
        If it is none of those known.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise FormatError(
            f"{path}: the ending {ending or '(none)'} is not known; known are {', '.join(FORMATS)}"
        )
    return FORMATS[ending]


def holds_meshes(path: str | os.PathLike[str]) -> bool:
    """Whether a file of this ending may hold several meshes, one of which can be chosen."""
    found = FORMATS.get(Path(path).suffix.lower())
    return isinstance(found, SequenceFormat) and found.read_meshes is not None


def is_written(found: FrameFormat | SequenceFormat) -> bool:
    """Whether files of a format are written, and not only read."""
    return (found.write if isinstance(found, SequenceFormat) else found.encoder) is not None


def described_formats() -> list[dict[str, Any]]:
    """Every format, in plain types: what it is, what can be done with it, and what that needs."""
    return [
        {
            "ending": one.ending,
            "title": one.title,
            "holds": "all frames" if isinstance(one, SequenceFormat) else "one frame",
            "reads": True,
            "writes": is_written(one),
            "extra": extra.name if extra else None,
            "library": extra.library if extra else None,
            "is_installed": extra is None or extra.is_installed,
        }
        for one in FORMATS.values()
        for extra in [one.extra if isinstance(one, SequenceFormat) else None]
    ]
