"""Options for reading and writing files."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

from meshreel.model.surface_selection import ALL, Names
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.codec.reel_file import ReelFile
    from meshreel.model.sequence import MeshSequence
    from meshreel.registration.register import Registration

    AnySource = MeshSequence | ReelFile


@dataclass(frozen=True)
class ReadOptions:
    """Options for reading a file: those of `meshreel.load`, and others."""

    fps: float | None = None
    object: str | None = None
    merge: bool = False
    topology: Path | None = None
    dataset: str | None = None
    max_loaded_bytes: int | None = None
    """Positions up to this size are loaded, larger ones stay in the file if possible. Default: all
    are loaded.
    """
    progress: Progress = silent
    notes: list[str] = field(default_factory=list)
    attributes: Names = ALL
    skip_bad: bool = False
    allow_outside: bool = False
    animation: str | int | None = None
    memory: float | str | None = None
    matches_frames: bool = True
    """Whether frames that differ only in the order of vertices and faces become one segment."""
    register: float | str | None = None
    """Tolerance of the registration of frames whose faces change, as in `meshreel.register`."""
    registrations: "list[Registration]" = field(default_factory=list)
    """Receives the registration, which can be compared with decoded frames."""
    displace: str | None = None
    """Track that moves the vertices, as in `meshreel.load`."""
    resample: float | None = None
    """Frames per second to interpolate at, as in `meshreel.load`."""
    keep_deleted: bool = False
    """Whether elements stay in the mesh after they are deleted, as in `meshreel.load`."""
    referenced: set[Path] = field(default_factory=set)
    """Receives the files that read files refer to, as far as they are resolved."""


@dataclass(frozen=True)
class Origin:
    """Error bound and size of the animation that frames were decoded from."""

    error: float
    """Largest distance of a vertex from its original position, in model units; infinite if unknown.
    """
    diagonal: float
    """Diagonal of the bounding box of all frames, in model units."""


def origin_of(sequence: "AnySource") -> Origin | None:
    """Return the origin of frames decoded from a stream; None for original frames."""
    error = diagonal = 0.0
    for segment in sequence.segments:
        if not hasattr(segment, "error_bound"):
            return None
        reel = cast("ReelFile", segment)
        error = max(error, math.inf if reel.error_bound is None else reel.error_bound)
        diagonal = max(diagonal, reel.frame.scale)
    return Origin(error, diagonal)


@dataclass(frozen=True)
class WriteOptions:
    """Options for writing a file; each applies to the listed formats only."""

    targets: int | None = None
    """glTF: number of morph targets of the animation."""
    max_error: float | str | None = None
    """glTF, ``.vat`` and ``.reel``: largest vertex error, in percent of the diagonal of the
    bounding box of all frames, or as text that `meshreel.codec.error_bounds.bound_of` parses, such
    as "0.5u" for model units. It is measured against the original, if the origin gives the error of
    the frames.
    """
    normals: bool | None = None
    """glTF: whether normals are written, animated by all morph targets. Default: smooth surfaces
    have normals, animated by as many targets as their error requires. ``.vat``: whether a texture
    of normals is written (default).
    """
    compression: bool = True
    """glTF: whether the buffer is compressed (`EXT_meshopt_compression`), which reorders vertices
    and triangles. False for programs without the extension.
    """
    meshopt: str | None = None
    """glTF: extension for the compression, "ext" (default), or "khr" for its draft successor, which
    makes files smaller, but few programs support.
    """
    lossless: bool = False
    """``.reel``: whether positions and tracks are stored bit for bit; excludes `max_error`."""
    layout: str | None = None
    """``.vat``: layout of the textures for a shader, one of `meshreel.formats.vat.folder.LAYOUTS`;
    default "openvat".
    """
    textures: str | None = None
    """``.vat``: "exr" (default) for half floats, or full floats if the error requires them; "png"
    for 8 bits, or 16 if the error requires them.
    """
    rig: bool | int | None = None
    """glTF and USD: whether the mesh is moved by bones, at most this many (True: 256), and by
    corrective morph targets where bones do not suffice, within `max_error` (default 1 percent) and
    `kg`. See `meshreel.rig`.
    """
    kg: float | None = None
    """With `rig`: largest KG error, in percent; default 0.5."""
    quality: float | None = None
    """With `rig`, in place of `kg` and `max_error`: errors of positions are at most those of a
    ``.reel`` of this quality, 1 to 100.
    """
    force: bool = False
    """With `rig`: whether a rig that exceeds its error bounds is written."""
    origin: Origin | None = None
    """Origin of decoded frames; None for original frames."""
