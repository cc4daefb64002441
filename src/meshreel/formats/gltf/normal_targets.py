"""Normals that move with the vertices, by the same morph targets and weights."""

from dataclasses import dataclass

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
    base : int8 array of shape (V, 3)
    targets : int8 array of shape (K, V, 3)
    """

    base: npt.NDArray[np.int8]
    targets: npt.NDArray[np.int8]


def base_normals(vertices: Vertices, faces: Faces) -> npt.NDArray[np.int8]:
    """Unit normals of a mesh that does not move; upwards where no face has an area."""
    return _as_bytes(_units(vertex_normals(vertices, faces)))


def fit_normals(
    frames: Vertices, faces: Faces, moves: npt.NDArray[np.float32], morphs: Morphs
) -> tuple[Morphs, NormalTargets]:
    """Morphs scaled so that one weight suits positions and normals, and the normals.

    A weight that moves vertices a little may turn normals a lot, but what a target adds to a
    normal cannot exceed 1. So targets are made smaller, and weights larger, where it would.

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
    inverse = np.linalg.pinv(morphs.weights.astype(np.float64))
    fields = project(inverse.T.astype(np.float32), turns)
    factors = np.maximum(1, np.abs(fields).max(axis=1))
    integers = np.rint(morphs.targets.values * (SHORT / factors[:, None])).astype(np.int16)
    targets = IntegerTargets(integers, np.full(len(factors), SHORT, np.float32))
    scaled = measure(targets, morphs.weights * factors, moves)
    added = _as_bytes(fields / factors[:, None]).reshape(len(factors), -1, 3)
    return scaled, NormalTargets(_as_bytes(base), added)


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), np.array([0.0, 0.0, 1.0]))


def _as_bytes(values: npt.NDArray[np.floating]) -> npt.NDArray[np.int8]:
    return np.asarray(np.rint(values * BYTE), np.int8)
