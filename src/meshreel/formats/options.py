"""Options for reading and writing files, each declared once, as a field.

`meshreel.load`, `meshreel.save` and the command line derive from the fields.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from meshreel.codec.image_options import IMAGES_OPTION, MAX_IMAGE_OPTION
from meshreel.codec.option import Option, Range
from meshreel.codec.targets import ABOVE_ZERO, DIAGONAL_OF_ALL, QUALITIES
from meshreel.model.rig_bounds import DEFAULT_KG_PERCENT, DEFAULT_LARGEST_PERCENT, MAX_BONES
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.codec.reel_file import ReelFile
    from meshreel.model.notes import Notes
    from meshreel.model.sequence import MeshSequence

    AnySource = MeshSequence | ReelFile

MAX_FPS = 1e6
"""A larger rate on the command line is a mistake; files may have any."""

READING = "Input"
GLTF = "glTF output"
GLTF_AND_TEXTURES = "glTF and .vat output"
BOUNDS = "Error bounds of glTF, .vat and rigs"
RIGS = "Rigs (glTF and USD output)"
TEXTURES = "Vertex animation textures (.vat output)"
"""Groups of options."""


@dataclass(frozen=True, kw_only=True)
class LoadOptions:
    """Options of `meshreel.load` other than the source."""

    fps: Annotated[
        float | None,
        Option(
            "Frames per second, as in 25 or 30000/1001. Default: that of the input.",
            range=Range(0.0, MAX_FPS),
            group=READING,
            more="Frame files have none, which is 0. For a glTF file, or a USD file with keyed "
            "transforms or skins, the sampling rate of its motion.",
        ),
    ] = None
    object: Annotated[
        str | None,
        Option(
            "The mesh to read from a file with several (without this option, the error lists "
            "them).",
            metavar="PATH",
            group=READING,
            more="Its path, or the last part of it.",
        ),
    ] = None
    merge: Annotated[
        bool,
        Option(
            "Read all meshes of a file as one; they are separated again on output.",
            group=READING,
            more="They are the parts of the surface.",
        ),
    ] = False
    topology: Annotated[
        str | os.PathLike[str] | None,
        Option(
            "Mesh file with the faces of a point cache (.pc2, .mdd). Default: the mesh file of the "
            "same name in its folder.",
            metavar="MESH",
            group=READING,
        ),
    ] = None
    dataset: Annotated[
        str | None,
        Option(
            "Dataset with the positions (.h5, .npz). Default: vertices.",
            metavar="NAME",
            group=READING,
        ),
    ] = None
    attributes: Annotated[
        str | Sequence[str],
        Option(
            "Attributes and groups to read, by name or kind: uv, color, material, ... Polygons and "
            "parts are always read.",
            metavar="all|none|NAME,...",
            group=READING,
            more='A list, or text such as "uv,color"; a kind selects all of that kind.',
        ),
    ] = "all"
    skip_bad: Annotated[
        bool,
        Option(
            "Skip meshes of a file that cannot be read.",
            group=READING,
            more="Also steps of a ``.pvd`` without faces; a note lists them.",
        ),
    ] = False
    allow_outside: Annotated[
        bool,
        Option(
            "Read referenced files outside the folder of the input: USD layers, glTF buffers, "
            "files of a .pvd or .xdmf.",
            group=READING,
        ),
    ] = False
    animation: Annotated[
        str | int | None,
        Option(
            "Animation to read from a glTF file with several: its name or its number from 0 "
            "(`meshreel info` lists them). Default: the first that moves a mesh.",
            metavar="NAME",
            group=READING,
            more="A note lists the others.",
        ),
    ] = None
    displace: Annotated[
        str | None,
        Option(
            "Move the vertices by a result of three numbers per vertex, such as displacement of a "
            "simulation; a factor enlarges it. The result is kept; a negative factor moves back.",
            metavar="NAME[:FACTOR]",
            group=READING,
            more='``"name:10"`` adds ten times its values.',
        ),
    ] = None
    keep_deleted: Annotated[
        bool,
        Option(
            "Keep elements that a simulation deletes in the mesh, with a track alive, 1 while they "
            "exist. Default: the mesh changes when elements are deleted.",
            group=READING,
        ),
    ] = False
    memory: Annotated[
        float | str | None,
        Option(
            "Memory limit for decoding a .reel (its mesh, a block, or the frames needed at once), "
            "such as 500MB or 20GiB; a larger file is rejected before decoding.",
            default_text="2GiB",
            metavar="SIZE",
            group=READING,
        ),
    ] = None
    progress: Progress = silent
    notes: list[str] | None = None


def _no_notes() -> "Notes":
    from meshreel.model.notes import Notes  # imports NumPy

    return Notes()


@dataclass(frozen=True, kw_only=True)
class Reading(LoadOptions):
    """One reading of an input: its options, and what it reports to the caller."""

    topology: Path | None = None
    max_loaded_bytes: int | None = None
    """Positions up to this size are loaded, larger ones stay in the file if possible. Default: all
    are loaded.
    """
    matches_frames: bool = True
    """Whether frames that differ only in the order of vertices and faces become one segment."""
    finds_hard_edges: bool = True
    """Whether normals of frame files become hard edges, which takes half of the time to open them.
    """
    notes: "Notes" = field(default_factory=_no_notes)  # type: ignore[assignment]  # a Note is a str
    """Receives what reading changes, leaves out or does not know."""
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
    from meshreel.model.tracks import error_bound_of  # imports NumPy

    bound = error_bound_of(*sequence.segments)
    error = math.inf if bound is None else bound
    if hasattr(sequence.segments[0], "frame"):  # segments of a `ReelFile`
        segments = cast("Sequence[ReelFile]", sequence.segments)
        return Origin(error, max(segment.frame.scale for segment in segments))
    if bound == 0.0:
        return None
    extent = cast("MeshSequence", sequence).extent
    size = math.dist(extent.low, extent.high)
    # Each corner of the box may be off by the error along each axis.
    return Origin(error, size if bound is None else max(size - 2 * math.sqrt(3) * error, 0.0))


@dataclass(frozen=True)
class WriteOptions:
    """Options for writing a file; each applies to the listed formats only."""

    normals: Annotated[
        bool | None,
        Option(
            "glTF: write normals of all meshes, changed by all targets; or none, so that viewers "
            "shade faces flat. Default: smooth meshes have normals, changed by enough targets for "
            "a mean error of about 3.5 degrees. .vat: write the normals of every frame (default) "
            "or none.",
            flag="--normals/--no-normals",
            group=GLTF_AND_TEXTURES,
        ),
    ] = None
    meshopt: Annotated[
        bool,
        Option(
            "Compress the file with EXT_meshopt_compression, for viewers with that decoder; "
            "reorders vertices and triangles. Default: no extensions, so that every program opens "
            "the file.",
            group=GLTF,
            more="For glTF.",
        ),
    ] = False
    rig: Annotated[
        bool | int | None,
        Option(
            "Move the mesh by at most this many bones, and by corrective morph targets where bones "
            f"do not suffice, so that {{max_error}} (default {DEFAULT_LARGEST_PERCENT:g} %) and "
            f"{{kg}} hold. Without a number: {MAX_BONES}; 0: only morph targets. Default: glTF "
            "with {max_error} gets whichever is smaller.",
            range=Range(0, MAX_BONES, is_whole=True),
            implied=MAX_BONES,
            metavar="[BONES]",
            group=RIGS,
            more="True: as without a number. For glTF and USD; see `meshreel.rig`.",
        ),
    ] = None
    kg: Annotated[
        float | None,
        Option(
            f"Largest KG error of a rig. Default: {DEFAULT_KG_PERCENT:g}.",
            range=ABOVE_ZERO,
            unit="in percent",
            metavar="PERCENT",
            group=RIGS,
            more="Of a ``.reel``: its largest KG error.",
        ),
    ] = None
    quality: Annotated[
        float | None,
        Option(
            "Position errors of a rig at most those of a .reel of this quality, in place of "
            "{max_error} and {kg}. Its normals are worse.",
            range=QUALITIES,
            group=RIGS,
            more="Of a ``.reel``: its visual quality.",
        ),
    ] = None
    layout: Annotated[
        str | None,
        Option(
            "Layout for the shaders that play the textures: openvat or openvat-unity. Default: "
            "openvat.",
            metavar="NAME",
            group=TEXTURES,
            more="For ``.vat``.",
        ),
    ] = None
    textures: Annotated[
        str | None,
        Option(
            "exr: 16-bit floats, or 32-bit if {max_error} needs them; png: 8 or 16 bits. Default: "
            "exr, which engines read directly.",
            metavar="KIND",
            group=TEXTURES,
            more="For ``.vat``.",
        ),
    ] = None
    max_error: Annotated[
        float | str | None,
        Option(
            "Error bound relative to the original if the .reel has an error bound itself; else "
            "bound of the error that morph targets, bones or textures add. 0.1 or 0.1%: percent "
            f"{DIAGONAL_OF_ALL}; 0.5u: model units; 0.5mm: a length, see {{unit}}.",
            metavar="BOUND",
            group=BOUNDS,
            more="Of a ``.reel``: error bound of every vertex in every frame.",
        ),
    ] = None
    images: Annotated[str | None, IMAGES_OPTION] = None
    max_image: Annotated[int | None, MAX_IMAGE_OPTION] = None
    lossless: bool = False
    """``.reel``: whether positions and tracks are stored bit for bit; excludes its other ones."""
    origin: Origin | None = None
    """Origin of decoded frames; None for original frames."""
