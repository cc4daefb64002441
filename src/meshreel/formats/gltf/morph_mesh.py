"""A part of a sequence as base mesh and morph targets."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.error_budget import MARGIN
from meshreel.formats.gltf.morphs import (
    BYTE,
    SHORT,
    IntegerTargets,
    Morphs,
    Placement,
    fit_morphs,
    max_displacements,
    measure,
    place_frames,
    place_static,
    project,
    rounded_weights,
)
from meshreel.formats.options import WriteOptions
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.geometry.normals import face_normals, vertex_normals
from meshreel.model.sequence import Faces, Vertices

POSITION_SHARES = (0.98, 0.9)
"""Fractions of the bound for positions before normals scale targets down, which adds rounding
errors; the second is tried if the first exceeds the bound."""

LENGTH_ERROR = 0.1
"""Acceptable root mean square error of unit normals, about 3.5 degrees."""

MAX_CREASED_SHARE = 0.25
"""Share of creases above which a surface presumably is faceted."""

CREASE_DEG = 60.0
"""Smallest dihedral turn between two faces whose edge is a crease."""


@dataclass(frozen=True, eq=False)
class NormalTargets:
    """Normals of the base mesh, and displacements of normals by morph targets."""

    base: npt.NDArray[Any]
    """int8 or float32 array of shape (V, 3). Integers if there are targets."""
    targets: npt.NDArray[np.int8] = field(default_factory=lambda: np.empty(0, np.int8))
    """int8 array of shape (N, V, 3)."""
    numbers: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    """int64 array of shape (N,). Indices of the morph targets with normals; default: none."""
    angle_deg: float = 0.0
    """Mean angle between animated and original normals."""


def wants_normals(normals: bool | None, frame: Vertices, faces: Faces) -> bool:
    """Return whether a mesh gets normals, by default if it is smooth in one frame."""
    return creased_share(frame, faces) <= MAX_CREASED_SHARE if normals is None else normals


def static_normals(vertices: Vertices, faces: Faces) -> NormalTargets:
    """Return the normals of a static mesh, without targets."""
    return NormalTargets(_units(vertex_normals(vertices, faces)).astype(np.float32))


def fit_normals(
    frames: Vertices,
    faces: Faces,
    displacements: npt.NDArray[np.float32],
    morphs: Morphs,
    length_error: float = 0.0,
) -> tuple[Morphs, NormalTargets]:
    """Return morphs of positions and normals, with one additional target, and the normals.

    A weight that moves vertices a little may rotate normals a lot, but a target can add at most 1
    to a normal. So where that is too little, targets are scaled down and weights up. The targets
    with the largest weights get normals, as many as needed.

    Normals of the base mesh must have length 1. But the displacements are relative to the mean
    normal, which is shorter where a vertex rotates: the additional target, which moves no vertex
    and has a constant weight, compensates for that.

    Parameters
    ----------
    frames : float array of shape (T, R, 3)
        Positions of vertices with one normal each, split at hard edges.
    faces : int32 array of shape (M, 3)
        Faces as indices into these vertices.
    displacements : float32 array of shape (T, 3 V)
        The displacements to which `morphs` was fitted, to measure its errors again.
    length_error : float, default 0
        Acceptable root mean square error of unit normals; 0 to use all targets.
    """
    normals = np.stack([vertex_normals(frame, faces).astype(np.float32) for frame in frames])
    base = _units(normals.mean(axis=0, dtype=np.float64))
    offsets = (normals - base.astype(np.float32)).reshape(len(frames), -1)
    selected = select_normal_targets(morphs.weights, offsets, length_error)
    numbers = np.append(selected, len(morphs.targets))
    weights = np.column_stack([morphs.weights, np.ones(len(frames), np.float32)])
    inverse = np.linalg.pinv(weights[:, numbers].astype(np.float64))
    fields = project(inverse.T.astype(np.float32), offsets)
    factors = np.maximum(1, np.abs(fields).max(axis=1))
    scaled_fields = _as_bytes(fields / factors[:, None]).reshape(len(factors), -1, 3)
    weights[:, numbers] *= factors
    weights = rounded_weights(weights, morphs.error)
    scaled = _scaled_down(morphs.targets, selected, factors[:-1])
    measured = measure(scaled, weights, displacements)
    normal_targets = NormalTargets(_as_bytes(base), scaled_fields, numbers)
    return measured, replace(
        normal_targets, angle_deg=_mean_angle_deg(normal_targets, weights, normals)
    )


def select_normal_targets(
    weights: npt.NDArray[np.float32], offsets: npt.NDArray[np.float32], length_error: float
) -> npt.NDArray[np.int64]:
    """Return the fewest targets, by decreasing weights, that reach the mean error of normals."""
    order = np.argsort(-np.square(weights, dtype=np.float64).sum(axis=0), kind="stable")
    products = (offsets @ offsets.T).astype(np.float64)
    constant = np.ones((len(weights), 1))
    basis, _ = np.linalg.qr(np.column_stack([constant, weights[:, order].astype(np.float64)]))
    explained = np.cumsum(np.einsum("tk,tu,uk->k", basis, products, basis, optimize=True))
    allowed = length_error**2 * offsets.size / 3
    n_needed = int(np.count_nonzero(np.trace(products) - explained[:-1] > allowed))
    return np.sort(order[:n_needed] if length_error else order)


def _scaled_down(
    targets: IntegerTargets, numbers: npt.NDArray[np.int64], factors: npt.NDArray[np.floating]
) -> IntegerTargets:
    """Return targets, some of them scaled down, and an additional one that moves no vertex."""
    levels = np.append(targets.levels, np.float32(BYTE))
    integers = np.concatenate([targets.integers, np.zeros_like(targets.integers[:1])])
    smaller = numbers[factors > 1]
    values = targets.values[smaller] * (SHORT / factors[factors > 1])[:, None]
    integers[smaller], levels[smaller] = np.rint(values), SHORT
    return IntegerTargets(integers, levels)


def _mean_angle_deg(
    normal_targets: NormalTargets,
    weights: npt.NDArray[np.float32],
    normals: npt.NDArray[np.float32],
) -> float:
    """Return the mean angle between normals decoded from bytes and the original ones."""
    added = (normal_targets.targets.astype(np.float32) / BYTE).reshape(
        len(normal_targets.targets), -1
    )
    angles = []
    for own, expected in zip(weights[:, normal_targets.numbers], normals, strict=True):
        decoded = normal_targets.base.astype(np.float32) / BYTE + (own @ added).reshape(
            expected.shape
        )
        lengths = np.linalg.norm(decoded, axis=1) * np.linalg.norm(expected, axis=1)
        cosines = np.einsum("ij,ij->i", decoded, expected) / np.where(lengths > 0, lengths, 1)
        angles.append(np.arccos(np.clip(cosines[lengths > 0], -1, 1)))
    every = np.concatenate(angles)
    return float(np.degrees(every.mean())) if len(every) else 0.0


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return vectors scaled to length 1, or the z axis for zero vectors."""
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
    shared = shared_edges(np.full(len(faces), 3), faces.ravel())
    sides = np.argsort(shared.of_side, kind="stable")
    sides = sides[shared.of_side[sides] >= 0]
    is_pair = np.bincount(shared.of_side[sides]) == 2
    ends, pairs = shared.ends[is_pair], sides[is_pair[shared.of_side[sides]]].reshape(-1, 2) // 3
    has_area = (lengths[pairs, 0] > 0).all(axis=1)
    ends, pairs = ends[has_area], pairs[has_area]
    sides = np.linalg.norm(np.diff(vertices[ends].astype(np.float64), axis=1)[:, 0], axis=1)
    cosines = np.einsum("ij,ij->i", units[pairs[:, 0]], units[pairs[:, 1]])
    is_crease = cosines < np.cos(np.radians(CREASE_DEG))
    return float(sides[is_crease].sum() / sides.sum()) if sides.sum() > 0 else 1.0


@dataclass(frozen=True, eq=False)
class ShadingMesh:
    """A mesh with one normal per vertex, whose vertices are split at hard edges."""

    vertices: npt.NDArray[np.int64]
    """int64 array of shape (R,). Original vertex of each vertex."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    has_hard_edges: bool


@dataclass(frozen=True, eq=False)
class MorphMesh:
    """A part as base mesh and morph targets; without targets, it is static."""

    placement: Placement
    base: npt.NDArray[Any]
    """int16 or float32 array of shape (V, 3). Integers if there are targets."""
    morphs: Morphs | None
    normals: NormalTargets | None
    errors: npt.NDArray[np.floating]
    """float array of shape (T,). Largest error of a vertex in each frame, in model units."""


def fit_part(
    frames: Vertices,
    faces: Faces,
    bound: float,
    options: WriteOptions,
    shading: ShadingMesh | None = None,
) -> MorphMesh:
    """Return a part fitted by a base mesh and morph targets.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    bound : float
        Largest error of a vertex, in model units; 0 for as small as possible.
    options : WriteOptions
        Normals are animated by all targets if they are requested, by default by as few as needed.
    shading : ShadingMesh, optional
        For a mesh with hard edges, which always gets normals. Default: one normal per vertex.
    """
    if shading is None:
        shading = ShadingMesh(np.arange(frames.shape[1]), faces, has_hard_edges=False)
    base = frames.mean(axis=0, dtype=np.float64)
    distances = max_displacements(frames, base)
    has_normals = shading.has_hard_edges or wants_normals(options.normals, frames[0], faces)
    if distances.max() <= (0 if options.targets else bound) or len(frames) == 1:
        placement, rest = place_static(base if len(frames) > 1 else frames[0])
        normals = static_normals(rest[shading.vertices], shading.faces) if has_normals else None
        return MorphMesh(placement, rest, None, normals, distances)
    placement, integers, displacements = place_frames(frames, base)
    bound = max(0.0, bound / placement.scale - MARGIN)
    if has_normals and options.targets != 1:  # normals need an additional target
        morphs, normals = _fit_both(frames, shading, displacements, bound, options)
    else:
        is_compressed = options.compression
        morphs = fit_morphs(displacements, bound, options.targets, is_compressed=is_compressed)
        normals = None
    return MorphMesh(placement, integers, morphs, normals, morphs.errors * placement.scale)


def _fit_both(
    frames: Vertices,
    shading: ShadingMesh,
    displacements: npt.NDArray[np.float32],
    bound: float,
    options: WriteOptions,
) -> tuple[Morphs, NormalTargets]:
    """Return morphs of positions and normals, with the larger share of the bound that works."""
    n_targets = None if options.targets is None else options.targets - 1
    length_error = LENGTH_ERROR if options.normals is None else 0.0
    split = frames[:, shading.vertices]
    for share in POSITION_SHARES:
        morphs = fit_morphs(
            displacements, share * bound, n_targets, is_compressed=options.compression
        )
        fitted = fit_normals(split, shading.faces, displacements, morphs, length_error)
        if fitted[0].error <= bound or n_targets is not None:
            break
    return fitted
