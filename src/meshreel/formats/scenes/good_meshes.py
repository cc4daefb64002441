"""Which meshes of a file can be read, of all that it holds."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.model.sequence import validate_finite
from meshreel.runtime.progress import Count

MAX_NAMED = 8


def good_meshes(
    meshes: Sequence[SceneMesh], options: ReadOptions, *, may_change: bool
) -> list[SceneMesh]:
    """The meshes that can be read in every frame, which are all read once now.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    options : ReadOptions
        Its notes gain a sentence that names the others, and what is wrong with each.
    may_change : bool
        Whether a mesh is good whose faces change.

    Raises
    ------
    FormatError
        If no mesh can be read.
    """
    good, faults = [], []
    for number, mesh in enumerate(meshes):
        # What it carries is read here, and not again: a note on it is said once.
        kept = replace(mesh, surface=cache(mesh.surface))
        if fault := _fault(kept, may_change=may_change):
            faults.append(f"{mesh.name} ({fault})")
        else:
            good.append(kept)
        options.progress("checking", Count(number + 1, len(meshes), "meshes"))
    if not good:
        raise FormatError(f"holds no mesh that can be read: {listed(faults, MAX_NAMED)}")
    if faults:
        note_left_out(options.notes, f"meshes that cannot be read: {listed(faults, MAX_NAMED)}")
    return good


def _fault(mesh: SceneMesh, *, may_change: bool) -> str:
    """The fault of a mesh, in words; empty if it has none."""
    try:
        first = mesh.frame(0)
        sizes = first.counts.astype(np.int32)
        surface = replace(mesh.surface(0), face_sizes=sizes)
        surface.validated(len(first.vertices), int((first.counts - 2).sum()))
        for index in range(len(mesh.times_s)):
            frame = mesh.frame(index) if index else first
            if not may_change and (difference := frame.difference(first)):
                return f"frame {index} has {difference} in frame 0"
            validate_finite(frame.vertices[np.newaxis], first_frame=index)
    except MeshReelError as error:
        return str(error)
    return ""
