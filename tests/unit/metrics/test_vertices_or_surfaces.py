"""Selection between vertex and surface comparison by `meshreel.compare`."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from samples.meshes import waving_grid
from samples.orders import shuffled
from samples.shapes import split_at_centroids

pytestmark = pytest.mark.usefixtures("few_grid_lines")


@pytest.fixture
def sheet():
    return waving_grid(3)


def with_faces(sequence, faces):
    return meshreel.MeshSequence(sequence.vertices, faces)


def split(sequence):
    frames = [split_at_centroids(frame, sequence.faces) for frame in sequence.vertices]
    return meshreel.MeshSequence(
        np.stack([frame for frame, _ in frames]), frames[0][1], sequence.fps
    )


def test_vertices_are_compared_if_only_the_order_of_faces_differs(sheet):
    other = with_faces(sheet, np.roll(sheet.faces[::-1], 1, axis=1))
    assert isinstance(meshreel.compare(sheet, other), meshreel.Quality)


def test_surfaces_are_compared_if_vertex_counts_differ(sheet):
    quality = meshreel.compare(sheet, split(sheet), n_samples=2000)
    assert quality.reason == "the vertex counts differ (99 and 259)"
    assert quality.worse.max_percent == pytest.approx(0, abs=1e-4)  # float32


def test_surfaces_are_compared_if_face_counts_differ(sheet):
    quality = meshreel.compare(sheet, with_faces(sheet, sheet.faces[1:]), n_samples=2000)
    assert quality.reason == "the face counts differ (160 and 159)"
    assert quality.to_decoded.max_percent > 1
    assert quality.to_original.max_percent == 0


@pytest.mark.parametrize("is_swapped", [False, True])
def test_surfaces_are_compared_if_one_sequence_has_segments(sheet, is_swapped):
    segments = meshreel.MeshSequence.of_segments([sheet[:1], split(sheet)[1:]])
    pair = (segments, sheet) if is_swapped else (sheet, segments)
    quality = meshreel.compare(*pair, n_samples=2000)
    assert quality.reason == "the faces change over time"
    assert quality.worse.max_percent == pytest.approx(0, abs=1e-4)  # float32


@pytest.mark.slow
def test_surfaces_are_compared_if_faces_differ(sheet):
    quality = meshreel.compare(sheet, with_faces(sheet, sheet.faces[:, ::-1]))
    assert quality.reason == "the faces differ"
    assert quality.worse.max_percent == 0
    assert quality.worse.normal_angle_mean_deg == pytest.approx(180)


def test_surfaces_of_the_same_mesh_are_compared_on_request(sheet):
    data = meshreel.encode(sheet, max_error=0.5)
    quality = meshreel.compare(sheet, data, surface=True, n_samples=500)
    assert (quality.reason, quality.n_samples) == ("requested", 500)
    # A point of a triangle moves no farther than the corners.
    assert 0 < quality.worse.max_percent <= meshreel.compare(sheet, data).max_error_percent


SHEET = waving_grid(3)
SEGMENTS = meshreel.MeshSequence.of_segments([split(SHEET), SHEET])


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("original", "other", "options", "message"),
    [
        (SHEET, split(SHEET), {"surface": False}, "only sequences of the same mesh"),
        (SHEET, SHEET, {"n_samples": 100}, r"n_samples has no effect .* surface=True"),
        (SEGMENTS, SEGMENTS, {"surface": False}, "same faces in every frame"),
        (SHEET, split(waving_grid(2)), {}, "3 frames and the decoded 2"),
    ],
)
def test_comparison_that_is_not_defined_is_rejected(original, other, options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.compare(original, other, **options)


@pytest.mark.slow
def test_surfaces_of_segments_are_compared_frame_by_frame(sheet):
    others = meshreel.MeshSequence.of_segments([sheet, split(sheet)])
    quality = meshreel.compare(SEGMENTS, others, n_samples=2000)
    assert (quality.reason, quality.n_frames) == ("the faces change over time", 6)
    assert quality.worse.max_percent == pytest.approx(0, abs=1e-4)  # float32


def test_surface_quality_as_a_dict_is_serializable(sheet):
    plain = meshreel.compare(sheet, with_faces(sheet, sheet.faces[1:]), n_samples=99).as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["to_decoded"]["mean_percent"] > 0
    assert len(plain["max_percent_of_frames"]) == plain["n_frames"] == 3


def test_repr_of_surface_quality_contains_its_figures(sheet):
    text = repr(meshreel.compare(sheet, sheet, surface=True, n_samples=10))
    assert text == (
        "<SurfaceQuality: mean distance 0 %, largest 0 %, surface PSNR inf dB, D1 inf dB, "
        "D2 inf dB; 3 frames>"
    )


def in_another_order(sheet, seed=3):
    """Return a sheet whose vertices and faces have a random order, with a track of vertices."""
    heights = {"height": sheet.vertices[..., 2].copy()}
    return shuffled(sheet.replace(fps=25, tracks=heights), seed)


def test_vertices_of_a_stream_without_its_order_are_matched(sheet):
    original = in_another_order(sheet)
    data = meshreel.encode(original, max_error=0.5, order="drop")
    kept = meshreel.encode(original, max_error=0.5)
    quality, expected = meshreel.compare(original, data), meshreel.compare(original, kept)
    assert isinstance(quality, meshreel.Quality)
    assert 0 < quality.max_error_percent <= 0.5
    assert quality.max_error_percent == pytest.approx(expected.max_error_percent, rel=1e-6)
    assert quality.tracks["height"].largest <= 0.05


def test_a_mesh_with_another_order_of_vertices_is_compared_by_its_surface(sheet):
    quality = meshreel.compare(
        in_another_order(sheet, 3), in_another_order(sheet, 4), n_samples=2000
    )
    assert quality.reason == "the faces differ"
    assert quality.vertex_errors is None
    assert quality.worse.max_percent == pytest.approx(0, abs=1e-4)  # float32


@pytest.mark.slow
@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_vertices_of_segments_are_compared_as_well_as_surfaces(sheet, order):
    segments = [in_another_order(sheet), in_another_order(waving_grid(2, 5, 6))]
    sequence = meshreel.MeshSequence.of_segments(segments)
    data = meshreel.encode(sequence, max_error=0.5, order=order)
    quality = meshreel.compare(sequence, data, n_samples=200)
    assert quality.reason == "the faces change over time"
    assert 0 < quality.vertex_errors.max_error_percent <= 0.5
    assert quality.worse.max_percent <= quality.vertex_errors.max_error_percent
    assert json.loads(json.dumps(quality.as_dict()))["vertex_errors"]["kg_error_percent"] > 0


def test_vertices_of_other_segments_are_not_compared(sheet):
    others = meshreel.MeshSequence.of_segments([sheet, split(sheet)])
    assert meshreel.compare(SEGMENTS, others, n_samples=200).vertex_errors is None
