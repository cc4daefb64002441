"""The kinds of formats: files that hold a frame each or a whole sequence, and folders of files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from meshreel.formats.animations import AnimationInfo
from meshreel.formats.extras import Extra
from meshreel.formats.frames.field_tracks import Fields
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import ReadOptions, WriteOptions
from meshreel.formats.scenes.scene_mesh import ReadMeshes
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import FrameSource, Vertices
from meshreel.model.surface import Domain, Surface

ReadOption = Literal[
    "object", "merge", "topology", "dataset", "skip_bad", "allow_outside", "animation"
]
WriteOption = Literal["targets", "max_error", "normals", "lossless", "layout", "textures"]


NO_TRACKS: frozenset[Domain] = frozenset()
ALL_TRACKS = frozenset(Domain)
"""Domains whose tracks a file holds."""


@dataclass(frozen=True)
class Lazy:
    """A function of a module of `meshreel.formats` that is imported when it is first called.

    Parameters
    ----------
    place : str
        Of the function, as in "meshes.obj:parse_obj".
    """

    place: str

    def __call__(self, *args: Any) -> Any:
        """The result of the function for these arguments."""
        return self.function(*args)

    @property
    def function(self) -> Callable[..., Any]:
        """The function itself, imported now."""
        module, _, name = self.place.partition(":")
        found: Callable[..., Any] = getattr(import_module(f"meshreel.formats.{module}"), name)
        return found


OPEN_SCENE = Lazy("scenes.scene_source:open_scene")


@dataclass(frozen=True)
class FrameFormat:
    """A format whose files hold one static mesh, so one frame.

    Parameters
    ----------
    ending : str
        Lower case, with the dot.
    title : str
        What people call it.
    parse : function of the bytes of a file
        Gives its `PolygonMesh`; its errors name the line but not the file.
    encoder : function of the faces, the surface and a list of notes, or None
        Gives a function from the positions of a frame to the bytes of its file; None if files of
        this format are only read. The notes gain a sentence on what such a file does not hold.
        Where it holds tracks, it takes them too, by their names, and gives a function from the
        positions and the values of each track in the frame, by its name, of shape (N, C).
    positions_reader : function of the bytes of a file and the mesh that it holds, optional
        Gives a function from the bytes of another file to its positions, for one that `parse`
        would give the same faces; else, or if it does not look so at once, None.
    parse_surface : function of the bytes of a file and a list of notes, optional
        Gives attributes, groups and parts of a file that `parse` reads, without face sizes. The
        notes gain a sentence on what is left out.
    parse_fields : function of the bytes of a file, optional
        Gives all that the file has at vertices, faces and corners. What changes from file to file,
        or is said to be one, is a track.
    fields_checker : function of the bytes of a file, optional
        Gives a function from the bytes of another file to whether it certainly has the same fields,
        known without reading them.
    is_decimal : bool, default False
        Whether positions are decimal text without a declared type.
    has_unshared_vertices : bool, default False
        Whether every triangle has three vertices of its own, which must be welded.
    holds_tracks : set of Domain
        Of which tracks files that are written hold some; others are left out, with a note.
    """

    ending: str
    title: str
    parse: Callable[[bytes], PolygonMesh]
    encoder: Callable[..., Callable[..., bytes]] | None
    positions_reader: Callable[[bytes, PolygonMesh], Callable[[bytes], Vertices | None]] | None = (
        None
    )
    parse_surface: Callable[[bytes, list[str]], Surface] | None = None
    parse_fields: Callable[[bytes], Fields] | None = None
    fields_checker: Callable[[bytes], Callable[[bytes], bool]] | None = None
    is_decimal: bool = False
    has_unshared_vertices: bool = False
    holds_tracks: frozenset[Domain] = NO_TRACKS


@dataclass(frozen=True)
class SequenceFormat:
    """A format whose files hold a whole sequence.

    Parameters
    ----------
    ending : str
        Lower case, with the dot.
    title : str
        What people call it.
    open : function of a path and `ReadOptions`
        Gives the sequence; its errors name the file. Positions stay in the file where the options
        ask for that and the format allows it.
    write : function of a path, a `FrameStream` and `WriteOptions`, or None
        Writes the file; None if files of this format are only read.
    extra : Extra, optional
        The library that reading and writing need.
    reads : set of ReadOption
        Options of reading that have an effect on such a file.
    writes : set of WriteOption
        Options of writing that have an effect on such a file.
    companion : str, default ""
        Ending of a mesh file with the first frame that is written beside it.
    read_meshes : ReadMeshes, optional
        Gives the meshes of a file, where it may hold several, or one whose faces change.
    holds_materials : bool, default False
        Whether a file holds materials and their images, not only labels of faces.
    has_image_folder : bool, default False
        Whether images are files in a folder beside, for the file cannot hold them itself.
    holds_tracks : set of Domain
        Of which tracks a file that is written holds; others are left out, with a note.
    data_files : function of a path and a number of frames, optional
        Gives the files that are written beside, for the file names them; the `FrameStream` says
        where `write` puts them.
    list_animations : function of a path and `ReadOptions`, optional
        Gives the animations of a file, where it may hold several; its errors do not name the file.
    """

    ending: str
    title: str
    open: Callable[[Path, ReadOptions], FrameSource]
    write: Callable[[Path, FrameStream, WriteOptions], None] | None
    extra: Extra | None = None
    reads: frozenset[ReadOption] = frozenset()
    writes: frozenset[WriteOption] = frozenset()
    companion: str = ""
    read_meshes: ReadMeshes | None = None
    holds_materials: bool = False
    has_image_folder: bool = False
    holds_tracks: frozenset[Domain] = NO_TRACKS
    data_files: Callable[[Path, int], list[Path]] | None = None
    list_animations: Callable[[Path, ReadOptions], Sequence[AnimationInfo]] | None = None


@dataclass(frozen=True)
class FolderFormat:
    """A format whose sequences are folders of files of several kinds; they are written only.

    Parameters
    ----------
    ending : str
        Of the folder, in lower case, with the dot.
    title : str
        What people call it.
    files : function of the path of the folder and `WriteOptions`
        Gives the files that will be written. It refuses options that choose nothing there is.
    write : function of a folder, the stem of names in it, a `FrameStream` and `WriteOptions`
        Writes these files, under the same names, into that folder.
    extra : Extra
        The library that writing needs.
    writes : set of WriteOption
        Options of writing that have an effect on such a folder.
    """

    ending: str
    title: str
    files: Callable[[Path, WriteOptions], list[Path]]
    write: Callable[[Path, str, FrameStream, WriteOptions], None]
    extra: Extra
    writes: frozenset[WriteOption] = frozenset()


def scene_format(
    ending: str,
    title: str,
    read_meshes: ReadMeshes,
    write: Callable[[Path, FrameStream, WriteOptions], None] | None,
    extra: Extra | None = None,
    *,
    names_files: bool = False,
    writes: frozenset[WriteOption] = frozenset(),
    holds_materials: bool = False,
    has_image_folder: bool = False,
    holds_tracks: frozenset[Domain] = NO_TRACKS,
    data_files: Callable[[Path, int], list[Path]] | None = None,
    list_animations: Callable[[Path, ReadOptions], Sequence[AnimationInfo]] | None = None,
) -> SequenceFormat:
    """A format whose files hold one or several meshes, the faces of which may change.

    Its files may name others, or hold all by themselves; they may hold several animations.
    """
    reads: set[ReadOption] = {"object", "merge", "skip_bad"}
    reads.update({"allow_outside"} if names_files else set())
    reads.update({"animation"} if list_animations else set())
    return SequenceFormat(
        ending, title, partial(OPEN_SCENE, read_meshes), write, extra,
        reads=frozenset(reads), writes=writes, read_meshes=read_meshes,
        holds_materials=holds_materials, has_image_folder=has_image_folder,
        holds_tracks=holds_tracks, data_files=data_files, list_animations=list_animations,
    )  # fmt: skip
