"""Raw captures become few segments, within the tolerance."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel import Attribute, Domain, InvalidInputError, Kind, MeshSequence, Surface, Track
from meshreel.codec.options import config_of
from meshreel.model.notes import Notes
from meshreel.registration.cleaning import clean
from meshreel.registration.register import register
from meshreel.registration.transfer import RawFrame, items_at_corners, transferred_tracks
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, measure
from samples.captures import as_frames, bent, capsule, capture, unbent
from samples.shapes import square

TOLERANCE = 0.5
N_FRAMES, LAST_ANGLE = 4, 0.3


@pytest.fixture(scope="module")
def raw():
    return capture(N_FRAMES, LAST_ANGLE)


@pytest.fixture(scope="module")
def registered(raw):
    return register(raw, tolerance=TOLERANCE)


def only_segment(found):
    (segment,) = found.sequence.segments
    return segment


def test_a_moving_surface_becomes_one_segment(raw, registered):
    sequence = registered.sequence
    assert (sequence.n_segments, sequence.n_frames, sequence.fps) == (1, raw.n_frames, 25.0)
    raw_key = raw.segments[registered.segments[0].key]
    assert sequence.segments[0].n_verts < raw_key.n_verts


def test_every_frame_is_within_the_tolerance(raw, registered):
    limit = registered.tolerance
    for frame, original in zip(registered.sequence, raw, strict=True):
        mesh, target = (
            TriangleMesh(registered.frames.normalized(one.vertices), one.faces)
            for one in (frame, original)
        )
        errors = measure(mesh, target, limit)
        assert not errors.exceeds(limit)
    assert registered.distances.psnr_db > 65
    assert registered.distances.n_folded == 0


@pytest.mark.slow
def test_notes_state_a_smaller_tolerance_that_every_frame_meets():
    """`measure` confirms it, and that a clearly smaller one is exceeded."""
    meshes = [capsule(60 + n, 54 + n, n / 3) for n in range(3)]
    raw = as_frames([(bent(mesh, 0.15 * n), faces) for n, (mesh, faces) in enumerate(meshes)])
    registered = register(raw, tolerance=TOLERANCE, quality=68)
    stated = registered.smaller_tolerance
    assert float(stated.removesuffix(" %")) == registered.met_percent < 0.75 * TOLERANCE
    assert f"every frame meets a tolerance of {stated}, too" in map(str, registered.notes())

    def is_met(percent):
        limit = Tolerance(percent / 100 * registered.diagonal)
        return not any(
            measure(registered._mesh(registered.sequence, n), target, limit).exceeds(limit)
            for n, target in enumerate(map(registered.frames.mesh, range(len(meshes))))
        )

    assert is_met(registered.met_percent)
    assert not is_met(0.65 * registered.met_percent)


def test_a_tolerance_that_is_just_met_is_not_stated(registered):
    (segment,) = registered.segments
    error = replace(segment.errors[0], min_tolerance=0.8 * registered.tolerance.length)
    segments = (replace(segment, errors=(error, *segment.errors[1:])),)
    just_met = replace(registered, segments=segments)
    assert not just_met.smaller_tolerance
    assert "tolerance of" not in " ".join(map(str, just_met.notes()))


def test_the_mesh_follows_the_material(registered):
    """Vertices stay where they are along the axis, although nothing but the surface tells them."""
    segment = only_segment(registered)
    key = registered.segments[0].key
    angles = np.linspace(0, LAST_ANGLE, N_FRAMES)
    for positions, angle in zip(segment.vertices, angles, strict=True):
        expected = bent(unbent(segment.vertices[key], angles[key]), angle)
        assert np.linalg.norm(positions - expected, axis=1).mean() < 0.05


@pytest.mark.slow
def test_times_are_those_of_the_raw_frames(raw):
    parts = [
        frame.replace(start_s=7 + number / raw.fps) for number, frame in enumerate(raw.segments)
    ]
    result = register(meshreel.concatenate(parts), tolerance=TOLERANCE)
    assert (result.sequence.start_s, only_segment(result).start_s) == (7.0, 7.0)
    assert meshreel.decode(meshreel.encode(result.sequence)).start_s == 7.0


@pytest.mark.slow
def test_registration_is_deterministic(raw, registered):
    again = only_segment(register(raw, tolerance=TOLERANCE))
    assert np.array_equal(again.vertices, only_segment(registered).vertices)


def torn():
    """Two small capsules apart, as (vertices, faces)."""
    vertices, faces = capsule(20, 20)
    aside = np.array([0.7, 0, 0])
    halves = np.vstack([vertices * 0.5 + aside, vertices * 0.5 - aside])
    return halves, np.vstack([faces, faces + len(vertices)])


@pytest.mark.slow
def test_a_surface_that_cannot_be_followed_begins_a_segment(raw):
    vertices, faces = torn()
    others = as_frames([(vertices, faces), (vertices + np.array([0, 0, 0.01]), faces)])
    result = register(meshreel.concatenate([raw, others]), tolerance=TOLERANCE)
    assert [segment.n_frames for segment in result.sequence.segments] == [raw.n_frames, 2]
    assert any("does not continue the mesh" in line for line in result.cuts())


@pytest.mark.slow
def test_frames_without_a_surface_stay_as_they_are(raw):
    empty = as_frames([(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))])
    result = register(meshreel.concatenate([empty, raw, empty]), tolerance=TOLERANCE)
    assert [segment.n_frames for segment in result.sequence.segments] == [1, raw.n_frames, 1]
    assert result.sequence[0].vertices.shape == (3, 3)
    assert any("without a surface" in note for note in result.changes)


def with_corner_values(segment, is_turned):
    """A raw frame with texture coordinates of its corners, and with its faces turned over or not.

    The height is in the texture coordinates.
    """
    faces = segment.faces[:, ::-1] if is_turned else segment.faces
    uv = segment.vertices[0][faces.ravel()][:, ::2].copy()
    surface = Surface(attributes=(Attribute("uv", Kind.UV, Domain.CORNER, uv),))
    return MeshSequence(segment.vertices, faces, segment.fps, surface=surface)


@pytest.mark.parametrize(
    ("turned", "named"),
    [
        ({1}, "turned the faces of frame 1, which were inside out"),
        ({0, 2, 3}, "turned the faces of frame 1, which were inside out"),
        ({0, 1, 2, 3}, None),
    ],
)
@pytest.mark.slow
def test_frames_inside_out_are_turned_like_most(raw, turned, named):
    """With the values of their corners, also where a turned frame is the key."""
    key, *_ = (segment.key for segment in register(raw, tolerance=TOLERANCE).segments)
    assert key == 1
    results = [
        register(
            meshreel.concatenate(
                [with_corner_values(one, n in numbers) for n, one in enumerate(raw.segments)]
            ),
            tolerance=TOLERANCE,
        )
        for numbers in (set(), turned)
    ]
    expected, found = map(only_segment, results)
    if turned == {1}:
        assert np.array_equal(found.vertices, expected.vertices)
        assert np.array_equal(found.faces, expected.faces)
    uv = found.surface.attributes[0].per_item()
    key_vertices = found.vertices[key][found.faces.ravel()]
    np.testing.assert_allclose(uv, key_vertices[:, ::2], atol=0.005)
    notes = [change for change in results[1].changes if "inside out" in change]
    assert notes == ([named] if named else [])


def test_constant_faces_are_an_error(raw):
    with pytest.raises(InvalidInputError, match="there is only one frame"):
        register(raw[:1], tolerance=TOLERANCE)


def test_nothing_to_register_is_an_error():
    flat = (np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    empty = as_frames([flat, flat])
    with pytest.raises(InvalidInputError, match="no frame has a face with an area"):
        register(empty)


@pytest.mark.slow
def test_texture_coordinates_of_the_key_are_kept_at_corners(raw):
    def textured(segment):
        uv = segment.vertices[0][:, :2].copy()
        surface = Surface(attributes=(Attribute("uv", Kind.UV, Domain.VERTEX, uv),))
        return MeshSequence(segment.vertices, segment.faces, segment.fps, surface=surface)

    given = meshreel.concatenate([textured(one) for one in raw.segments[:3]])
    result = register(given, tolerance=TOLERANCE)
    segment = only_segment(result)
    (uv,) = segment.surface.attributes
    at_corners = segment.vertices[result.segments[0].key][segment.faces.ravel()][:, :2]
    assert uv.domain is Domain.CORNER
    np.testing.assert_allclose(uv.per_item(), at_corners, atol=0.005)  # the key is fitted


def test_segments_encode_to_fewer_bytes_than_raw_frames(raw, registered):
    sizes = [len(meshreel.encode(one, quality=70)) for one in (raw, registered.sequence)]
    assert sizes[1] < 0.6 * sizes[0]


def test_distances_of_a_decoded_sequence_include_those_of_coding(raw, registered):
    again = registered.distances_of(registered.sequence, range(registered.raw.n_frames))
    assert vars(again) == pytest.approx(vars(registered.distances), rel=1e-3)
    decoded = meshreel.decode(meshreel.encode(registered.sequence, quality=40))
    assert registered.distances_of(decoded, [0, 1]).mean_percent > registered.distances.mean_percent


@pytest.mark.slow
def test_notes_state_the_result_and_the_cuts(raw):
    result = register(meshreel.concatenate([raw[:2], as_frames([torn()])]), tolerance=TOLERANCE)
    first, *others = result.notes()
    assert first.startswith("registered 3 frames in 2 segments; distance from the raw surface:")
    assert any("does not continue the mesh" in note for note in others)


def test_a_warning_names_what_was_removed(raw):
    *others, last = raw[:2].segments
    flat = last.replace(faces=np.vstack([last.faces, [[0, 1, 1]]]))
    with pytest.warns(UserWarning, match="removed 1 face without area"):
        meshreel.register(meshreel.concatenate([*others, flat]), tolerance="2%")


@pytest.fixture(scope="module")
def with_ball(raw):
    """The raw frames, with a small ball beside the body in one of them."""
    ball, faces = capsule(10, 10)
    first, second, *others = raw.segments
    vertices = np.concatenate([second.vertices[0], 0.06 * ball + [1, 0, 0]])
    faces = np.concatenate([second.faces, faces + second.n_verts])
    second = MeshSequence(vertices[None].astype(np.float32), faces, second.fps)
    return meshreel.concatenate([first, second, *others])


def test_debris_is_removed_unless_it_is_to_be_kept(with_ball):
    result = register(with_ball, tolerance=TOLERANCE)
    assert only_segment(result).vertices[..., 0].max() < 0.9
    (note,) = (change for change in result.changes if "debris" in change)
    assert note.startswith("removed 1 small component that the frames before and after lack (up to")
    assert "% of the surface; frame 1)" in note
    kept = register(with_ball, tolerance=TOLERANCE, keep_debris=True)
    assert kept.sequence[1].vertices[:, 0].max() > 0.9
    assert not any("debris" in change for change in kept.changes)


@pytest.mark.slow
def test_cracks_are_closed(raw):
    """Separate triangles, a fifth of whose corners are off by a thousandth of the tolerance."""
    rng, soups = np.random.default_rng(0), []
    for segment in raw.segments:
        corners = segment.vertices[0][segment.faces.ravel()].astype(np.float64)
        offsets = rng.normal(0.0, 1e-5, corners.shape) * (rng.random(len(corners)) < 0.2)[:, None]
        soups.append((corners + offsets, np.arange(len(corners)).reshape(-1, 3).astype(np.int32)))
    result = register(as_frames(soups), tolerance=TOLERANCE)
    assert only_segment(result).n_verts < raw.segments[0].n_verts
    assert any("within 0.01 tolerances of others" in change for change in result.changes)


def test_tolerances_are_lengths_or_percent(raw):
    result = meshreel.register(raw[:2], tolerance="20mm", unit="m")
    assert result.n_segments == 1
    with pytest.raises(InvalidInputError, match="tolerance takes percent"):
        meshreel.register(raw, tolerance="fine")
    with pytest.raises(InvalidInputError, match="tolerance 5mm is a length"):
        meshreel.register(raw, tolerance="5mm")


@pytest.mark.slow
def test_progress_counts_cleaned_and_registered_frames(raw):
    calls = []
    register(
        raw, tolerance=TOLERANCE, progress=lambda stage, share: calls.append((stage, float(share)))
    )
    assert calls[raw.n_frames - 1] == ("cleaning", 1.0)
    assert calls[-1] == ("registering", 1.0)


def with_values(segment):
    """A raw frame with a height of each vertex, a label and a color of the height."""
    height = segment.vertices[0][:, 2].copy()
    color = np.repeat(np.clip(127.5 * (height + 1), 0, 255)[:, None], 3, axis=1).astype(np.uint8)
    surface = Surface(attributes=(Attribute("color", Kind.COLOR, Domain.VERTEX, color),))
    tracks = {
        "height": Track(height[None], unit="m"),
        "above": (height > 0).astype(np.int32)[None],
        "of faces": Track(np.zeros((1, len(segment.faces))), "face"),
    }
    return MeshSequence(
        segment.vertices, segment.faces, segment.fps, surface=surface, tracks=tracks
    )


def test_values_at_points_are_interpolated_or_those_of_the_nearest_corner():
    vertices, faces = square(n=2)
    x, y, _ = vertices.T
    normals = np.stack([1 + x, 2 * y, 1 - x], axis=1)
    values = {"heat": 1 + x + 2 * y, "byte": np.uint8(100 * x), "label": np.arange(4, dtype="i4")}
    tracks = {name: Track(one[None]) for name, one in values.items()}
    tracks["up"] = Track(normals[None], kind="normal")
    frame = MeshSequence(np.float32(vertices)[None], faces, tracks=tracks)
    raw = RawFrame(frame, clean(frame[0]), TriangleMesh(vertices, faces))
    points = np.random.default_rng(0).random((50, 3)) * [0.3, 0.3, 0] + [0.7, 0, 0]
    found = transferred_tracks([raw], [points])
    x, y, _ = points.T
    np.testing.assert_allclose(found["heat"].values[0, :, 0], 1 + x + 2 * y)
    np.testing.assert_array_equal(found["byte"].values[0, :, 0], np.rint(100 * x))
    assert (found["label"].values == 2).all()
    up = np.stack([1 + x, 2 * y, 1 - x], axis=1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    np.testing.assert_allclose(found["up"].values[0], up)
    quad = frame.replace(surface=Surface(np.array([4], np.int32)), tracks={})
    assert items_at_corners(quad, Domain.FACE).tolist() == [[0, 0, 0]] * 2


@pytest.mark.slow
def test_values_of_raw_vertices_become_tracks(raw):
    result = register(
        meshreel.concatenate([with_values(one) for one in raw.segments]), tolerance=TOLERANCE
    )
    segment = only_segment(result)
    height, above, color = (segment.tracks[name] for name in ("height", "above", "color"))
    z = segment.vertices[..., 2]
    np.testing.assert_allclose(height.values[..., 0], z, atol=0.01)
    is_clear = np.abs(z) > 0.05
    assert np.array_equal(above.values[is_clear][:, 0], z[is_clear] > 0)
    np.testing.assert_allclose(color.values[..., 1], np.clip(127.5 * (z + 1), 0, 255), atol=3)
    assert (height.unit, color.kind, color.dtype) == ("m", "color", np.uint8)
    assert segment.surface.attributes == ()
    (change,) = result.changes
    assert change == "left out tracks that are not on the vertices of all frames: of faces"


@pytest.mark.slow
def test_values_of_frame_files_become_tracks(raw, tmp_path):
    frames = [with_values(one) for one in raw.segments]
    meshreel.save(meshreel.concatenate(frames), tmp_path / "frame_%d.ply")
    (segment,) = meshreel.register(tmp_path, tolerance=0.5).segments
    assert {*segment.tracks} == {"color", "height", "above"}
    assert [attribute.name for attribute in segment.surface.attributes] == ["of_faces"]


@pytest.mark.slow
def test_colors_that_differ_in_type_stay_those_of_the_key(raw):
    first, *others = (with_values(one) for one in raw.segments)
    (color,) = first.surface.attributes
    floats = replace(color, values=(color.values / 255).astype(np.float32))
    first = first.replace(surface=Surface(attributes=(floats,)), tracks={})
    segment = only_segment(register(meshreel.concatenate([first, *others]), tolerance=TOLERANCE))
    assert segment.tracks == {}
    assert [attribute.name for attribute in segment.surface.attributes] == ["color"]


def test_vertices_slide_only_where_nothing_depends_on_their_places(raw, registered):
    def tune(registration, bakes_textures=False, **options):
        notes = Notes()
        tuned = registration.tuned(config_of(**options), notes, bakes_textures=bakes_textures)
        assert bool(notes) == (tuned != config_of(**options))
        return tuned.tune

    for target in ({}, {"quality": 60}, {"size": 5000}):
        assert tune(registered, **target) == "surface"
    assert tune(registered, max_error=0.1) is tune(registered, kg=0.1) is None
    assert tune(registered, tune="visual") == "visual"
    segment = only_segment(registered)
    corners = np.zeros((3 * len(segment.faces), 2), np.float32)
    uv = Attribute("uv", Kind.UV, Domain.CORNER, corners)
    textured = replace(registered, sequence=segment.replace(surface=Surface(attributes=(uv,))))
    assert tune(textured) is None
    assert tune(textured, bakes_textures=True) == "surface"
    colors = np.zeros((segment.n_frames, segment.n_verts, 3), np.float32)
    colored = segment.replace(tracks={"color": Track(colors, Domain.VERTEX)})
    assert tune(replace(registered, sequence=colored)) is None
