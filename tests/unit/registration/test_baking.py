"""Textures of raw frames, baked into the texture coordinates of their segments."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as PillowImage

import meshreel
from meshreel import (
    FaceGroups,
    Image,
    InvalidInputError,
    Kind,
    Material,
    MeshSequence,
    Surface,
    Texture,
    Track,
)
from meshreel.registration.baking import Atlas, bake, check_textured, sample_image, with_atlases
from meshreel.registration.register import register
from samples.captures import capture, color_at, textured_capture

N_FRAMES, LAST_ANGLE = 4, 0.3
SIZE = (128, 128)
SQUARE = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)


@pytest.fixture(scope="module")
def textured():
    return textured_capture(N_FRAMES, LAST_ANGLE)


@pytest.fixture(scope="module")
def registered(textured):
    return register(textured[0], tolerance=0.5)


def centroid_colors(segment, frame, image):
    """Centroids of the faces of a frame, and their colors in its image."""
    (uv,) = segment.surface.of_kind(Kind.UV)
    centers = uv.per_item().reshape(-1, 3, 2).mean(axis=1).astype(np.float64)
    points = segment.vertices[frame][segment.faces].mean(axis=1)
    return points, sample_image(np.asarray(image), centers).astype(int)


def errors_of(segment, images):
    """Largest error of a channel at the faces on the side of the capsule, of all frames."""
    errors = []
    for frame, angle in enumerate(np.linspace(0, LAST_ANGLE, N_FRAMES)):
        points, colors = centroid_colors(segment, frame, images[frame])
        is_side = np.abs(points[:, 2]) < 0.9  # the angle is singular on the caps
        errors.append(np.abs(colors - color_at(points, angle)).max(axis=1)[is_side])
    return np.concatenate(errors)


def assert_colors(segment, images):
    errors = errors_of(segment, images)
    assert errors.mean() < 3
    assert np.quantile(errors, 0.99) < 15


@pytest.mark.slow
def test_the_texture_moves_with_the_surface(textured, registered):
    ready, n_made = with_atlases(registered, SIZE)
    images = list(bake(ready, ready.sequence, textured[1], SIZE))
    (segment,) = ready.sequence.segments
    assert (n_made, len(images), images[0].size) == (0, N_FRAMES, SIZE)
    assert_colors(segment, images)


def test_colors_do_not_move_with_the_error_of_coding(textured, registered):
    (decoded,) = meshreel.decode(meshreel.encode(registered.sequence, quality=5)).segments
    file = meshreel.MeshSequence.of_segments([decoded])
    followed, moved = (
        errors_of(decoded, list(bake(registered, shown, textured[1], SIZE)))
        for shown in (file, registered.sequence)
    )
    assert followed.mean() < 0.6 * moved.mean()


def test_colors_of_the_key_are_unchanged(textured, registered):
    key = registered.segments[0].key
    image = list(bake(registered, registered.sequence, textured[1], SIZE))[key]
    (segment,) = registered.sequence.segments
    _, baked = centroid_colors(segment, key, image)
    _, given = centroid_colors(segment, key, textured[1][key])
    assert np.abs(baked - given).mean() < 1


def test_texture_coordinates_are_kept_when_triangles_do_not_share_texels(registered):
    ready, n_made = with_atlases(registered, SIZE)
    assert n_made == 0
    assert ready.sequence.segments[0].surface is registered.sequence.segments[0].surface


def test_texture_coordinates_that_overlap_are_replaced(textured, registered):
    (segment,) = registered.sequence.segments
    (uv,) = segment.surface.attributes
    twice = replace(uv, values=uv.values % np.float32(0.3))
    surface = replace(segment.surface, attributes=(twice,), materials=(Material("skin"),))
    sequence = meshreel.MeshSequence.of_segments([segment.replace(surface=surface)])
    ready, n_made = with_atlases(replace(registered, sequence=sequence), SIZE)
    (made,) = ready.sequence.segments
    assert (n_made, made.surface.materials) == (1, ())
    assert len(made.surface.attributes) == 1
    assert_colors(made, list(bake(ready, ready.sequence, textured[1], SIZE)))


@pytest.mark.slow
def test_a_frame_alone_is_baked_too(textured):
    """Its image does not fit between the vertices that its decimated mesh keeps."""
    raw, images = textured
    wide = np.float32([4, 1, 1])
    apart = raw.segments[0].vertices * wide
    sequence = meshreel.concatenate([raw[:2], raw.segments[0].replace(vertices=apart)])
    result = register(sequence, tolerance=2.0)
    ready, n_made = with_atlases(result, SIZE)
    baked = list(bake(ready, ready.sequence, [*images[:2], images[0]], SIZE))
    assert n_made == 0
    assert [segment.n_frames for segment in result.sequence.segments] == [2, 1]
    alone = ready.sequence.segments[1]
    assert alone.n_verts < raw.segments[0].n_verts

    def errors_in(image):
        points, colors = centroid_colors(alone, 0, image)
        is_side = abs(points[:, 2]) < 0.9
        return np.abs(colors - color_at(points / wide, 0.0)).max(axis=1)[is_side]

    errors = errors_in(baked[2])
    assert errors.mean() < 0.8 * errors_in(images[0]).mean()
    assert errors.mean() < 3
    assert np.quantile(errors, 0.99) < 15


@pytest.mark.slow
def test_texture_coordinates_may_change_while_the_faces_do_not(textured):
    raw, images = textured
    (first,), (uv,) = raw.segments[:1], raw.segments[0].surface.attributes
    moved = np.stack([uv.per_item(), uv.per_item() * np.float32(0.5)])
    twice = np.repeat(first.vertices, 2, axis=0)
    both = MeshSequence(twice, first.faces, 25.0, tracks={"uv": Track(moved, "corner", "uv")})
    sequence = meshreel.concatenate([both, raw[1:]])
    check_textured(sequence)
    half = PillowImage.new("RGB", (256, 256))
    half.paste(images[0], (0, 128))
    ready, n_made = with_atlases(register(sequence, tolerance=0.5), SIZE)
    baked = list(bake(ready, ready.sequence, [images[0], half, *images[1:]], SIZE))
    assert n_made == 0
    assert np.abs(np.asarray(baked[0], int) - np.asarray(baked[1], int)).mean() < 2
    assert ready.changes == ()


def test_too_few_images_are_an_error(textured, registered):
    with pytest.raises(InvalidInputError, match="no texture image for frame 3"):
        list(bake(registered, registered.sequence, textured[1][:3], SIZE))


def test_frames_without_texture_coordinates_are_an_error(textured):
    sequence = meshreel.concatenate([textured[0], capture(1)])
    with pytest.raises(InvalidInputError, match="frame 4 has no texture coordinates"):
        check_textured(sequence)


@pytest.mark.parametrize("n_used", [1, 2])
def test_frames_whose_faces_have_several_images_are_an_error(textured, n_used):
    raw, _ = textured
    first = raw.segments[0]
    numbers = np.arange(len(first.faces), dtype=np.int32) % n_used
    surface = replace(
        first.surface,
        groups=(FaceGroups("material", ("skin", "cloth"), numbers),),
        materials=tuple(
            Material(name, base_color_texture=Texture(image))
            for image, name in enumerate(["skin", "cloth"])
        ),
        images=(Image("skin", "image/png", b"1"), Image("cloth", "image/png", b"2")),
    )
    sequence = meshreel.concatenate([raw[:1], first.replace(surface=surface)])
    if n_used == 1:
        check_textured(sequence)
        return
    with pytest.raises(InvalidInputError, match=r"frame 1 have 2 color images.*combine"):
        check_textured(sequence)


def test_an_atlas_places_texels_on_triangles():
    atlas = Atlas.of_corners(SQUARE * 0.5, (8, 6))
    assert len(atlas.faces) == 4 * 3  # the lower left quarter of the image
    places = np.einsum("nk,nkc->nc", atlas.weights, SQUARE[atlas.faces] * 0.5)
    expected = [[(x + 0.5) / 8, (y + 0.5) / 6] for y in range(3) for x in range(4)]
    result = sorted(map(tuple, np.round(places, 6)), key=lambda item: (item[1], item[0]))
    np.testing.assert_allclose(result, expected, atol=1e-6)


def test_texels_outside_take_the_nearest_color():
    atlas = Atlas.of_corners(SQUARE * 0.5, (8, 8))
    places = np.einsum("nk,nkc->nc", atlas.weights, SQUARE[atlas.faces] * 0.5)[atlas.nearest]
    np.testing.assert_allclose(places[0, 0], [0.5 / 8, 3.5 / 8], atol=1e-6)  # up: row 0 is v = 1
    np.testing.assert_allclose(places[7, 7], [3.5 / 8, 0.5 / 8], atol=1e-6)


def test_images_are_interpolated_and_repeat():
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[1, 1] = (200, 0, 0), (0, 100, 0)
    uv = np.array([[0.25, 0.75], [0.5, 0.75], [0.75, 0.25], [0, 0.75], [1.25, -0.25]])
    colors = sample_image(pixels, uv)
    expected = [[200, 0, 0], [100, 0, 0], [0, 100, 0], [100, 0, 0], [200, 0, 0]]
    assert colors.tolist() == expected


def test_charts_are_made_for_keys_with_more_vertices_than_their_frame(textured, registered):
    (segment,) = registered.sequence.segments
    (a, b, c), center = segment.faces[0], segment.n_verts
    faces = np.vstack([segment.faces[1:], [[a, b, center], [b, c, center], [c, a, center]]])
    centers = segment.vertices[:, [a, b, c]].mean(axis=1, keepdims=True)
    vertices = np.concatenate([segment.vertices, centers], axis=1)
    split = segment.replace(vertices=vertices, faces=faces, surface=Surface())
    sequence = meshreel.MeshSequence.of_segments([split])
    ready, n_made = with_atlases(replace(registered, sequence=sequence), SIZE)
    assert n_made == 1
    images = list(bake(ready, ready.sequence, textured[1], SIZE))
    assert_colors(ready.sequence.segments[0], images)
