"""Which file endings there are, and who reads and writes them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from meshreel.errors import FormatError
from meshreel.formats.frame_stream import FrameStream
from meshreel.formats.npz import read_npz, write_npz
from meshreel.formats.npz_frames import open_npz
from meshreel.formats.obj import obj_encoder, parse_obj
from meshreel.formats.off import off_encoder, parse_off
from meshreel.formats.ply import parse_ply, ply_encoder
from meshreel.formats.polygons import PolygonMesh
from meshreel.formats.reel import read_reel, write_reel
from meshreel.formats.stl import parse_stl, stl_encoder
from meshreel.sequence import Faces, FrameSource, MeshSequence, Vertices


@dataclass(frozen=True)
class FrameFormat:
    """A format whose files hold one static mesh, so one frame.

    Parameters
    ----------
    ending : str
        Lower case, with the dot.
    parse : function of the bytes of a file
        Gives its `PolygonMesh`; its errors name the line but not the file.
    encoder : function of the faces
        Gives a function from the positions of a frame to the bytes of its file.
    is_decimal : bool, default False
        Whether positions are decimal text without a declared type.
    has_corners_only : bool, default False
        Whether every triangle has three vertices of its own, which must be welded.
    """

    ending: str
    parse: Callable[[bytes], PolygonMesh]
    encoder: Callable[[Faces], Callable[[Vertices], bytes]]
    is_decimal: bool = False
    has_corners_only: bool = False


@dataclass(frozen=True)
class SequenceFormat:
    """A format whose files hold a whole sequence.

    Parameters
    ----------
    ending : str
        Lower case, with the dot.
    read : function of a path and ``fps=``
        Gives the sequence; its errors name the file.
    write : function of a path and a `FrameStream`
        Writes the file.
    open : function of a path, ``fps=``, ``max_loaded_bytes=`` and ``progress=``, optional
        Gives the sequence with its positions left in the file, where they can be.
    """

    ending: str
    read: Callable[..., MeshSequence]
    write: Callable[[Path, FrameStream], None]
    open: Callable[..., FrameSource] | None = None


FRAME_FORMATS = {
    found.ending: found
    for found in (
        FrameFormat(".obj", parse_obj, obj_encoder, is_decimal=True),
        FrameFormat(".ply", parse_ply, ply_encoder),
        FrameFormat(".off", parse_off, off_encoder, is_decimal=True),
        FrameFormat(".stl", parse_stl, stl_encoder, is_decimal=True, has_corners_only=True),
    )
}
SEQUENCE_FORMATS = {
    found.ending: found
    for found in (
        SequenceFormat(".npz", read_npz, write_npz, open_npz),
        SequenceFormat(".reel", read_reel, write_reel),
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
