"""The kinds of formats: one frame per file, a whole sequence per file, and folders of files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Literal

from meshreel.arrays import Values
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.options import Reading, WriteOptions
from meshreel.formats.scenes.scene_mesh import ReadMeshes
from meshreel.model.sequence import FrameSource, Vertices
from meshreel.model.surface import SURFACE_DOMAINS, Domain
from meshreel.runtime.extras import Extra


@dataclass(frozen=True)
class AnimationInfo:
    """One of the animations of a file."""

    name: str
    """Unique in the file."""
    start_s: float = 0.0
    duration_s: float = 0.0
    """Time of the first key, and seconds to the last key; 0 if it has a problem."""
    moves_mesh: bool = False
    """Whether it animates a mesh that is read."""
    problem: str | None = None
    """Why it cannot be read; None if it can."""


ReadOption = Literal[
    "object",
    "merge",
    "topology",
    "dataset",
    "skip_bad",
    "allow_outside",
    "animation",
    "keep_deleted",
]
WriteOption = Literal[
    "max_error",
    "normals",
    "meshopt",
    "lossless",
    "layout",
    "textures",
    "rig",
    "kg",
    "quality",
    "images",
    "max_image",
]

NO_TRACKS: frozenset[Domain] = frozenset()
EVERY_DOMAIN = frozenset(Domain)
VERTEX_FACE_CORNER = frozenset(SURFACE_DOMAINS)
VERTEX_FACE = frozenset({Domain.VERTEX, Domain.FACE})
VERTEX_FACE_CELL = VERTEX_FACE | {Domain.CELL}
"""Track domains that a format supports; with those of cells, it stores cells too."""

Encode = Callable[[Vertices, Mapping[str, Values]], bytes]
"""Returns the file of a frame with positions of shape (V, 3) and values of tracks by name."""


@dataclass(frozen=True)
class Format:
    """Properties of formats of all kinds."""

    extension: str
    """File extension in lower case, with the dot."""
    title: str
    """Name of the format."""
    _: KW_ONLY
    extra: Extra | None = None
    """Library required for writing and, unless `reads_without_extra`, for reading."""
    reads_without_extra: bool = False
    read_options: frozenset[ReadOption] = frozenset()
    """Read options that have an effect on the format, besides those of formats with `read_meshes`,
    `refers_to_files` and `list_animations`.
    """
    write_options: frozenset[WriteOption] = frozenset()
    """Write options that have an effect on the format."""
    track_domains: frozenset[Domain] = NO_TRACKS
    """Domains of the tracks that written files can contain; others are left out with a note."""
    companion: str = ""
    """Extension of a mesh file with the first frame that is written next to it."""
    has_image_folder: bool = False
    """Whether images are stored in a folder next to the file."""
    data_files: Callable[[Path, int], list[Path]] | None = None
    """Returns further files that the file refers to; `SegmentedStream.data_files` tells the writer
    where to put them.
    """
    other_files: Callable[[Path], list[Path]] = lambda path: []
    """Returns the existing files that continue a file, for formats that split a sequence."""

    @property
    def options(self) -> frozenset[str]:
        """All read and write options that have an effect."""
        return self.read_options | self.write_options


@dataclass(frozen=True)
class FrameFormat(Format):
    """A format with one static mesh, so one frame, per file."""

    read: Callable[[bytes], Frame]
    """Returns the `Frame`; its errors name the line but not the file."""
    encoder: Callable[[FrameStream], Encode] | None
    """Returns a function that encodes its frames, and adds notes on what the files cannot store;
    None if the format is read-only.
    """
    is_decimal: bool = False
    """Whether positions are decimal text without a declared number type."""
    has_unshared_vertices: bool = False
    """Whether triangles do not share vertices and must be welded."""

    @property
    def holds_segments(self) -> bool:
        """Whether the faces of written frames may change."""
        return self.encoder is not None


@dataclass(frozen=True)
class SequenceFormat(Format):
    """A format with a whole sequence per file."""

    open: Callable[[Path, Reading], FrameSource] | None = None
    """Opens the sequence; its errors name the file. Positions stay in the file if the options
    request it and the format allows it. Formats with `read_meshes` need none.
    """
    write: Callable[[Path, SegmentedStream, WriteOptions], None] | None = None
    """Writes the file; None if the format is read-only."""
    read_meshes: ReadMeshes | None = None
    """Returns the meshes of a file, for formats with several meshes or changing faces."""
    holds_materials: bool = False
    """Whether files store materials and images, not only face labels."""
    list_animations: Callable[[Path, Reading], Sequence[AnimationInfo]] | None = None
    """Returns the animations of a file, for formats with several; its errors do not name the file.
    """
    holds_segments: bool = False
    """Whether the faces of written frames may change; else `write` gets a single segment."""
    refers_to_files: bool = False
    """Whether its files refer to other files."""

    @property
    def options(self) -> frozenset[str]:
        """All read and write options that have an effect."""
        mesh_options = {"object", "merge", "skip_bad"} if self.read_meshes else set()
        file_options = {"allow_outside"} if self.refers_to_files else set()
        animation_options = {"animation"} if self.list_animations else set()
        image_options = {"images", "max_image"} if self.holds_materials else set()
        return super().options | mesh_options | file_options | animation_options | image_options


@dataclass(frozen=True)
class FolderFormat(Format):
    """A write-only format whose output is a folder of several files."""

    files: Callable[[Path, WriteOptions], list[Path]]
    """Returns the files that will be written; raises an error for invalid options."""
    write: Callable[[Path, str, FrameStream, WriteOptions], None]
    """Writes these files, with the same names, into the folder."""

    holds_segments = False
