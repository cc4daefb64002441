"""Vertices of streams and compressed glTF files without their order, matched with the original."""

from dataclasses import replace

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.connectivity.coder import encode_mesh
from meshreel.codec.reordering import in_order, without_reordering
from meshreel.kernel.order import depth_first_order, number_by_use
from meshreel.metrics.compare import has_same_triangles
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import PLAIN, Domain

MATCHED = (
    "the order of vertices differs; they were matched, because the decoded mesh has the order that "
    "meshreel derives from the original if its order is dropped"
)
"""Note on sequences whose vertices were matched."""


Numbers = dict[Domain, Integers]


def internal_numbers(source: FrameSource) -> Numbers:
    """Return the number of each item of a mesh in a stream that drops its order.

    Items are vertices, and cells or else triangles.
    """
    cells = source.surface.cells
    connectivity = encode_mesh(source.faces, cells, source.n_verts, order="drop")
    numbers: Numbers = {Domain.VERTEX: np.argsort(connectivity.internal_to_given)}
    if connectivity.cells_to_internal is not None:
        numbers[Domain.CELL] = connectivity.cells_to_internal
    else:
        numbers[Domain.FACE] = np.argsort(connectivity.given_faces(source.faces))
    return numbers


def walk_numbers(source: FrameSource) -> Numbers:
    """Return the number of each vertex of a mesh in a compressed glTF file of one material."""
    numbers = np.full(source.n_verts, -1, np.int64)
    _, by_use = number_by_use(source.faces[depth_first_order(source.faces)])
    numbers[: len(by_use)] = by_use
    return {Domain.VERTEX: numbers}


def match_order(
    original: MeshSequence, decoded: MeshSequence
) -> tuple[MeshSequence, MeshSequence, bool]:
    """Return the sequences with the vertices of the decoded one in the order of the original.

    The order of the encoder and of the glTF writer follows from the faces of the original. A
    segment is reordered if its faces then equal those of the original, and returned unchanged
    otherwise. Segments of the original that the encoder joined, as only their order differs, are
    joined too.

    Returns
    -------
    original, decoded : MeshSequence
    is_matched : bool
        Whether any segment was reordered.
    """
    segments, segments_hat = original.segments, decoded.segments
    if len(segments) > len(segments_hat):
        joined = without_reordering(original, "drop")
        segments = joined.segments
        if len(segments) == len(segments_hat):
            original = joined
    if len(segments) != len(segments_hat):
        return original, decoded, False
    pairs = list(zip(segments, segments_hat, strict=True))
    matched = [_in_order_of(*pair) for pair in pairs]
    if all(reordered is segment for reordered, (_, segment) in zip(matched, pairs, strict=True)):
        return original, decoded, False
    return original, MeshSequence.of_segments(matched, decoded.name, decoded.timing), True


def _in_order_of(original: FrameSource, decoded: FrameSource) -> FrameSource:
    """Return a decoded segment in the order of the original, or unchanged if they differ."""
    n_verts = original.n_verts
    if (n_verts, len(original.faces)) != (decoded.n_verts, len(decoded.faces)):
        return decoded
    if has_same_triangles(original.faces, decoded.faces, n_verts):
        return decoded
    for numbers_of in (internal_numbers, walk_numbers):
        numbers = numbers_of(original)
        faces = np.argsort(numbers[Domain.VERTEX])[decoded.faces].astype(np.int32)
        if has_same_triangles(original.faces, faces, n_verts):
            break
    else:
        return decoded
    surface = PLAIN
    if Domain.FACE in numbers:
        faces = original.faces
    if original.surface.cells is not None:
        faces, given = original.faces, original.surface
        surface = replace(PLAIN, cells=given.cells, face_sizes=given.face_sizes)
    return in_order(decoded, numbers, faces, surface)  # without tracks that need the order
