"""meshreel compresses animated triangle meshes.

    import meshreel

    data = meshreel.encode("samba.npz")             # or a MeshSequence
    decoded = meshreel.decode(data)
    quality = meshreel.compare("samba.npz", decoded)

MeshSequence      an animated mesh: vertices, faces, frames per second; one or more segments of
                  constant connectivity; concatenate joins several; a MeshFrame is one frame
Cells             tetrahedra, hexahedra and others of a volume mesh, whose surface are the faces
Surface           its polygons, hard edges, Attribute (Domain, Kind), FaceGroups and Part
Track             a quantity that changes over time, such as stress or velocity: TrackKind
Material          appearance of a face group: Texture (Wrap, Filter), Image, AlphaMode
register          raw frames, each with its own mesh, to segments that follow the surface
rig               bones, weights, keys and correctives of an animation: Rig (RigErrors)
load, save        files of all formats to a sequence and back
encode, decode    a sequence or a file to the bytes of a .reel stream and back
corner_normals    normals of one or several frames, split at the hard edges of a Surface
compare           errors between two sequences: Quality; SurfaceQuality (SurfaceDistances)
                  if their meshes differ
fmpd, msdm2       perceptual errors of frames: roughness, curvature
info              contents of a stream, and its bytes by section: StreamInfo
open              a .reel file whose frames are decoded on demand: ReelFile
Encoder           encodes frames as they arrive
from_pyvista, to_pyvista, from_trimesh, to_trimesh
                  meshes of these libraries to a sequence, and a frame as such a mesh
simulate_flag     a synthetic sequence for experiments
paper             the paper's seven methods for experiments: their streams as arrays, their steps
MeshReelError     base class of all errors: InvalidInputError, FormatError, CorruptStreamError,
                  TruncatedStreamError, UnsupportedVersionError, SolverError, StoreError,
                  OutputError, MemoryLimitError, WorkerDiedError, ConnectivityChangeError
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from meshreel import methods as _methods  # noqa: F401  registers the coding methods
from meshreel.model.showing import Viewer as _Viewer
from meshreel.model.showing import install_viewer as _install_viewer
from meshreel.runtime.version import __version__ as __version__

if TYPE_CHECKING:
    from meshreel import paper as paper
    from meshreel.api import compare, decode, encode, info, register, rig
    from meshreel.codec.inspect import StreamInfo
    from meshreel.codec.reel_file import ReelFile
    from meshreel.codec.streaming import Encoder
    from meshreel.errors import (
        ConnectivityChangeError,
        CorruptStreamError,
        FormatError,
        InvalidInputError,
        MemoryLimitError,
        MeshReelError,
        OutputError,
        SolverError,
        StoreError,
        TruncatedStreamError,
        UnsupportedVersionError,
        WorkerDiedError,
    )
    from meshreel.formats.load import load
    from meshreel.formats.reel import open
    from meshreel.metrics.compare import Quality
    from meshreel.metrics.fmpd import fmpd
    from meshreel.metrics.msdm2 import msdm2
    from meshreel.metrics.surface_distance import SurfaceDistances, SurfaceQuality
    from meshreel.model.cells import Cells
    from meshreel.model.flag import simulate_flag
    from meshreel.model.geometry.hard_edges import corner_normals
    from meshreel.model.materials import AlphaMode, Filter, Image, Material, Texture, Wrap
    from meshreel.model.rig import Rig, RigErrors
    from meshreel.model.sequence import MeshFrame, MeshSequence, concatenate
    from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
    from meshreel.model.tracks import Track, TrackKind
    from meshreel.operations.interop import from_pyvista, from_trimesh, to_pyvista, to_trimesh
    from meshreel.operations.save import save

__all__ = [
    "AlphaMode",
    "Attribute",
    "Cells",
    "ConnectivityChangeError",
    "CorruptStreamError",
    "Domain",
    "Encoder",
    "FaceGroups",
    "Filter",
    "FormatError",
    "Image",
    "InvalidInputError",
    "Kind",
    "Material",
    "MemoryLimitError",
    "MeshFrame",
    "MeshReelError",
    "MeshSequence",
    "OutputError",
    "Part",
    "Quality",
    "ReelFile",
    "Rig",
    "RigErrors",
    "SolverError",
    "StoreError",
    "StreamInfo",
    "Surface",
    "SurfaceDistances",
    "SurfaceQuality",
    "Texture",
    "Track",
    "TrackKind",
    "TruncatedStreamError",
    "UnsupportedVersionError",
    "WorkerDiedError",
    "Wrap",
    "compare",
    "concatenate",
    "corner_normals",
    "decode",
    "encode",
    "fmpd",
    "from_pyvista",
    "from_trimesh",
    "info",
    "load",
    "msdm2",
    "open",
    "register",
    "rig",
    "save",
    "simulate_flag",
    "to_pyvista",
    "to_trimesh",
]

_SURFACE = ("Attribute", "Domain", "FaceGroups", "Kind", "Part", "Surface")
_MATERIALS = ("AlphaMode", "Filter", "Image", "Material", "Texture", "Wrap")
_MODULES = {
    **dict.fromkeys(_SURFACE, "model.surface"),
    **dict.fromkeys(_MATERIALS, "model.materials"),
    **dict.fromkeys(("compare", "decode", "encode", "info", "register", "rig"), "api"),
    **dict.fromkeys(("MeshFrame", "MeshSequence", "concatenate"), "model.sequence"),
    "Cells": "model.cells",
    "corner_normals": "model.geometry.hard_edges",
    "Encoder": "codec.streaming",
    "fmpd": "metrics.fmpd",
    **dict.fromkeys(
        ("from_pyvista", "from_trimesh", "to_pyvista", "to_trimesh"), "operations.interop"
    ),
    "load": "formats.load",
    "msdm2": "metrics.msdm2",
    "open": "formats.reel",
    "Quality": "metrics.compare",
    "ReelFile": "codec.reel_file",
    "save": "operations.save",
    "simulate_flag": "model.flag",
    **dict.fromkeys(("Rig", "RigErrors"), "model.rig"),
    "StreamInfo": "codec.inspect",
    **dict.fromkeys(("SurfaceDistances", "SurfaceQuality"), "metrics.surface_distance"),
    "Track": "model.tracks",
    "TrackKind": "model.tracks",
}


if not TYPE_CHECKING:  # type checkers would accept any name

    def __getattr__(name: str) -> Any:
        """Import a public name on first use, so that the command line starts fast."""
        if name == "paper":
            from meshreel.runtime.extras import PAPER

            PAPER.load()
            return import_module("meshreel.paper")
        if name not in __all__:
            raise AttributeError(f"module 'meshreel' has no attribute {name!r}")
        module = import_module(f"meshreel.{_MODULES.get(name, 'errors')}")
        return globals().setdefault(name, getattr(module, name))


def _viewer() -> _Viewer:
    from meshreel.app.notebook import show

    return show


_install_viewer(_viewer)


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
