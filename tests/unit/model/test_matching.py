"""Frames in another order of vertices and faces, as codecs of single frames write them."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.matching.segments import match_segments
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track
from samples.meshes import octahedron_faces, waving_grid
from samples.orders import shuffled

SHEET = waving_grid(6)
RNG = np.random.default_rng(8)


def corner_uvs(faces, n_values=None):
    """Texture coordinates of each corner, split along every tenth face."""
    uvs = RNG.random((int(faces.max()) + 1, 2)).astype(np.float32)
    values = uvs[faces].copy()
    values[::10] += 2
    if n_values is not None:
        values = np.floor(values * n_values) / np.float32(n_values)
    return Attribute("uv", Kind.UV, Domain.CORNER, values.reshape(-1, 2).astype(np.float32))


def surface_of(faces, n_values=None, **more):
    return Surface(attributes=(corner_uvs(faces, n_values),), **more)


def frame_in_another_order(sequence, number, seed):
    return shuffled(sequence.replace(vertices=sequence.vertices[number : number + 1]), seed)


def frames_of(sequence):
    return [frame_in_another_order(sequence, number, number) for number in range(sequence.n_frames)]


def triangles(segment, number):
    """Positions and attributes of all faces with area, in an order that is theirs alone."""
    points = segment.vertices[number].astype(np.float64)[segment.faces]
    columns = [points]
    for attribute in segment.surface.attributes:
        of_corners = {
            Domain.CORNER: lambda values: values.reshape(-1, 3, values.shape[1]),
            Domain.VERTEX: lambda values: values[segment.faces],
            Domain.FACE: lambda values: np.repeat(values[:, None], 3, axis=1),
        }[attribute.domain]
        columns.append(of_corners(attribute.per_item()))
    columns += [
        np.repeat(group.numbers[:, None, None], 3, axis=1) for group in segment.surface.groups
    ]
    rows = np.concatenate(columns, axis=2)
    a, b, c = points.transpose(1, 0, 2)
    rows = rows[((a != b).any(1)) & ((b != c).any(1)) & ((c != a).any(1))]
    turns = [np.roll(rows, -turn, axis=1).reshape(len(rows), -1) for turn in range(3)]
    lowest = [min(row.tolist() for row in three) for three in zip(*turns, strict=True)]
    return sorted(lowest)


def assert_same_surfaces(matched, given):
    frames = [(one, number) for one in matched for number in range(one.n_frames)]
    originals = [(one, number) for one in given for number in range(one.n_frames)]
    for results, original in zip(frames, originals, strict=True):
        assert triangles(*results) == triangles(*original)


def test_frames_in_another_order_become_one_segment():
    given = frames_of(SHEET.replace(surface=surface_of(SHEET.faces)))
    (matched,) = results = match_segments(given)
    assert (matched.n_frames, matched.n_verts, len(matched.faces)) == (6, 99, len(SHEET.faces))
    assert not matched.surface.is_ordered
    assert_same_surfaces(results, given)


@pytest.mark.parametrize("n_values", [1, 2, 8])
def test_equal_texture_coordinates_are_told_apart_by_their_neighbors(n_values):
    given = frames_of(SHEET.replace(surface=surface_of(SHEET.faces, n_values)))
    results = match_segments(given)
    assert_same_surfaces(results, given)
    if n_values == 8:
        assert [result.n_verts for result in results] == [99]


def collapsed(sequence):
    """Frames that each lack the faces at an edge whose ends are at one point."""
    result = []
    for number in range(sequence.n_frames):
        ends = sequence.faces[43 + 3 * number, :2]
        vertices = sequence.vertices.copy()
        vertices[number, ends[0]] = vertices[number, ends[1]]
        has_area = np.isin(sequence.faces, ends).sum(axis=1) < 2
        uvs = sequence.surface.attributes[0]
        values = uvs.values.reshape(-1, 3, 2)[has_area].reshape(-1, 2)
        surface = Surface(attributes=(replace(uvs, values=values),))
        frame = sequence.replace(vertices=vertices, faces=sequence.faces[has_area], surface=surface)
        result.append(frame_in_another_order(frame, number, number))
    return result


def test_faces_without_area_that_single_frames_lack_are_added():
    given = collapsed(SHEET.replace(surface=surface_of(SHEET.faces)))
    assert {len(one.faces) for one in given} == {len(SHEET.faces) - 2}
    (matched,) = results = match_segments(given)
    assert len(matched.faces) == len(SHEET.faces)
    assert_same_surfaces(results, given)


def test_frame_without_a_face_with_area_begins_a_segment():
    given = frames_of(SHEET.replace(surface=surface_of(SHEET.faces, 8)))
    cut = given[3]
    uvs = cut.surface.attributes[0]
    surface = Surface(attributes=(replace(uvs, values=uvs.values[3:]),))
    given[3] = MeshSequence(cut.vertices, cut.faces[1:], surface=surface)
    results = match_segments(given)
    assert len(results) > 1
    assert_same_surfaces(results, given)


def everything():
    faces = SHEET.faces
    colors = Attribute("color", Kind.COLOR, Domain.VERTEX, RNG.random((99, 4)).astype(np.float32))
    labels = Attribute(
        "label", Kind.OTHER, Domain.FACE, np.arange(len(faces), dtype=np.int32)[:, None] // 3
    )
    groups = FaceGroups("material", ("a", "b"), (np.arange(len(faces)) % 2).astype(np.int32))
    hard = shared_edges(np.full(len(faces), 3), faces.ravel()).ends[20:25].astype(np.int32)
    return surface_of(faces, groups=(groups,), hard_edges=hard), (colors, labels)


def test_attributes_groups_and_hard_edges_are_kept():
    surface, more = everything()
    surface = replace(surface, attributes=(*surface.attributes, *more))
    given = frames_of(SHEET.replace(surface=surface))
    (matched,) = results = match_segments(given)
    assert_same_surfaces(results, given)
    ends = [
        np.sort(one.vertices[0][one.surface.hard_edges].reshape(-1, 6), axis=0)
        for one in (matched, given[0])
    ]
    assert len(matched.surface.hard_edges) == 5
    assert np.unique(ends[0]).tolist() == np.unique(ends[1]).tolist()


def other_color(surface):
    values = surface.attributes[0].values + np.float32(0.5)
    return replace(surface, attributes=(replace(surface.attributes[0], values=values),))


def other_hard_edges(surface):
    return replace(surface, hard_edges=surface.hard_edges[1:])


@pytest.mark.parametrize("change", [other_color, other_hard_edges])
def test_frames_of_other_surfaces_are_not_joined(change):
    given = frames_of(SHEET.replace(surface=everything()[0]))[:2]
    given[1] = given[1].replace(surface=change(given[1].surface))
    assert match_segments(given) == given


def test_meshes_at_rest_are_matched_by_positions():
    still = SHEET.replace(vertices=np.repeat(SHEET.vertices[:1], 3, axis=0))
    (matched,) = match_segments(frames_of(still))
    frames = matched.read(0, 3)
    assert (frames == frames[:1]).all()
    given = frames_of(SHEET)
    assert match_segments(given) == given


def test_tracks_polygons_and_unused_vertices_are_left_alone():
    surface = surface_of(SHEET.faces)
    given = frames_of(SHEET.replace(surface=surface))[:2]
    heat = Track(np.ones((1, 99), np.float32))
    with_tracks = [one.replace(tracks={"heat": heat}) for one in given]
    assert match_segments(with_tracks) == with_tracks
    unused = [
        MeshSequence(
            np.concatenate([one.vertices, one.vertices[:, :1]], axis=1),
            one.faces,
            surface=one.surface,
        )
        for one in given
    ]
    assert match_segments(unused) == unused


def test_segments_of_several_frames_and_other_meshes_are_joined_where_they_match():
    sheet = SHEET.replace(surface=surface_of(SHEET.faces))
    box = MeshSequence(
        RNG.random((1, 6, 3)).astype(np.float32),
        octahedron_faces(),
        surface=surface_of(octahedron_faces()),
    )
    long = sheet.replace(vertices=sheet.vertices[:3])
    given = [long, *frames_of(sheet)[3:5], box, *frames_of(sheet)[4:]]
    counts = []

    def progress(stage, share):
        counts.append((stage, share.done))

    results = match_segments(given, progress)
    assert [result.n_frames for result in results] == [5, 1, 2]
    assert_same_surfaces(results, given)
    assert counts == [("matching", number) for number in range(1, 7)]


def with_speck(sequence, number):
    """A frame with a further component of two faces, which takes 0.01 % of its width."""
    corner = sequence.vertices[number, 40] + np.float32(0.01)
    speck = corner + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32) * 1e-4
    more = sequence.n_verts + np.array([[0, 1, 2], [2, 1, 3]])
    faces = np.concatenate([sequence.faces, more])
    uvs = sequence.surface.attributes[0]
    values = np.concatenate([uvs.values, np.full((6, 2), 0.25, np.float32)])
    vertices = np.concatenate([sequence.vertices[number], speck])[None]
    return MeshSequence(vertices, faces, surface=Surface(attributes=(replace(uvs, values=values),)))


def test_component_that_single_frames_lack_is_a_point_there():
    sheet = SHEET.replace(surface=surface_of(SHEET.faces))
    given = frames_of(sheet)
    for number in (1, 2, 4):
        given[number] = shuffled(with_speck(sheet, number), number)
    (matched,) = results = match_segments(given)
    assert len(matched.faces) == len(SHEET.faces) + 2
    assert_same_surfaces(results, given)
    own = matched.faces[: len(SHEET.faces)]  # faces that the first frame lacks follow its own
    np.testing.assert_array_equal(
        matched.read(0, 1)[0][own], given[0].read(0, 1)[0][given[0].faces]
    )


def test_face_that_coincides_with_another_may_be_missing():
    sheet = SHEET.replace(surface=surface_of(SHEET.faces))
    uvs = sheet.surface.attributes[0]
    values = np.concatenate([uvs.values, uvs.values[:3]])
    doubled = sheet.replace(
        faces=np.concatenate([sheet.faces, sheet.faces[:1]]),
        surface=Surface(attributes=(replace(uvs, values=values),)),
    )
    (matched,) = match_segments(
        [frame_in_another_order(doubled, 0, 1), frame_in_another_order(sheet, 1, 2)]
    )
    assert (matched.n_verts, len(matched.faces)) == (99, len(SHEET.faces) + 1)


@pytest.mark.slow
def test_faces_that_are_each_missing_somewhere_leave_nothing_to_match_by():
    faces = np.tile(np.array([[0, 1, 2]]), (60, 1)) + 3 * np.arange(60)[:, None]
    uvs = Attribute("uv", Kind.UV, Domain.CORNER, RNG.random((180, 2)).astype(np.float32))
    every = MeshSequence(RNG.random((1, 180, 3)), faces, surface=Surface(attributes=(uvs,)))
    given = []
    for missing in range(60):
        kept = np.delete(np.arange(60), missing)
        values = uvs.values.reshape(60, 6)[kept].reshape(-1, 2)
        surface = Surface(attributes=(replace(uvs, values=values),))
        vertices = every.vertices[:, faces[kept].ravel()]
        given.append(MeshSequence(vertices, np.arange(177).reshape(-1, 3), surface=surface))
    assert_same_surfaces(match_segments(given), given)
