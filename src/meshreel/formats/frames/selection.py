"""Selection of the attributes of a sequence."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.surface_selection import ALL, Names, select


def select_attributes(sequence: FrameSource, names: Names, path: Path) -> FrameSource:
    """Return the sequence with only the named attributes and groups.

    Parameters
    ----------
    names : str or sequence of str
        As in `meshreel.model.surface_selection.select`.
    path : Path
        File of the sequence, for errors.

    Raises
    ------
    InvalidInputError
        If a name does not exist; the message lists the available names.
    """
    if names == ALL:
        return sequence
    with errors_naming(path):
        surface = select(sequence.surface, names)
    if isinstance(sequence, StoredFrames) and not sequence.keeps_mesh:
        return sequence.map_surface(partial(select, names=names))
    return with_surface(sequence, surface)


def with_surface(sequence: FrameSource, surface: Surface) -> FrameSource:
    """Return the sequence with another surface."""
    if surface is sequence.surface:
        return sequence
    return cast("FrameSource", cast("Any", sequence).replace(surface=surface))


def with_surfaces(sequence: MeshSequence, surfaces: Sequence[Surface]) -> MeshSequence:
    """Return the sequence with other surfaces, one for each segment."""
    pairs = zip(sequence.segments, surfaces, strict=True)
    segments = [with_surface(segment, surface) for segment, surface in pairs]
    return MeshSequence.of_segments(segments, sequence.name, sequence.timing)
