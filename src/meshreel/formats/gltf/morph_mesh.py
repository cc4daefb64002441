"""A part of a sequence as base mesh and morph targets."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, fit_fixed_morphs, fit_morphs
from meshreel.formats.gltf.normal_targets import (
    LENGTH_ERROR,
    POSITION_SHARES,
    NormalChoice,
    NormalTargets,
    fit_normals,
    static_normals,
    wants_normals,
)
from meshreel.formats.gltf.quantized import (
    Placement,
    max_displacements,
    mean_frame,
    place_frames,
    place_static,
)
from meshreel.model.sequence import Faces, Vertices

MARGIN = 4e-7
"""Error that float32 arithmetic may add, relative to the scale of the placement."""


@dataclass(frozen=True)
class MorphOptions:
    """Number of morph targets, error bound, and normals.

    Parameters
    ----------
    n_targets : int, optional
        Number of morph targets, at least 2 with all normals; default: as few as meet the bound.
    bound : float
        Largest error of a vertex, in model units; 0 for as small as possible.
    normals : NormalChoice
    """

    n_targets: int | None
    bound: float
    normals: NormalChoice

    @property
    def length_error(self) -> float:
        """Root mean square error of normals that is acceptable; 0 for as small as possible."""
        return LENGTH_ERROR if self.normals is NormalChoice.SMOOTH else 0.0


@dataclass(frozen=True, eq=False)
class ShadingMesh:
    """A mesh with one normal per vertex, whose vertices are split at hard edges.

    Attributes
    ----------
    vertices : int64 array of shape (R,)
        Original vertex of each vertex.
    faces : int32 array of shape (M, 3)
    has_hard_edges : bool
    """

    vertices: npt.NDArray[np.int64]
    faces: Faces
    has_hard_edges: bool


@dataclass(frozen=True, eq=False)
class MorphMesh:
    """A part as base mesh and morph targets; without targets, it is static.

    Attributes
    ----------
    placement : Placement
    base : int16 or float32 array of shape (V, 3)
        Integers if there are targets.
    morphs : Morphs, optional
    normals : NormalTargets, optional
    errors : float array of shape (T,)
        Largest error of a vertex in each frame, in model units.
    """

    placement: Placement
    base: npt.NDArray[Any]
    morphs: Morphs | None
    normals: NormalTargets | None
    errors: npt.NDArray[np.floating]


def fit_part(
    frames: Vertices, faces: Faces, options: MorphOptions, shading: ShadingMesh | None = None
) -> MorphMesh:
    """Return a part fitted by a base mesh and morph targets.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    options : MorphOptions
    shading : ShadingMesh, optional
        For a mesh with hard edges, which always gets normals. Default: one normal per vertex.
    """
    if shading is None:
        shading = ShadingMesh(np.arange(frames.shape[1]), faces, has_hard_edges=False)
    base = mean_frame(frames)
    distances = max_displacements(frames, base)
    has_normals = shading.has_hard_edges or wants_normals(options.normals, frames[0], faces)
    if distances.max() <= (0 if options.n_targets else options.bound) or len(frames) == 1:
        placement, rest = place_static(base if len(frames) > 1 else frames[0])
        normals = static_normals(rest[shading.vertices], shading.faces) if has_normals else None
        return MorphMesh(placement, rest, None, normals, distances)
    placed = place_frames(frames, base)
    bound = max(0.0, options.bound / placed.placement.scale - MARGIN)
    if has_normals and options.n_targets != 1:  # normals need an additional target
        morphs, normals = _fit_both(frames, shading, placed.displacements, bound, options)
    else:
        morphs, normals = _fit(placed.displacements, bound, options.n_targets), None
    errors = morphs.errors * placed.placement.scale
    return MorphMesh(placed.placement, placed.base, morphs, normals, errors)


def _fit_both(
    frames: Vertices,
    shading: ShadingMesh,
    displacements: npt.NDArray[np.float32],
    bound: float,
    options: MorphOptions,
) -> tuple[Morphs, NormalTargets]:
    """Return morphs of positions and normals, with the larger share of the bound that works."""
    n_targets = None if options.n_targets is None else options.n_targets - 1
    split = frames[:, shading.vertices]
    for share in POSITION_SHARES:
        morphs = _fit(displacements, share * bound, n_targets)
        fitted = fit_normals(split, shading.faces, displacements, morphs, options.length_error)
        if fitted[0].error <= bound or n_targets is not None:
            break
    return fitted


def _fit(displacements: npt.NDArray[np.float32], bound: float, n_targets: int | None) -> Morphs:
    if n_targets is None:
        return fit_morphs(displacements, bound)
    return fit_fixed_morphs(displacements, n_targets, bound)
