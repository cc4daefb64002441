"""Joining of runs: the mesh of one key continues in the frames of others.

At a frame that two runs share, both have a mesh of the same surface. The vertices of one are points
near the faces of the other, which move them through its frames. There the nodes of the key follow
these points, as they follow a surface elsewhere: vertices that kept their own error in each frame
took 8 % more bytes (60 frames of a body).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.geometry.normals import unit
from meshreel.model.sequence import Faces
from meshreel.registration.capture import Frames, Topology
from meshreel.registration.fitting import MIN_COSINE, REACH
from meshreel.registration.growing import (
    Failure,
    Follower,
    Segment,
    filled_segment,
)
from meshreel.registration.refining import KeyMesh
from meshreel.registration.stores import TemporaryStore
from meshreel.registration.triangle_mesh import Indices, TriangleMesh

MAX_JOINED = 8
"""Largest number of segments that are joined into one. A key takes 1.2 % of the bytes of eight runs
of a body, and this bounds the meshes between a key and a frame."""


class Piece(NamedTuple):
    """A segment of a run, and the frames for which it is used.

    Attributes
    ----------
    segment : Segment
        It also covers the first frame of the next piece in its chain.
    numbers : range
    """

    segment: Segment
    numbers: range


Chain = Sequence[Piece]
"""Pieces in order, each of which shares a frame with the next."""


@dataclass(frozen=True)
class Embedding:
    """Points near the faces of another mesh, which move and turn with them.

    Attributes
    ----------
    faces : int64 array of shape (N,)
    weights : float64 array of shape (N, 3)
        Barycentric coordinates in them.
    offsets : float64 array of shape (N, 3)
        From there to the points, in a frame of the interpolated normal and an edge of the face.
    """

    faces: Indices
    weights: Floats
    offsets: Floats

    @classmethod
    def of_vertices(cls, mesh: TriangleMesh, base: TriangleMesh) -> "Embedding":
        """Embed the vertices of a mesh at corresponding points of another, else at closest ones."""
        closest = base.closest(mesh.vertices)
        indices, similar = base.corresponding(mesh.vertex_samples(), MIN_COSINE, REACH)
        faces, weights = closest.faces, closest.weights
        faces[indices], weights[indices] = similar.faces, similar.weights
        embedding = cls(faces, weights, np.zeros_like(mesh.vertices))
        gaps = mesh.vertices - embedding.positions(base)
        return replace(embedding, offsets=np.einsum("nij,ni->nj", embedding._axes(base), gaps))

    def positions(self, base: TriangleMesh) -> Floats:
        """Return the points on the mesh in another pose, of shape (N, 3)."""
        points = _interpolated(base.vertices, base.faces[self.faces], self.weights)
        return np.asarray(points + np.einsum("nij,nj->ni", self._axes(base), self.offsets))

    def _axes(self, base: TriangleMesh) -> Floats:
        """Return the axes of the frame of each point as columns, of shape (N, 3, 3)."""
        corners = base.faces[self.faces]
        normals = unit(_interpolated(base.vertex_normals, corners, self.weights))
        edges = base.vertices[corners[:, 1]] - base.vertices[corners[:, 0]]
        across = unit(np.cross(normals, edges))
        return np.stack([normals, across, np.cross(normals, across)], axis=2)


def _interpolated(values: Floats, corners: Faces, weights: Floats) -> Floats:
    return np.asarray(np.einsum("nk,nkc->nc", weights, values[corners]))


def chains(runs: Sequence[tuple[range, Sequence[Segment]]]) -> Iterator[Chain]:
    """Yield the segments of runs, given the frames of each run; the next begins with its last."""
    cuts = [*(numbers.start for numbers, _ in runs), runs[-1][0].stop]
    chain: list[Piece] = []
    for (_, segments), limits in zip(runs, pairwise(cuts), strict=True):
        for segment in segments:
            numbers = range(*(np.clip(limits, segment.first, segment.numbers.stop).tolist()))
            if not numbers:
                continue
            is_joined = chain and numbers.start == limits[0] in chain[-1].segment.numbers
            if chain and not (is_joined and len(chain) < MAX_JOINED):
                yield chain
                chain = []
            chain.append(Piece(segment, numbers))
    if chain:
        yield chain


class Join(NamedTuple):
    """The frames of a piece that the mesh of another piece may continue in.

    Attributes
    ----------
    piece : int
        Number in the chain.
    numbers : range
        In the order from the other piece on.
    key : TriangleMesh
        The mesh of the other piece.
    embedding : Embedding
        Its vertices on the mesh of this piece.
    """

    piece: int
    numbers: range
    key: TriangleMesh
    embedding: Embedding


def joins(chain: Chain, key: int, normalized: Callable[[Floats], Floats]) -> Iterator[Join]:
    """Yield the joins of the mesh of a piece with all others of its chain, outward."""
    first = chain[key].segment

    def mesh(segment: Segment, number: int) -> TriangleMesh:
        positions = normalized(segment.positions[number - segment.first])
        return TriangleMesh(positions, segment.key_mesh.mesh.faces)

    for step, others in ((-1, range(key - 1, -1, -1)), (1, range(key + 1, len(chain)))):
        embedding, previous = None, first
        for number in others:
            piece = chain[number]
            shared = chain[max(number, number - step)].numbers.start
            moved = mesh(previous, shared)
            if embedding is not None:
                positions = embedding.positions(moved)
                moved = TriangleMesh(positions, first.key_mesh.mesh.faces)
            embedding = Embedding.of_vertices(moved, mesh(piece.segment, shared))
            previous = piece.segment
            yield Join(number, piece.numbers[::step], first.key_mesh.mesh, embedding)


def best_key(chain: Chain, topologies: Mapping[int, Topology | None]) -> int:
    """Return the piece whose key has the best topology, nearest to the middle of the chain."""
    keys = [topologies[piece.segment.key] for piece in chain]
    best = max(key for key in keys if key is not None)
    middle = (chain[0].numbers.start + chain[-1].numbers.stop) / 2
    return min(
        (number for number, key in enumerate(keys) if key == best),
        key=lambda number: abs(chain[number].segment.key - middle),
    )


def join(frames: Frames, segment: Segment, plan: Join) -> Segment:
    """Return a segment of the other key in the first frames of a join, up to one that it misses."""
    (_, numbers, key, embedding), tolerance = plan, frames.capture.tolerance
    follower, faces = Follower(key, tolerance), segment.key_mesh.mesh.faces
    positions, errors, n_folded = [], [], []
    reasons: tuple[tuple[int, str], ...] = ()

    state = None
    for number in numbers:
        base = TriangleMesh(frames.normalized(segment.positions[number - segment.first]), faces)
        moved = embedding.positions(base)
        outcome = follower.conform(state or follower.state_at(moved), moved, frames.mesh(number))
        if isinstance(outcome, Failure):
            reasons = ((number, outcome.reason),)
            break
        state = outcome.state
        positions.append(frames.restored(outcome.positions))
        errors.append(outcome.errors)
        n_folded.append(outcome.n_folded)
    done, step = numbers[: len(errors)], numbers.step
    shape = len(done), *key.vertices.shape
    joined = replace(
        segment,
        first=min(done, default=numbers[0]),
        positions=np.array(positions, segment.positions.dtype).reshape(shape)[::step],
        key_mesh=KeyMesh.of_mesh(key),
        errors=tuple(errors[::step]),
        n_folded=tuple(n_folded[::step]),
        reasons=(*segment.reasons, *reasons),
        filled=(),
        unknown=(),
    )
    with closing(TemporaryStore()) as store:
        return filled_segment(joined, frames, tolerance, store, lambda stage, n_done: None)


def merged(
    chain: Chain, key: int, joined: Mapping[int, Segment], store: TemporaryStore
) -> tuple[Segment, list[Chain]]:
    """Return a segment of the frames that the mesh of a piece follows, and the rest of its chain.

    Parameters
    ----------
    joined : mapping of int to Segment
        Results of `join` by the number of their piece.
    """
    own = chain[key].segment.part(chain[key].numbers)
    parts, reasons, rest = [own], dict(own.reasons), list[Chain]()
    for step, others in ((-1, range(key - 1, -1, -1)), (1, range(key + 1, len(chain)))):
        for number in others:
            part, piece = joined[number], chain[number]
            reasons |= dict(part.reasons)
            if part.n_frames:
                parts.append(part)
            if remaining := piece.numbers[::step][part.n_frames :][::step]:
                piece = piece._replace(numbers=remaining)
                rest.append([piece, *chain[number + 1 :]] if step > 0 else [*chain[:number], piece])
                break
    own = replace(own, reasons=tuple(reasons.items()))
    if len(parts) == 1:
        return own.part(own.numbers), rest
    parts.sort(key=lambda part: part.first)
    numbers = range(parts[0].first, parts[-1].numbers.stop)
    name = f"frames_{numbers.start}_to_{numbers.stop}"
    for part in parts:
        for number, positions in zip(part.numbers, part.positions, strict=True):
            store.put(name, number, positions)
    whole = replace(
        own,
        first=numbers.start,
        positions=store.stack(name, numbers),
        errors=tuple(error for part in parts for error in part.errors),
        n_folded=tuple(n_folded for part in parts for n_folded in part.n_folded),
        filled=tuple(row for part in parts for row in part.filled),
        unknown=tuple(row for part in parts for row in part.unknown),
    )
    return whole.part(numbers), rest
