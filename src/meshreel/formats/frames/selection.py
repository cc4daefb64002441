"""Sequences without the attributes that were not asked for."""

from dataclasses import replace
from pathlib import Path

from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.surface_selection import Names, selected


def with_attributes(sequence: FrameSource, names: Names, path: Path) -> FrameSource:
    """The sequence with the attributes and groups of these names only.

    Parameters
    ----------
    sequence : MeshSequence or StoredFrames
    names : str or sequence of str
        As `meshreel.model.surface_selection.selected` takes them.
    path : Path
        Where it was read, for errors.

    Raises
    ------
    InvalidInputError
        If a name is not there; what is there is listed.
    """
    with errors_naming(path):
        surface = selected(sequence.surface, names)
    return with_surface(sequence, surface)


def with_surface(sequence: FrameSource, surface: Surface) -> FrameSource:
    """The sequence with another surface."""
    if surface is sequence.surface:
        return sequence
    if not isinstance(sequence, MeshSequence | StoredFrames):
        raise TypeError(f"a {type(sequence).__name__} was opened, whose surface is its own")
    return replace(sequence, surface=surface)
