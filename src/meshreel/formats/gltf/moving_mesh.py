"""A part of a sequence as a base mesh and what moves it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, fit_given_morphs, fit_morphs
from meshreel.formats.gltf.normal_targets import (
    LENGTH_ERROR,
    POSITIONS,
    NormalChoice,
    NormalTargets,
    are_written,
    fit_normals,
    still_normals,
)
from meshreel.formats.gltf.placement import Placement, mean_frame, place_frames, place_still, ways
from meshreel.model.sequence import Faces, Vertices

MARGIN = 4e-7
"""The error that float32 may add, by the scale of the placement."""


@dataclass(frozen=True)
class Wanted:
    """The choices of a caller: how many morph targets, which error, which normals.

    Parameters
    ----------
    n_targets : int, optional
        How many morph targets, at least 2 with all normals; default: as few as keep the bound.
    bound : float
        No vertex may be further off; in model units. 0 for as near as may be.
    """

    n_targets: int | None
    bound: float
    normals: NormalChoice

    @property
    def length_error(self) -> float:
        """How near to those of the frames normals are to be; 0 for as near as may be."""
        return LENGTH_ERROR if self.normals is NormalChoice.SMOOTH else 0.0


@dataclass(frozen=True, eq=False)
class Shaded:
    """What normals are of: vertices, split where faces share none.

    Attributes
    ----------
    vertices : int64 array of shape (R,)
        The vertex of each row of normals.
    faces : int32 array of shape (M, 3)
        The triangles, in rows.
    """

    vertices: npt.NDArray[np.int64]
    faces: Faces
    has_hard_edges: bool


@dataclass(frozen=True, eq=False)
class MovingMesh:
    """A part as a base and its morph targets; without targets, it does not move.

    Attributes
    ----------
    base : int16 or float32 array of shape (V, 3)
        Integers where there are targets.
    errors : float array of shape (T,)
        How far the furthest vertex of each frame is off, in model units.
    """

    placement: Placement
    base: npt.NDArray[Any]
    morphs: Morphs | None
    normals: NormalTargets | None
    errors: npt.NDArray[np.floating]


def fit_part(
    frames: Vertices, faces: Faces, wanted: Wanted, shaded: Shaded | None = None
) -> MovingMesh:
    """The base and the targets of a part.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    shaded : Shaded, optional
        Of a mesh with hard edges, which gets normals. Default: each vertex has one normal.
    """
    if shaded is None:
        shaded = Shaded(np.arange(frames.shape[1]), faces, has_hard_edges=False)
    base = mean_frame(frames)
    distances = ways(frames, base)
    has_normals = shaded.has_hard_edges or are_written(wanted.normals, frames[0], faces)
    if distances.max() <= (0 if wanted.n_targets else wanted.bound) or len(frames) == 1:
        placement, rest = place_still(base if len(frames) > 1 else frames[0])
        still = still_normals(rest[shaded.vertices], shaded.faces) if has_normals else None
        return MovingMesh(placement, rest, None, still, distances)
    placed = place_frames(frames, base)
    bound = max(0.0, wanted.bound / placed.placement.scale - MARGIN)
    if has_normals and wanted.n_targets != 1:  # normals need a target of their own
        morphs, normals = _fit_both(frames, shaded, placed.moves, bound, wanted)
    else:
        morphs, normals = _fit(placed.moves, bound, wanted.n_targets), None
    errors = morphs.errors * placed.placement.scale
    return MovingMesh(placed.placement, placed.base, morphs, normals, errors)


def _fit_both(
    frames: Vertices, shaded: Shaded, moves: npt.NDArray[np.float32], bound: float, wanted: Wanted
) -> tuple[Morphs, NormalTargets]:
    """Morphs of positions and normals, with as large a share of the bound as the latter allow."""
    n_targets = None if wanted.n_targets is None else wanted.n_targets - 1
    split = frames[:, shaded.vertices]
    for share in POSITIONS:
        morphs = _fit(moves, share * bound, n_targets)
        fitted = fit_normals(split, shaded.faces, moves, morphs, wanted.length_error)
        if fitted[0].error <= bound or n_targets is not None:
            break
    return fitted


def _fit(moves: npt.NDArray[np.float32], bound: float, n_targets: int | None) -> Morphs:
    if n_targets is None:
        return fit_morphs(moves, bound)
    return fit_given_morphs(moves, n_targets, bound)
