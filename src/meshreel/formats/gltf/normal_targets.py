"""Normals that move with the vertices, by the same morph targets and weights."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import Morphs, measure
from meshreel.formats.gltf.quantized import BYTE, SHORT, IntegerTargets, project
from meshreel.model.geometry.normals import face_normals, vertex_normals
from meshreel.model.sequence import Faces, Vertices

POSITIONS = (0.98, 0.9)
"""Shares of the bound that targets may use before normals scale them down, which rounds them; the
second is tried where the first is too much."""

LENGTH_ERROR = 0.1
"""Root mean square difference of moved unit normals that is small enough: 3.5 degrees or so."""

MOST_CREASED = 0.25
"""A surface of which creases are a larger share is meant to look faceted."""

CREASE_DEG = 60.0
"""Smallest dihedral turn between two faces whose edge is a crease."""


class NormalChoice(Enum):
    """Which normals are written."""

    SMOOTH = "smooth"
    """Of surfaces that are smooth, moved by as few targets as bring them near."""
    ALL = "all"
    """Of all surfaces, moved by all targets."""
    NONE = "none"


@dataclass(frozen=True, eq=False)
class NormalTargets:
    """Normals of the base, and what targets add to them.

    Attributes
    ----------
    base : int8 or float32 array of shape (V, 3)
        Integers where there are targets.
    targets : int8 array of shape (N, V, 3)
    numbers : int64 array of shape (N,)
        The morph targets that add them; others do not turn normals.
    angle_deg : float
        Mean angle to the normals of the frames.
    """

    base: npt.NDArray[Any]
    targets: npt.NDArray[np.int8]
    numbers: npt.NDArray[np.int64]
    angle_deg: float = 0.0


def are_written(choice: NormalChoice, frame: Vertices, faces: Faces) -> bool:
    """Whether a mesh, as it is in one frame, gets normals."""
    if choice is NormalChoice.SMOOTH:
        return creased_share(frame, faces) <= MOST_CREASED
    return choice is NormalChoice.ALL


def still_normals(vertices: Vertices, faces: Faces) -> NormalTargets:
    """Those of a mesh that does not move, without targets."""
    units = _units(vertex_normals(vertices, faces)).astype(np.float32)
    return NormalTargets(units, np.empty((0, *units.shape), np.int8), np.empty(0, np.int64))


def fit_normals(
    frames: Vertices,
    faces: Faces,
    moves: npt.NDArray[np.float32],
    morphs: Morphs,
    length_error: float = 0.0,
) -> tuple[Morphs, NormalTargets]:
    """Morphs that suit positions and normals, with one target more, and the normals.

    A weight that moves vertices a little may turn normals a lot, but what a target adds to a
    normal cannot exceed 1. So targets are made smaller, and weights larger, where it would. The
    targets that move most turn normals, as many as are needed.

    Normals of the base must be units. But what the targets are added to should be the mean normal,
    which is short where a vertex turns around: the additional target, which moves no vertex and
    has the same weight in all frames, makes up for that.

    Parameters
    ----------
    frames : float array of shape (T, R, 3)
        Of what has a normal each: vertices, split at hard edges.
    faces : int32 array of shape (M, 3)
        In these.
    moves : float32 array of shape (T, 3 V)
        That `morphs` was made for, to measure its errors again.
    length_error : float, default 0
        Root mean square difference of unit normals that is small enough; 0 for all targets.
    """
    normals = np.stack([vertex_normals(frame, faces).astype(np.float32) for frame in frames])
    base = _units(normals.mean(axis=0, dtype=np.float64))
    turns = (normals - base.astype(np.float32)).reshape(len(frames), -1)
    turning = _turning_targets(morphs.weights, turns, length_error)
    numbers = np.append(turning, len(morphs.targets))
    weights = np.column_stack([morphs.weights, np.ones(len(frames), np.float32)])
    inverse = np.linalg.pinv(weights[:, numbers].astype(np.float64))
    fields = project(inverse.T.astype(np.float32), turns)
    factors = np.maximum(1, np.abs(fields).max(axis=1))
    added = _as_bytes(fields / factors[:, None]).reshape(len(factors), -1, 3)
    weights[:, numbers] *= factors
    scaled = measure(_scaled_down(morphs.targets, turning, factors[:-1]), weights, moves)
    found = NormalTargets(_as_bytes(base), added, numbers)
    return scaled, replace(found, angle_deg=_mean_angle_deg(found, weights, normals))


def _turning_targets(
    weights: npt.NDArray[np.float32], turns: npt.NDArray[np.float32], length_error: float
) -> npt.NDArray[np.int64]:
    """The targets that move most, ascending: as few as bring normals so near, in the mean."""
    order = np.argsort(-np.square(weights, dtype=np.float64).sum(axis=0), kind="stable")
    products = (turns @ turns.T).astype(np.float64)
    constant = np.ones((len(weights), 1))
    basis, _ = np.linalg.qr(np.column_stack([constant, weights[:, order].astype(np.float64)]))
    explained = np.cumsum(np.einsum("tk,tu,uk->k", basis, products, basis, optimize=True))
    allowed = length_error**2 * turns.size / 3
    n_needed = int(np.count_nonzero(np.trace(products) - explained[:-1] > allowed))
    return np.sort(order[:n_needed] if length_error else order)


def _scaled_down(
    targets: IntegerTargets, numbers: npt.NDArray[np.int64], factors: npt.NDArray[np.floating]
) -> IntegerTargets:
    """Targets, some of them smaller, and one more that moves no vertex."""
    levels = np.append(targets.levels, np.float32(BYTE))
    integers = np.concatenate([targets.integers, np.zeros_like(targets.integers[:1])])
    smaller = numbers[factors > 1]
    values = targets.values[smaller] * (SHORT / factors[factors > 1])[:, None]
    integers[smaller], levels[smaller] = np.rint(values), SHORT
    return IntegerTargets(integers, levels)


def _mean_angle_deg(
    found: NormalTargets, weights: npt.NDArray[np.float32], normals: npt.NDArray[np.float32]
) -> float:
    """Between what a viewer makes of the bytes and the normals, in all frames."""
    added = (found.targets.astype(np.float32) / BYTE).reshape(len(found.targets), -1)
    angles = []
    for own, expected in zip(weights[:, found.numbers], normals, strict=True):
        turned = found.base.astype(np.float32) / BYTE + (own @ added).reshape(expected.shape)
        lengths = np.linalg.norm(turned, axis=1) * np.linalg.norm(expected, axis=1)
        cosines = np.einsum("ij,ij->i", turned, expected) / np.where(lengths > 0, lengths, 1)
        angles.append(np.arccos(np.clip(cosines[lengths > 0], -1, 1)))
    every = np.concatenate(angles)
    return float(np.degrees(every.mean())) if len(every) else 0.0


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Vectors of length 1; along z where there is no direction."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), np.array([0.0, 0.0, 1.0]))


def _as_bytes(values: npt.NDArray[np.floating]) -> npt.NDArray[np.int8]:
    return np.asarray(np.rint(values * BYTE), np.int8)


def creased_share(vertices: npt.NDArray[np.floating], faces: Faces) -> float:
    """Length of creases as a share of that of all edges between two faces; 1 without such edges.

    Boundary edges, edges of more than two faces and faces without area do not count.

    Parameters
    ----------
    vertices : float array of shape (V, 3)
    faces : integer array of shape (M, 3)
    """
    normals = face_normals(vertices, faces)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    ends, pairs = _inner_edges(faces, len(vertices))
    has_area = (lengths[pairs, 0] > 0).all(axis=1)
    ends, pairs = ends[has_area], pairs[has_area]
    sides = np.linalg.norm(np.diff(vertices[ends].astype(np.float64), axis=1)[:, 0], axis=1)
    cosines = np.einsum("ij,ij->i", units[pairs[:, 0]], units[pairs[:, 1]])
    is_crease = cosines < np.cos(np.radians(CREASE_DEG))
    return float(sides[is_crease].sum() / sides.sum()) if sides.sum() > 0 else 1.0


def _inner_edges(faces: Faces, n_verts: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Ends and faces, each of shape (E, 2), of edges that exactly two faces have."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
    keys = edges[:, 0] * n_verts + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(starts, append=len(keys))
    first = starts[counts == 2]
    pairs = np.stack([order[first], order[first + 1]], axis=1)
    return edges[pairs[:, 0]], pairs // 3
