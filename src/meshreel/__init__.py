"""meshreel compresses animated triangle meshes of fixed connectivity.

import meshreel

sequence = meshreel.load("samba.npz")
data = meshreel.encode(sequence)
decoded = meshreel.decode(data)
quality = meshreel.compare(sequence, decoded)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshreel.codec.decoder import decode
    from meshreel.codec.encoder import encode
    from meshreel.codec.inspect import StreamInfo, info
    from meshreel.codec.reel_file import ReelFile
    from meshreel.codec.streaming import Encoder
    from meshreel.errors import (
        CorruptStreamError,
        FormatError,
        InvalidInputError,
        MeshReelError,
        SolverError,
        TruncatedStreamError,
        UnsupportedVersionError,
        WorkerDiedError,
    )
    from meshreel.flag import simulate_flag
    from meshreel.formats.load import load
    from meshreel.formats.reel import open
    from meshreel.formats.save import save
    from meshreel.materials import AlphaMode, Filter, Image, Material, Texture, Wrap
    from meshreel.metrics.compare import Quality, compare
    from meshreel.sequence import MeshSequence
    from meshreel.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface

__version__ = "0.1.0"

__all__ = [
    "AlphaMode",
    "Attribute",
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
    "MeshReelError",
    "MeshSequence",
    "Part",
    "Quality",
    "ReelFile",
    "SolverError",
    "StreamInfo",
    "Surface",
    "Texture",
    "TruncatedStreamError",
    "UnsupportedVersionError",
    "WorkerDiedError",
    "Wrap",
    "compare",
    "decode",
    "encode",
    "info",
    "load",
    "open",
    "save",
    "simulate_flag",
]

_HOMES = {
    **dict.fromkeys(("Attribute", "Domain", "FaceGroups", "Kind", "Part", "Surface"), "surface"),
    **dict.fromkeys(("AlphaMode", "Filter", "Image", "Material", "Texture", "Wrap"), "materials"),
    "compare": "metrics.compare",
    "decode": "codec.decoder",
    "Encoder": "codec.streaming",
    "encode": "codec.encoder",
    "info": "codec.inspect",
    "load": "formats.load",
    "MeshSequence": "sequence",
    "open": "formats.reel",
    "Quality": "metrics.compare",
    "ReelFile": "codec.reel_file",
    "save": "formats.save",
    "simulate_flag": "flag",
    "StreamInfo": "codec.inspect",
}


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first asked for: the command line starts fast."""
    if name not in __all__:
        raise AttributeError(f"module 'meshreel' has no attribute {name!r}")
    home = import_module(f"meshreel.{_HOMES.get(name, 'errors')}")
    return globals().setdefault(name, getattr(home, name))
