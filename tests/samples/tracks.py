"""Sequences with tracks of every domain, kind and type, and comparisons."""

import numpy as np

from meshreel.model.surface import Domain
from meshreel.model.tracks import Track, domain_sizes
from samples.meshes import quad_sheet

OF_SURFACES = Domain.VERTEX, Domain.FACE, Domain.CORNER


def tracked_sheet(n_frames=6, domains=OF_SURFACES):
    """Return `quad_sheet` with tracks of these domains, with some values not finite."""
    sheet = quad_sheet(n_frames)
    sizes = domain_sizes(sheet.n_verts, sheet.n_faces, sheet.surface)
    rng = np.random.default_rng(5)
    tracks = {}
    for domain in domains:
        shape = n_frames, sizes[domain]
        heat = rng.normal(size=shape).astype(np.float32)
        heat[0, :4] = [np.nan, np.inf, -np.inf, -0.0]
        tracks |= {
            f"heat of {domain}/s": Track(heat, domain, unit="K"),
            f"flow_{domain}": Track(rng.normal(size=(*shape, 3)), domain, "velocity"),
            f"shade_{domain}": Track(
                rng.integers(0, 256, (*shape, 4)).astype(np.uint8), domain, "color"
            ),
            f"step_{domain}": Track(rng.integers(-(2**62), 2**62, shape), domain),
            f"tensor_{domain}": Track(rng.normal(size=(*shape, 9)).astype(np.float32), domain),
        }
    return sheet.replace(tracks=tracks)


def quad_sheet_with(**tracks):
    """Return `quad_sheet` of 12 frames at 25 fps with these tracks."""
    return quad_sheet(12).replace(fps=25.0, start_s=0.0, tracks=tracks)


def assert_same_tracks(found, expected):
    """Assert that tracks are equal bit for bit, in memory or not."""
    assert set(found) == set(expected)
    for name, track in expected.items():
        other = found[name]
        assert (other.domain, other.kind, other.unit) == (track.domain, track.kind, track.unit)
        assert (other.shape, other.dtype) == (track.shape, track.dtype)
        for start, stop in ((0, track.shape[0]), (track.shape[0] - 1, track.shape[0]), (0, 0)):
            assert other.read(start, stop).tobytes() == track.read(start, stop).tobytes()


def given_places(order, given, decoded):
    """Return the original vertex of each decoded one; without an order, the nearest one.

    Both are positions of shape (T, V, 3); distances are those in the first frame.
    """
    if order != "drop":
        return np.arange(given.shape[1])
    differences = given[0][:, None] - decoded[0][None]
    return np.linalg.norm(differences, axis=2).argmin(axis=0)
