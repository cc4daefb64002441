"""Scans with holes are followed by a key that lacks few of them."""

import numpy as np
import pytest

from meshreel.codec.error_bounds import ErrorBound
from meshreel.registration.register import register
from samples.captures import as_frames, bent, capsule

RADIUS = 0.14
"""Of the holes: 29 tolerances."""


def scans(n_frames, complete, noise, seed=0):
    """A bending capsule with six holes that move; frame `complete`, if any, has none."""
    rng, frames = np.random.default_rng(seed), []
    places = rng.normal(size=(6, 3))
    places *= np.array([0.3, 0.3, 0.9]) / np.linalg.norm(places, axis=1)[:, None]
    for number in range(n_frames):
        vertices, faces = capsule(
            int(rng.integers(70, 74)), int(rng.integers(60, 64)), rng.random()
        )
        centers, is_kept = vertices[faces].mean(axis=1), np.ones(len(faces), bool)
        for hole, (x, y, z) in enumerate(places if number != complete else ()):
            turn = 0.3 * number + hole
            place = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z
            is_kept &= np.linalg.norm(centers - place, axis=1) > RADIUS
        moved = bent(vertices, 0.06 * number)
        frames.append((moved + noise * rng.normal(size=moved.shape), faces[is_kept]))
    return as_frames(frames)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.0015])
@pytest.mark.parametrize("complete", [2, None])
def test_moving_holes_do_not_end_a_segment(complete, noise):
    found = register(scans(5, complete, noise), ErrorBound(0.2))
    assert [segment.n_frames for segment in found.sequence.segments] == [5]
    if complete is not None:
        assert found.segments[0].key == complete
        assert 4 < found.distances.unsupported_percent < 15
        assert "of the surface, which raw frames lack" in next(found.notes())


def test_a_capture_without_holes_has_no_unsupported_surface():
    frames = [capsule(40, 30 + number) for number in range(2)]
    found = register(as_frames(frames), ErrorBound(0.5))
    assert found.distances.unsupported_percent == 0
    assert "lack" not in next(found.notes())
