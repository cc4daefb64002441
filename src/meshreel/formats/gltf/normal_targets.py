"""Normals that move with the vertices, by the same morph targets and weights."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, measure
from meshreel.formats.gltf.quantized import BYTE, SHORT, IntegerTargets, project
from meshreel.geometry.normals import vertex_normals
from meshreel.sequence import Faces, Vertices

POSITIONS = 0.9
"""Share of the bound that targets may use before normals scale them down, which rounds them."""


@dataclass(frozen=True, eq=False)
class NormalTargets:
    """Normals of the base, and what each target adds to them.

    Attributes
    ----------
    base : int8 or float32 array of shape (V, 3)
        Integers where there are targets.
    targets : int8 array of shape (K, V, 3)
    """

    base: npt.NDArray[Any]
    targets: npt.NDArray[np.int8]


def still_normals(vertices: Vertices, faces: Faces) -> NormalTargets:
    """Those of a mesh that does not move, without targets."""
    units = _units(vertex_normals(vertices, faces)).astype(np.float32)
    return NormalTargets(units, np.empty((0, *units.shape), np.int8))


def fit_normals(
    frames: Vertices, faces: Faces, moves: npt.NDArray[np.float32], morphs: Morphs
) -> tuple[Morphs, NormalTargets]:
    """Morphs that suit positions and normals, with one target more, and the normals.

    A weight that moves vertices a little may turn normals a lot, but what a target adds to a
    normal cannot exceed 1. So targets are made smaller, and weights larger, where it would.

    Normals of the base must be units. But what the targets are added to should be the mean normal,
    which is short where a vertex turns around: the additional target, which moves no vertex and
    has the same weight in all frames, makes up for that.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    moves : float32 array of shape (T, 3 V)
        That `morphs` was made for, to measure its errors again.
    morphs : Morphs
    """
    normals = np.stack([vertex_normals(frame, faces).astype(np.float32) for frame in frames])
    base = _units(normals.mean(axis=0, dtype=np.float64))
    turns = (normals - base.astype(np.float32)).reshape(len(frames), -1)
    weights = np.column_stack([morphs.weights, np.ones(len(frames), np.float32)])
    values = np.concatenate([morphs.targets.values, np.zeros((1, moves.shape[1]), np.float32)])
    inverse = np.linalg.pinv(weights.astype(np.float64))
    fields = project(inverse.T.astype(np.float32), turns)
    factors = np.maximum(1, np.abs(fields).max(axis=1))
    integers = np.rint(values * (SHORT / factors[:, None])).astype(np.int16)
    targets = IntegerTargets(integers, np.full(len(factors), SHORT, np.float32))
    scaled = measure(targets, weights * factors, moves)
    added = _as_bytes(fields / factors[:, None]).reshape(len(factors), -1, 3)
    return scaled, NormalTargets(_as_bytes(base), added)


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Vectors of length 1; along z where there is no direction."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), np.array([0.0, 0.0, 1.0]))


def _as_bytes(values: npt.NDArray[np.floating]) -> npt.NDArray[np.int8]:
    return np.asarray(np.rint(values * BYTE), np.int8)
