"""Notes on all meshes of a USD file, one sentence per topic."""

from collections.abc import Sequence

import numpy as np

from meshreel.formats.notes import LEFT_OUT, GatheredNote, describe_cages, listed
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.usd.mesh_shape import Mask, MeshShape
from meshreel.formats.usd.primitives import N_AROUND, PRIMITIVES, PrimitiveShape


class MeshNotes:
    """Collects notes on the meshes of a file.

    Parameters
    ----------
    plain : list of str
        All notes of the file.

    Attributes
    ----------
    sampled : GatheredNote
        Lists meshes whose samples differ from their frames.
    final : GatheredNote
        Lists meshes whose last sample is between two frames.
    normals : NormalNotes
        Covers meshes with normals.
    """

    def __init__(self, plain: list[str]) -> None:
        self.plain = plain
        self.sampled: GatheredNote = GatheredNote(plain, _describe_sampled)
        self.final: GatheredNote = GatheredNote(plain, _describe_final)
        self.normals: NormalNotes = NormalNotes(plain)
        self._cages = GatheredNote(plain, describe_cages)
        self._holes = GatheredNote(plain, _describe_holes)
        self._flat = GatheredNote(plain, _describe_flat)
        self._round = GatheredNote(plain, _describe_round)

    def add(self, shape: MeshShape | PrimitiveShape, solid: Mask | None) -> None:
        """Note the properties of a mesh; `solid` is a mask of the faces that are not holes."""
        path = str(shape.prim.GetPath())
        if isinstance(shape, PrimitiveShape):
            note = self._round if PRIMITIVES[shape.kind].is_round else self._flat
            note.add(f"{path} ({shape.kind})")
        if shape.is_subdivided:
            self._cages.add(path)
        if solid is not None:
            self._holes.add(f"{np.count_nonzero(~solid)} of {len(solid)} of {path}")


def _describe_sampled(paths: Sequence[str]) -> str:
    return f"frames differ from samples; USD interpolates at each frame: {listed(paths)}"


def _describe_final(paths: Sequence[str]) -> str:
    return f"the last frame shows the final pose, which is earlier: {listed(paths)}"


def _describe_holes(counts: Sequence[str]) -> str:
    return f"{LEFT_OUT}faces that are holes: {listed(counts)}"


def _describe_flat(paths: Sequence[str]) -> str:
    return f"read as {'a mesh' if len(paths) == 1 else 'meshes'}: {listed(paths)}"


def _describe_round(paths: Sequence[str]) -> str:
    kind = "a mesh" if len(paths) == 1 else "meshes"
    return f"read as {kind} with {N_AROUND} faces around, within 1 % of the radius: {listed(paths)}"
