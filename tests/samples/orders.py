"""Sequences whose vertices, faces and first corners have a random order."""

from dataclasses import replace

import numpy as np

from meshreel.model.surface import Domain
from meshreel.model.tracks import Track


def shuffled(sequence, seed):
    """Return the sequence with vertices, faces and corners of faces in another order."""
    rng = np.random.default_rng(seed)
    of_verts, of_faces = rng.permutation(sequence.n_verts), rng.permutation(len(sequence.faces))
    corners = (rng.integers(0, 3, len(of_faces))[:, None] + np.arange(3)) % 3
    numbers = {
        Domain.VERTEX: of_verts,
        Domain.FACE: of_faces,
        Domain.CORNER: (3 * of_faces[:, None] + corners).ravel(),
    }
    renamed, surface = np.argsort(of_verts).astype(np.int32), sequence.surface
    attributes = tuple(
        replace(given, values=given.per_item()[numbers[given.domain]], indices=None)
        for given in surface.attributes
    )
    groups = tuple(replace(given, numbers=given.numbers[of_faces]) for given in surface.groups)
    hard = None if surface.hard_edges is None else renamed[surface.hard_edges]
    tracks = {
        name: Track(given.values[:, of_verts], given.domain, given.kind, given.unit)
        for name, given in sequence.tracks.items()
    }
    return sequence.replace(
        vertices=sequence.vertices[:, of_verts],
        faces=renamed[np.take_along_axis(sequence.faces[of_faces], corners, axis=1)],
        surface=replace(surface, attributes=attributes, groups=groups, hard_edges=hard),
        tracks=tracks,
    )
