"""A part of a sequence as a base mesh and what moves it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, fit_given_morphs, fit_morphs
from meshreel.formats.gltf.normal_targets import (
    POSITIONS,
    NormalTargets,
    base_normals,
    fit_normals,
)
from meshreel.formats.gltf.placement import (
    NOWHERE,
    Placement,
    longest_way,
    mean_frame,
    place_frames,
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
        How many morph targets; default: as few as keep the bound.
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
    """

    placement: Placement
    base: npt.NDArray[Any]
    morphs: Morphs | None
    normals: NormalTargets | None

    @property
    def errors(self) -> npt.NDArray[np.floating]:
        """How far the furthest vertex of each frame is off, in model units."""
        return np.zeros(1) if self.morphs is None else self.morphs.errors * self.placement.scale


def fit_part(frames: Vertices, faces: Faces, wanted: Wanted) -> MovingMesh:
    """The base and the targets of a part.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    wanted : Wanted
    """
    base = mean_frame(frames)
    still = 0 if wanted.n_targets else wanted.bound
    if len(frames) == 1 or longest_way(frames, base) <= still:
        rest = base.astype(np.float32)
        normals = base_normals(rest, faces) if wanted.normals else None
        no_targets = np.empty((0, len(rest), 3), np.int8)
        return MovingMesh(
            NOWHERE, rest, None, None if normals is None else NormalTargets(normals, no_targets)
        )
    placed = place_frames(frames, base)
    share = POSITIONS if wanted.normals else 1.0
    bound = share * max(0.0, wanted.bound / placed.placement.scale - MARGIN)
    if wanted.n_targets is None:
        morphs = fit_morphs(placed.moves, bound)
    else:
        morphs = fit_given_morphs(placed.moves, wanted.n_targets, bound)
    if not wanted.normals:
        return MovingMesh(placed.placement, placed.base, morphs, None)
    return MovingMesh(
        placed.placement, placed.base, *fit_normals(frames, faces, placed.moves, morphs)
    )
