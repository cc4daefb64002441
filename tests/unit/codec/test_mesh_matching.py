"""Meshes that are edited or reordered from one segment to the next."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import meshreel
from conformance.sources import boxes, grid, of_type, tetrahedra
from meshreel.codec import mesh_matching
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.mesh_edits import BaseMesh, MeshEdits, find_edit
from meshreel.codec.mesh_matching import FaceIndex, longest_ascending, match_vertices
from meshreel.codec.reordering import without_reordering
from meshreel.model.matching.segments import match_segments
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track, error_bound_of
from samples.commands import run_json
from samples.d3plot import Model, state, write_family
from samples.datasets import positions_of
from samples.ensight import block, case, geometry, part
from samples.meshes import waving_grid
from samples.orders import shuffled

SHEET = grid(40, 50).astype(np.int32)
N_VERTS = 2000


def irregular(n_rows=40, n_columns=50, seed=0):
    """A sheet with diagonals and an order of faces that repeat nowhere."""
    rng = np.random.default_rng(seed)
    low = (np.arange(n_rows - 1)[:, None] * n_columns + np.arange(n_columns - 1)).ravel()
    right, up, far = low + 1, low + n_columns, low + n_columns + 1
    turned = np.stack([low, right, far, low, far, up], axis=1)
    other = np.stack([low, right, up, right, far, up], axis=1)
    chosen = np.where(rng.random(len(low))[:, None] < 0.5, turned, other)
    return chosen.reshape(-1, 3)[rng.permutation(2 * len(low))].astype(np.int32)


def without(faces, n_verts, dropped):
    """Return the faces that have none of these vertices, and the numbers of those in use."""
    kept = faces[~np.isin(faces, dropped).any(axis=1)]
    used, numbers = np.unique(kept, return_inverse=True)
    return numbers.reshape(-1, 3).astype(np.int32), used


def places(n_verts, count, seed=3):
    return np.random.default_rng(seed).choice(n_verts, count, replace=False)


def matched(faces, others, n_verts):
    return match_vertices(FaceIndex(faces, N_VERTS), others, n_verts)


@pytest.mark.parametrize("faces", [SHEET, irregular()], ids=["regular", "irregular"])
@pytest.mark.parametrize("count", [2, 10, 40])
def test_vertices_dropped_in_many_places_are_found(faces, count):
    others, used = without(faces, N_VERTS, places(N_VERTS, count))
    np.testing.assert_array_equal(matched(faces, others, len(used)), used)


@pytest.mark.parametrize("faces", [SHEET, irregular()], ids=["regular", "irregular"])
def test_numbers_may_be_in_any_order_over_the_surface(faces):
    shuffled = np.random.default_rng(1).permutation(N_VERTS)[faces].astype(np.int32)
    others, used = without(shuffled, N_VERTS, places(N_VERTS, 20))
    result = matched(shuffled, others, len(used))
    is_known = result >= 0
    np.testing.assert_array_equal(result[is_known], used[is_known])
    assert is_known.mean() > 0.99


def test_inserted_vertices_have_no_number():
    """The reverse of dropping them, but for gaps that the new vertices do not fill."""
    fewer, used = without(irregular(), N_VERTS, places(N_VERTS, 20))
    result = match_vertices(FaceIndex(fewer, len(used)), irregular(), N_VERTS)
    expected = np.full(N_VERTS, -1)
    expected[used] = np.arange(len(used))
    np.testing.assert_array_equal(result, expected)


def test_vertices_are_dropped_and_inserted_at_once():
    faces = irregular()
    base, used = without(faces, N_VERTS, places(N_VERTS, 10, seed=5))
    others, used_hat = without(faces, N_VERTS, places(N_VERTS, 10, seed=6))
    result = match_vertices(FaceIndex(base, len(used)), others, len(used_hat))
    both = np.isin(used_hat, used)
    expected = np.where(both, np.searchsorted(used, used_hat), -1)
    assert (result == expected).mean() > 0.98
    assert (np.diff(result[result >= 0]) > 0).all()


@pytest.mark.parametrize(
    ("n_components", "dropped"),
    [(2, [30, 400, 401, 990, 1020, 1500, 1970]), (10, range(70, N_VERTS, 203))],
)
def test_components_are_found_apart(n_components, dropped):
    n_rows, n_here = 40 // n_components, N_VERTS // n_components
    parts = [irregular(n_rows, 50, seed=i) + n_here * i for i in range(n_components)]
    faces = np.concatenate(parts)
    others, used = without(faces, N_VERTS, dropped)
    np.testing.assert_array_equal(matched(faces, others, len(used)), used)


@pytest.mark.parametrize(
    "dropped",
    [[3, 400, 1990], [*range(6), 700, *range(N_VERTS - 6, N_VERTS)]],
    ids=["one at each end", "several at each end"],
)
def test_vertices_dropped_at_both_ends_cost_few_others(dropped):
    faces = irregular()
    others, used = without(faces, N_VERTS, dropped)
    assert (matched(faces, others, len(used)) == used).mean() > 0.97


def test_blocks_are_searched_for_only_in_meshes_of_similar_size():
    faces = irregular()
    others, used = without(faces, N_VERTS, [30, 700, 1500])
    degrees = [FaceIndex(faces, N_VERTS).degrees, FaceIndex(others, len(used)).degrees]
    result = mesh_matching._matches_by_degrees(*degrees)
    assert (result == used)[result >= 0].mean() > 0.9
    with patch.object(mesh_matching, "MAX_SHIFTS", 2):
        assert (mesh_matching._matches_by_degrees(*degrees) == -1).all()


@pytest.mark.parametrize(("faces", "others"), [(0, 1), (100, 0), (0, 0)])
def test_a_mesh_without_faces_is_neither_an_edit_nor_a_base(faces, others):
    assert find_edit(BaseMesh(SHEET[:faces], N_VERTS), SHEET[:others], N_VERTS) is None


def test_isolated_vertices_keep_their_places():
    shifted = np.where(SHEET >= 700, SHEET + 2, SHEET)  # 700 and 701 are in no face
    others = shifted[~np.isin(shifted, [100, 1500]).any(axis=1)]
    kept = np.delete(np.arange(N_VERTS + 2), [100, 1500])
    numbers = np.full(N_VERTS + 2, -1)
    numbers[kept] = np.arange(N_VERTS)
    result = match_vertices(FaceIndex(shifted, N_VERTS + 2), numbers[others].astype(np.int32), 2000)
    np.testing.assert_array_equal(result, kept)


def test_repeated_and_degenerate_faces_do_not_confuse():
    faces = irregular()
    odd = np.concatenate([faces, faces[::7], np.repeat(faces[::11, :1], 3, axis=1)])
    odd[5:50:9, 1] = odd[5:50:9, 0]
    others, used = without(odd, N_VERTS, places(N_VERTS, 20))
    np.testing.assert_array_equal(matched(odd, others, len(used)), used)


@pytest.mark.parametrize("faces", [SHEET, irregular()], ids=["regular", "irregular"])
def test_unrelated_meshes_are_refused(faces):
    rng = np.random.default_rng(4)
    numbers = rng.permutation(N_VERTS)
    others = numbers[faces][rng.permutation(len(faces))].astype(np.int32)
    assert matched(faces, others, N_VERTS) is None
    random = rng.integers(0, N_VERTS, faces.shape).astype(np.int32)
    assert matched(faces, random, N_VERTS) is None


@given(st.lists(st.integers(0, 30), max_size=40))
def test_longest_ascending_subsequence_is_longest(numbers):
    selected = np.array(numbers, np.int64)[longest_ascending(np.array(numbers, np.int64))]
    assert (np.diff(selected) > 0).all()
    lengths = []
    for i, number in enumerate(numbers):
        lengths.append(1 + max((lengths[j] for j in range(i) if numbers[j] < number), default=0))
    assert len(selected) == max(lengths, default=0)


@given(st.integers(0, 10**6), st.integers(0, 30), st.integers(0, 30))
@example(seed=14832, n_dropped=6, n_inserted=11)  # two vertices have the same match on the way
def test_numbers_ascend_whatever_is_dropped(seed, n_dropped, n_inserted):
    faces = irregular(12, 15)
    base, used = without(faces, 180, places(180, n_inserted, seed))
    others, used_hat = without(faces, 180, places(180, n_dropped, seed + 1))
    result = match_vertices(FaceIndex(base, len(used)), others, len(used_hat))
    if result is not None:
        assert result.shape == used_hat.shape
        numbered = result[result >= 0]
        assert (np.diff(numbered) > 0).all()
        assert numbered.max(initial=0) < len(used)


def test_a_mesh_that_lost_vertices_in_many_places_is_an_edit():
    faces = irregular()
    others, used = without(faces, N_VERTS, places(N_VERTS, 20))
    result = find_edit(BaseMesh(faces, N_VERTS), others, len(used))
    np.testing.assert_array_equal(result.base_verts, used)
    assert (result.base_faces >= 0).all()
    own = encode_connectivity(others, len(used), order="keep")
    assert len(result.payload) < own.size_bytes / 20


def test_an_edit_that_is_larger_than_half_of_the_mesh_is_the_next_base():
    faces, edits = irregular(), MeshEdits()
    others, used = without(faces, N_VERTS, places(N_VERTS, 20))
    rng = np.random.default_rng(9)
    new = rng.integers(0, len(used), (1500, 3)).astype(np.int32)
    assert edits.edit_to(faces, N_VERTS) is None
    assert edits.edit_to(np.concatenate([others, new[:20]]), len(used)) is not None
    assert edits.edit_to(np.concatenate([others, new]), len(used)) is None


def eroded_quads(n_states):
    """Quads of a sheet of 30 x 30 nodes, and which of them exist in each state."""
    first = (np.arange(29)[:, None] * 30 + np.arange(29)).ravel()[:, None]
    quads = first + np.array([0, 1, 31, 30])
    lost = np.random.default_rng(2).permutation(29 * 29)
    exists = np.ones((n_states, len(quads)), bool)
    for number in range(n_states):
        centers = lost[: 4 * number]
        near = np.isin(quads, quads[centers][:, 0]).any(axis=1)  # all quads at these nodes
        exists[number] = ~near
    nodes = np.stack([np.arange(900) % 30, np.arange(900) // 30, 0 * np.arange(900)], axis=1)
    return nodes.astype(float), quads, exists


def d3plot_of(folder, nodes, quads, exists):
    shells = np.concatenate([quads, np.zeros_like(quads[:, :1])], axis=1)
    model = Model(nodes, shells=shells, control={15: 4, 20: 1, 36: -10_003})
    states = [state(i, nodes * (1 + i / 9), alive) for i, alive in enumerate(exists)]
    return write_family(folder / "d3plot", model, [states])


def ensight_of(folder, nodes, quads, exists):
    for number, alive in enumerate(exists):
        used, numbers = np.unique(quads[alive], return_inverse=True)
        elements = block("<", "quad4", numbers.reshape(-1, 4))
        one = part("<", 1, "sheet", nodes[used] * (1 + number / 9), elements)
        (folder / f"g{3 + 2 * number:03}").write_bytes(geometry("<", one))
    path = folder / "a.case"
    path.write_text(case("1 g***", times=range(len(exists))))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("write", [d3plot_of, ensight_of])
def test_eroded_elements_of_solvers_are_edits(tmp_path, write):
    loaded = meshreel.load(write(tmp_path, *eroded_quads(4)))
    assert loaded.n_segments == 4
    edits, base = MeshEdits(), loaded.segments[0]
    assert edits.edit_to(base.faces, base.n_verts) is None
    for segment in loaded.segments[1:]:
        assert segment.n_verts < base.n_verts
        edit = edits.edit_to(segment.faces, segment.n_verts)
        assert (edit.base_faces >= 0).all()
    data = meshreel.encode(loaded, order="keep")
    for segment, original in zip(meshreel.decode(data).segments, loaded.segments, strict=True):
        np.testing.assert_array_equal(segment.faces, original.faces)


@pytest.mark.slow
def test_eroded_segments_share_their_connectivity():
    faces = irregular()
    frames = np.random.default_rng(0).normal(size=(2, N_VERTS, 3)).astype(np.float32)
    segments, sizes = [], []
    for count in (0, 5, 15, 30):
        others, used = without(faces, N_VERTS, places(N_VERTS, count))
        segments.append(MeshSequence(frames[:, used], others))
        sizes.append(len(meshreel.encode(segments[-1], order="keep")))
    own = encode_connectivity(faces, N_VERTS, order="keep").size_bytes
    assert (
        len(meshreel.encode(MeshSequence.of_segments(segments), order="keep"))
        < sum(sizes) - 2.5 * own
    )


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
    *others, last = in_orders(sequence, *frames).segments
    lossy = last.replace(tracks={"heat": Track(last.tracks["heat"].values, error_bound=0.5)})
    joined = without_reordering(MeshSequence.of_segments([*others, lossy]), "drop")
    [result] = joined.segments
    assert error_bound_of(result.tracks["heat"]) == 0.5
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


def test_meshes_that_repeat_a_face_are_not_matched():
    grid = textured(4, has_uv=False)
    repeated = grid.replace(faces=np.vstack([grid.faces, grid.faces[3:4]]))
    sequence = in_orders(repeated, range(2), range(2, 4))
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


def test_meshes_of_cells_are_not_joined():
    points, hexahedra = boxes(1, 1, 1)
    cells, ids = tetrahedra(points, hexahedra), np.arange(8, dtype=np.float32)[:, None]
    segments = []
    for order in (np.arange(6), np.arange(6)[::-1]):
        one = MeshSequence(points[None].astype(np.float32), cells=of_type(10, cells[order]))
        values = {Domain.VERTEX: ids, Domain.CELL: ids[order]}
        rows = (Attribute("", Kind.OTHER, *item) for item in values.items())
        segments.append(changed(one, attributes=tuple(rows)))
    assert match_segments(segments) == segments
    sequence = MeshSequence.of_segments(segments)
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
