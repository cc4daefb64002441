"""A part of a sequence as a base mesh and what moves it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, fit_given_morphs, fit_morphs
from meshreel.formats.gltf.normal_targets import (
    POSITIONS,
    NormalTargets,
    fit_normals,
    still_normals,
)
from meshreel.formats.gltf.placement import (
    Placement,
    mean_frame,
    place_frames,
    place_still,
    ways,
)
from meshreel.sequence import Faces, Vertices

MARGIN = 4e-7
"""What float32 may add to an error, by the scale of the placement."""


@dataclass(frozen=True)
class Wanted:
    """What the animation may cost, and how well it must fit.

    Parameters
    ----------
    n_targets : int, optional
        How many morph targets, at least 2 with normals; default: as few as keep the bound.
    bound : float
        No vertex may be further off; in model units. 0 for as near as may be.
    normals : bool
    """

    n_targets: int | None
    bound: float
    normals: bool


@dataclass(frozen=True, eq=False)
class MovingMesh:
    """A part as a base and its morph targets; without targets, it does not move.

    Attributes
    ----------
    placement : Placement
    base : int16 or float32 array of shape (V, 3)
        Integers where there are targets.
    morphs : Morphs, optional
    normals : NormalTargets, optional
    errors : float array of shape (T,)
        How far the furthest vertex of each frame is off, in model units.
    """

    placement: Placement
    base: npt.NDArray[Any]
    morphs: Morphs | None
    normals: NormalTargets | None
    errors: npt.NDArray[np.floating]


def fit_part(frames: Vertices, faces: Faces, wanted: Wanted) -> MovingMesh:
    """The base and the targets of a part.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    wanted : Wanted
    """
    base = mean_frame(frames)
    distances = ways(frames, base)
    if distances.max() <= (0 if wanted.n_targets else wanted.bound) or len(frames) == 1:
        placement, rest = place_still(base if len(frames) > 1 else frames[0])
        still = still_normals(rest, faces) if wanted.normals else None
        return MovingMesh(placement, rest, None, still, distances)
    placed = place_frames(frames, base)
    morphs = _fit(placed.moves, placed.placement.scale, wanted)
    normals = None
    if wanted.normals:
        morphs, normals = fit_normals(frames, faces, placed.moves, morphs)
    errors = morphs.errors * placed.placement.scale
    return MovingMesh(placed.placement, placed.base, morphs, normals, errors)


def _fit(moves: npt.NDArray[np.float32], scale: float, wanted: Wanted) -> Morphs:
    share = POSITIONS if wanted.normals else 1.0
    bound = share * max(0.0, wanted.bound / scale - MARGIN)
    if wanted.n_targets is None:
        return fit_morphs(moves, bound)
    return fit_given_morphs(moves, wanted.n_targets - wanted.normals, bound)
