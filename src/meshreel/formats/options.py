"""What a caller may ask of those who read and write files."""

from dataclasses import dataclass, field
from pathlib import Path

from meshreel.progress import Progress, silent


@dataclass(frozen=True)
class ReadOptions:
    """How a file is read.

    Parameters
    ----------
    fps : float, optional
        Frames per second in place of what the file says; of files that describe motion between
        frames (glTF, skinned USD), how often it is sampled.
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
    """

    fps: float | None = None
    object: str | None = None
    merge: bool = False
    topology: Path | None = None
    dataset: str | None = None
    max_loaded_bytes: int | None = None
    progress: Progress = silent
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Origin:
    """What is known of the animation that frames were decoded from.

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


@dataclass(frozen=True)
class WriteOptions:
    """How a file is written; glTF has all choices, and ``.reel`` has `max_error`.

    Parameters
    ----------
    targets : int, optional
        How many morph targets the animation is made of.
    max_error : float or str, optional
        How far no vertex may be off: percent of the diagonal of the bounding box of all frames, or
        text that `meshreel.codec.error_bounds.bound_of` reads, such as "0.5u" for model units.
        From the original, if the origin says how far off the frames are already.
    normals : bool, default False
        Whether morph targets move normals too.
    origin : Origin, optional
        Of frames that were decoded; default: they are the original.
    """

    targets: int | None = None
    max_error: float | str | None = None
    normals: bool = False
    origin: Origin | None = None
