"""Scans with holes are followed by a key that lacks few of them."""

import numpy as np
import pytest

import meshreel
from meshreel import InvalidInputError, Track
from meshreel.registration.growing import Follower
from meshreel.registration.holes import SCANNED, scanned_faces
from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance
from samples.captures import as_frames, bent, capsule, revolved
from samples.shapes import square

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
@pytest.mark.parametrize(("complete", "noise"), [(2, 0.0), (None, 0.0015)])
def test_moving_holes_do_not_end_a_segment(complete, noise):
    found = register(scans(5, complete, noise), tolerance=0.2, quality=68)
    assert [segment.n_frames for segment in found.sequence.segments] == [5]
    assert found.segments[0].key_mesh.mesh.is_boundary.sum() < 32  # what no frame shows
    if complete is not None:
        assert found.segments[0].key == complete
        assert 4 < found.distances.unsupported_percent < 15
        assert "of the surface, which raw frames lack" in next(found.notes())


def test_a_body_of_revolution_does_not_turn_with_its_holes():
    def holed(turn, n_rings):
        z = np.cos(np.linspace(0, np.pi, n_rings + 2))
        vertices, faces = revolved(0.25 * np.sqrt(1 - z[1:-1] ** 2), 0.5 * z, n_rings, turn)
        angles = turn + np.arange(6) * np.pi / 3
        places = np.stack(
            [0.24 * np.cos(angles), 0.24 * np.sin(angles), 0.17 * (-1) ** np.arange(6)]
        )
        gaps = np.linalg.norm(vertices[faces].mean(axis=1)[..., None] - places, axis=1)
        return TriangleMesh(vertices, faces[gaps.min(axis=1) > 0.08])

    key, *frames = (holed(0.14 * number, 44 + number % 3) for number in range(5))
    *_, last = Follower(key, Tolerance(0.002)).registered_keys(frames)
    before, after = (np.arctan2(*mesh.vertices[:, 1::-1].T) for mesh in (key, last.mesh))
    turns = np.angle(np.exp(1j * (after - before)))
    assert abs(turns.mean()) < 0.1, "the holes turned by 0.56"


def test_a_capture_without_holes_has_no_unsupported_surface():
    frames = [capsule(40, 30 + number) for number in range(2)]
    found = register(as_frames(frames), tolerance=0.5)
    assert found.distances.unsupported_percent == 0
    assert "lack" not in next(found.notes())


@pytest.mark.slow
def test_kept_holes_are_a_track_of_the_faces_that_frames_have():
    raw = scans(3, 1, 0.0)
    with pytest.warns(UserWarning, match="filled as frames near in time show it"):
        found = meshreel.register(raw, keep_holes=True)
    assert found.n_segments == 1
    track, areas = found.tracks[SCANNED], face_areas(found[1])
    assert (track.domain, track.dtype, track.shape) == ("face", np.uint8, (3, found.n_faces, 1))
    assert track[1].all()
    lost = [1 - areas @ track[number][:, 0] / areas.sum() for number in range(3)]
    expected = [1 - face_areas(frame).sum() / face_areas(raw[1]).sum() for frame in raw]
    np.testing.assert_allclose(lost, expected, atol=0.01)
    decoded = meshreel.decode(meshreel.encode(found)).tracks[SCANNED]
    assert np.array_equal(decoded.values.sum(axis=1), track.values.sum(axis=1))


def face_areas(frame):
    return TriangleMesh(np.float64(frame.vertices), frame.faces).areas


def test_rims_of_holes_do_not_flicker():
    """A face at a rim stays hidden until the raw surface reaches its centroid."""
    vertices, faces = square(n=11)
    frames = []
    for end in (0.62, 0.69, 0.62, 0.8, 0.69):  # centroids are at 0.63 and 0.67, 0.73 and 0.77, ...
        raw, raw_faces = square(n=2)
        frames.append(TriangleMesh(raw * [end, 1, 1], raw_faces))
    track = scanned_faces(frames, [vertices] * 5, faces, Tolerance(0.05))
    hidden = np.count_nonzero(track.values == 0, axis=1)[:, 0] // 10
    assert hidden.tolist() == [6, 6, 6, 4, 5]


def test_a_capture_without_holes_has_no_track_of_them():
    frames = as_frames([capsule(40, 30 + number) for number in range(2)])
    with pytest.warns(UserWarning, match="have all faces, so there is no track 'scanned'"):
        found = meshreel.register(frames, tolerance="0.5%", keep_holes=True)
    assert found.segments[0].tracks == {}


def test_values_of_the_name_of_the_track_are_refused():
    frames = as_frames([capsule(8, 8 + number) for number in range(2)]).segments
    named = frames[1].replace(tracks={SCANNED: Track(np.zeros((1, frames[1].n_verts)))})
    with pytest.raises(InvalidInputError, match="values called 'scanned'"):
        meshreel.register(meshreel.concatenate([frames[0], named]), keep_holes=True)


def without_ends(n_frames):
    """A bending capsule that lacks one end or the other."""
    rng, frames = np.random.default_rng(0), []
    for number in range(n_frames):
        vertices, faces = capsule(
            int(rng.integers(40, 44)), int(rng.integers(36, 40)), rng.random()
        )
        heights = vertices[faces].mean(axis=1)[:, 2] * (-1) ** number
        frames.append((bent(vertices, 0.06 * number), faces[heights < 0.6]))
    return as_frames(frames)


@pytest.mark.slow
def test_a_key_gets_what_other_frames_show():
    found = register(without_ends(3), tolerance=0.4)
    (segment,) = found.segments
    assert np.ptp(segment.positions[..., 2], axis=1).min() > 1.95
    assert found.distances.p95_percent < 0.05
    assert 10 < found.distances.unsupported_percent < 20
    assert "added surface that other frames show to the mesh of 1 key frame" in found.changes
