"""Options of reading and writing files."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

from meshreel.model.sequence import FrameSource
from meshreel.model.surface_selection import ALL, Names
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.codec.reel_file import ReelFile


@dataclass(frozen=True)
class ReadOptions:
    """How a file is read.

    Parameters
    ----------
    fps : float, optional
        Frames per second in place of what the file says; of files that describe motion between
        frames (glTF, USD with keyed transforms or skins), how often it is sampled.
    object : str, optional
        Path, or last part of the path, of the one mesh to take of a file that holds several.
    merge : bool, default False
        Whether all meshes of a file are taken, as one mesh of several parts.
    topology : Path, optional
        A mesh file with the faces of a point cache, which has none.
    dataset : str, optional
        Which dataset holds the positions, in a file of named datasets.
    max_loaded_bytes : int, optional
        Positions that take no more are loaded, others stay in the file if they can. Default: all
        are loaded.
    progress : Progress, default silent
        Told the share of frames read.
    notes : list of str
        Gains one sentence for each thing that was changed while reading, to be shown to a user.
    attributes : str or sequence of str, default "all"
        The attributes and groups to take: "all", "none", or names.
    skip_bad : bool, default False
        Whether meshes of a file that cannot be read are left out, and the others taken.
    allow_outside : bool, default False
        Whether files are read that a file names outside of its folder.
    memory : float or str, optional
        Of a ``.reel``: the most that decoding may take at once, as in `meshreel.decode`.
    animation : str or int, optional
        Name of the animation to take of a file that holds several, or its number from 0. Default:
        the first that moves a mesh.
    """

    fps: float | None = None
    object: str | None = None
    merge: bool = False
    topology: Path | None = None
    dataset: str | None = None
    max_loaded_bytes: int | None = None
    progress: Progress = silent
    notes: list[str] = field(default_factory=list)
    attributes: Names = ALL
    skip_bad: bool = False
    allow_outside: bool = False
    animation: str | int | None = None
    memory: float | str | None = None


@dataclass(frozen=True)
class Origin:
    """The error and the size of the animation that frames were decoded from.

    Parameters
    ----------
    error : float
        No vertex of the frames is farther from where it was, in model units; infinite if that is
        not known.
    diagonal : float
        Of the bounding box of all its frames, in model units.
    """

    error: float
    diagonal: float


def origin_of(sequence: "FrameSource | ReelFile") -> Origin | None:
    """The origin that a stream states for its frames; None for frames that are the original."""
    if not hasattr(sequence, "promised_error"):
        return None
    reel = cast("ReelFile", sequence)
    return Origin(
        math.inf if reel.promised_error is None else reel.promised_error, reel.frame.scale
    )


@dataclass(frozen=True)
class WriteOptions:
    """How a file is written; which choices a format has is said with each.

    Parameters
    ----------
    targets : int, optional
        Of glTF: how many morph targets the animation is made of.
    max_error : float or str, optional
        Of glTF, ``.vat`` and ``.reel``: how far no vertex may be off: percent of the diagonal of
        the bounding box of all frames, or text that `meshreel.codec.error_bounds.bound_of` reads,
        such as "0.5u" for model units.
        From the original, if the origin says how far off the frames are already.
    normals : bool, optional
        Of glTF: whether there are normals, moved by all morph targets. Default: smooth surfaces
        have them, moved by as many targets as bring them near. Of ``.vat``: whether there is a
        texture of them (default); of the layout "pca" as of glTF.
    lossless : bool, default False
        Of ``.reel``: whether positions and tracks come back bit for bit; excludes `max_error`.
    layout : str, optional
        Of ``.vat``: whose shaders play the textures, one of
        `meshreel.formats.vat.layouts.LAYOUT_NAMES`; default "openvat".
    textures : str, optional
        Of ``.vat``: "exr" (default) for half floats, full ones if the error needs them; "png" for 8
        bits, 16 if the error needs them. Not of the layout "pca".
    origin : Origin, optional
        Of frames that were decoded; default: they are the original.
    """

    targets: int | None = None
    max_error: float | str | None = None
    normals: bool | None = None
    lossless: bool = False
    layout: str | None = None
    textures: str | None = None
    origin: Origin | None = None
