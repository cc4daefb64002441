"""Notes on all meshes of a USD file, one sentence for each kind of thing."""

from collections.abc import Sequence

import numpy as np

from meshreel.formats.notes import LEFT_OUT, GatheredNote, describe_cages, listed
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.usd.holes import Mask
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PRIMITIVES, PrimitiveShape
from meshreel.formats.usd.revolution import N_AROUND


class MeshNotes:
    """Sentences on meshes of a file, told of one mesh after the other.

    Parameters
    ----------
    plain : list of str
        All notes.

    Attributes
    ----------
    sampled : GatheredNote
        Of meshes whose samples are not their frames.
    final : GatheredNote
        Of meshes whose last sample is between two frames.
    normals : NormalNotes
        Of meshes with normals.
    """

    def __init__(self, plain: list[str]) -> None:
        self.plain = plain
        self.sampled = GatheredNote(plain, _sampled)
        self.final = GatheredNote(plain, _final)
        self.normals = NormalNotes(plain)
        self._cages = GatheredNote(plain, describe_cages)
        self._holes = GatheredNote(plain, _holes)
        self._flat = GatheredNote(plain, _flat)
        self._round = GatheredNote(plain, _round)

    def add(self, shape: MeshShape | PrimitiveShape, solid: Mask | None) -> None:
        """Tell of a mesh, only these faces of which are no holes, if it has any."""
        path = str(shape.prim.GetPath())
        if isinstance(shape, PrimitiveShape):
            note = self._round if PRIMITIVES[shape.kind].is_round else self._flat
            note.add(f"{path} ({shape.kind})")
        if shape.is_subdivided:
            self._cages.add(path)
        if solid is not None:
            self._holes.add(f"{np.count_nonzero(~solid)} of {len(solid)} of {path}")


def _sampled(found: Sequence[str]) -> str:
    return f"samples are not one to a frame; read as USD has it at each frame: {listed(found)}"


def _final(found: Sequence[str]) -> str:
    return f"the last frame shows the final pose, which comes before it: {listed(found)}"


def _holes(found: Sequence[str]) -> str:
    return f"{LEFT_OUT}faces that are holes: {listed(found)}"


def _flat(paths: Sequence[str]) -> str:
    return f"read as {'a mesh' if len(paths) == 1 else 'meshes'}: {listed(paths)}"


def _round(paths: Sequence[str]) -> str:
    kind = "a mesh" if len(paths) == 1 else "meshes"
    return f"read as {kind} of {N_AROUND} faces around, within 1 % of the radius: {listed(paths)}"
