"""Frames of one mesh whose vertices and faces have another order in each segment."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.codec.reordering import without_reordering
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track
from samples.commands import run_json
from samples.datasets import positions_of
from samples.meshes import waving_grid
from samples.orders import shuffled


def textured(n_frames=6, *, has_uv=True):
    """Return a grid, which a half turn maps to itself, with data of each domain."""
    grid = waving_grid(n_frames, 7, 8)
    rng = np.random.default_rng(1)
    n_faces = len(grid.faces)
    corner_uv = rng.random((3 * n_faces, 2), np.float32)
    attributes = (
        Attribute("map", Kind.UV, Domain.VERTEX, grid.vertices[0, :, :2].copy()),
        Attribute("seams", Kind.UV, Domain.CORNER, corner_uv),
        Attribute("weight", Kind.OTHER, Domain.FACE, rng.random((n_faces, 1), np.float32)),
    )
    groups = (FaceGroups("material", ("skin", "cloth"), np.arange(n_faces, dtype=np.int32) % 2),)
    surface = Surface(attributes=attributes, groups=groups) if has_uv else Surface()
    heat = rng.random((n_frames, grid.n_verts)).astype(np.float32)
    return grid.replace(fps=25, surface=surface, tracks={"heat": Track(heat)})


def in_orders(sequence, *frames):
    """Return ranges of the frames of a sequence, each in its own order, as segments."""
    whole = meshreel.MeshSequence.of_segments([sequence])
    parts = [whole.part(frame).segments[0] for frame in frames]
    return meshreel.MeshSequence.of_segments(
        [shuffled(part, seed) for seed, part in enumerate(parts)]
    )


def test_segments_in_another_order_are_joined_exactly():
    sequence = textured()
    frames = range(2), range(2, 3), range(3, 6)
    joined = without_reordering(in_orders(sequence, *frames), "drop")
    [result] = joined.segments
    expected = shuffled(sequence, 0)  # the order of the first segment
    np.testing.assert_array_equal(result.faces, expected.faces)
    np.testing.assert_array_equal(positions_of(result), expected.vertices)
    heat = result.tracks["heat"].read(0, result.n_frames)
    np.testing.assert_array_equal(heat, expected.tracks["heat"].values)


def test_irregular_faces_alone_prove_the_order():
    grid = textured(4, has_uv=False)
    notched = grid.replace(faces=np.delete(grid.faces, [3, 40], axis=0))
    joined = without_reordering(in_orders(notched, range(2), range(2, 4)), "drop")
    [result] = joined.segments
    np.testing.assert_array_equal(positions_of(result), shuffled(notched, 0).vertices)


def test_positions_of_a_mesh_at_rest_prove_the_order():
    grid = textured(2, has_uv=False)
    still = grid.replace(vertices=grid.vertices[[0, 0]])
    [result] = without_reordering(in_orders(still, range(1), range(1, 2)), "drop").segments
    np.testing.assert_array_equal(positions_of(result), shuffled(still, 0).vertices)


def test_symmetric_meshes_without_other_data_are_not_matched():
    sequence = in_orders(textured(4, has_uv=False), range(2), range(2, 4))
    assert without_reordering(sequence, "drop") is sequence


@pytest.mark.parametrize("order", ["keep", "vertices"])
def test_an_order_that_is_kept_separates_segments(order):
    sequence = in_orders(textured(), range(2), range(2, 6))
    assert without_reordering(sequence, order) is sequence


def changed(sequence, **changes):
    surface = replace(sequence.surface, **changes)
    return sequence.replace(surface=surface)


@pytest.mark.parametrize(
    "change",
    [
        lambda item: item,  # equal meshes, which a caller separated
        lambda item: shuffled(changed(item, attributes=item.surface.attributes[:2]), 3),
        lambda item: shuffled(changed(item, groups=()), 3),
        lambda item: shuffled(
            changed(item, groups=(replace(item.surface.groups[0], labels=("a", "b")),)), 3
        ),
        lambda item: shuffled(
            changed(
                item,
                attributes=(
                    *item.surface.attributes[:2],
                    replace(
                        item.surface.attributes[2], values=item.surface.attributes[2].values[::-1]
                    ),
                ),
            ),
            3,
        ),
        lambda item: shuffled(item.replace(tracks={}), 3),
        lambda item: shuffled(item.replace(faces=item.faces[:, ::-1]), 3),
        lambda item: shuffled(item.replace(faces=item.faces[:-1], surface=Surface()), 3),
    ],
)
def test_other_meshes_and_data_are_not_joined(change):
    sequence = meshreel.MeshSequence.of_segments([textured(), change(textured())])
    assert without_reordering(sequence, "drop") is sequence


@pytest.mark.slow
def test_streams_of_reordered_frames_have_one_segment_and_keep_their_bound():
    plain = textured(12).replace(tracks={})
    sequence = in_orders(plain, *(range(n, n + 1) for n in range(12)))
    data = meshreel.encode(sequence, max_error=0.1, order="drop")
    decoded = meshreel.decode(data)
    assert (decoded.n_segments, decoded.n_frames) == (1, 12)
    assert len(data) < 0.5 * len(meshreel.encode(sequence, max_error=0.1))
    quality = meshreel.compare(sequence, data)
    assert isinstance(quality, meshreel.Quality)
    assert 0 < quality.max_error_percent <= 0.1


def test_encode_states_that_segments_of_files_were_joined(tmp_path):
    plain = textured(4)
    names = []
    for seed, segment in enumerate(in_orders(plain, range(2), range(2, 4)).segments):
        meshreel.save(segment.replace(tracks={}), tmp_path / "frames" / f"{'ab'[seed]}_%d.ply")
        names.append(segment.name)
    figures = run_json("encode", tmp_path / "frames", "-o", tmp_path / "a.reel", "--order", "drop")
    assert figures["n_segments"] == 1
    assert any("matched 2 segments" in note for note in figures["notes"])
    assert 0 < figures["max_error_percent"] < 1
