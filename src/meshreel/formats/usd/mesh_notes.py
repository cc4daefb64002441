"""What is said of all meshes of a USD file, each thing in one sentence."""

from collections.abc import Sequence

from meshreel.formats.gathered_note import GatheredNote
from meshreel.formats.left_out import LEFT_OUT, listed


class MeshNotes:
    """Sentences on meshes of a file, told of one mesh after the other.

    Parameters
    ----------
    plain : list of str
        All notes.
    """

    def __init__(self, plain: list[str]) -> None:
        self.plain = plain
        self.cages = GatheredNote(plain, _cages)
        self.holes = GatheredNote(plain, _holes)


def _cages(paths: Sequence[str]) -> str:
    if len(paths) == 1:
        return f"{paths[0]} is a subdivision surface; its cage is read"
    return f"{listed(paths)} are subdivision surfaces; their cages are read"


def _holes(found: Sequence[str]) -> str:
    return f"{LEFT_OUT}faces that are holes: {listed(found)}"
