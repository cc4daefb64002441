"""Streams of cells: what comes back, and what it takes."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from scipy.spatial import Delaunay

import meshreel
from conformance.sources import boxes, mixed_cells, of_type, shuffled_cells, tetrahedra, waving
from meshreel import Cells, InvalidInputError, MeshSequence, Track
from meshreel.kernel.cells import cell_sizes, encode_cells


def rows_of(cells):
    """Return the type and nodes of each cell."""
    starts = np.cumsum(cell_sizes()[cells.types])[:-1]
    return list(zip(cells.types.tolist(), map(tuple, np.split(cells.nodes, starts)), strict=True))


@pytest.mark.parametrize("is_shuffled", [False, True])
def test_order_and_values_are_kept(is_shuffled):
    points, hexahedra = boxes(5, 4, 3)
    points, hexahedra = shuffled_cells(points, hexahedra) if is_shuffled else (points, hexahedra)
    vertices = waving(points)
    stress = vertices[:, hexahedra].mean(axis=2)[..., 0]
    tracks = {"stress": stress, "exact": np.arange(300).reshape(5, 60)}
    given = MeshSequence(vertices, cells=of_type(12, hexahedra), tracks=tracks)
    found = meshreel.decode(meshreel.encode(given, max_error="0.1%"))
    assert rows_of(found.surface.cells) == rows_of(given.surface.cells)
    np.testing.assert_array_equal(found.faces, given.faces)
    np.testing.assert_array_equal(found.tracks["exact"].values[..., 0], tracks["exact"])
    assert np.abs(found.tracks["stress"].values[..., 0] - stress).max() <= 0.001 * np.ptp(stress)
    assert meshreel.compare(given, found).max_error_percent <= 0.1


def test_cells_of_a_dropped_order_are_the_same_up_to_it():
    given = MeshSequence(waving(np.random.default_rng(1).random((64, 3))), cells=mixed_cells())
    data = meshreel.encode(given, max_error="0.1%", order="drop")
    found = meshreel.decode(data)
    # Nodes are matched by their positions.
    distances = np.linalg.norm(found.vertices[0][:, None] - given.vertices[0], axis=2)
    numbers = distances.argmin(axis=1)
    assert sorted(numbers) == list(range(64))
    renumbered = Cells(found.surface.cells.types, numbers[found.surface.cells.nodes])
    assert sorted(rows_of(renumbered)) == sorted(rows_of(given.surface.cells))
    assert meshreel.compare(given, data).max_error_percent <= 0.1


@pytest.mark.parametrize("stress_bound", ["0.1%", "exact"])
def test_values_of_cells_follow_them_where_the_order_is_dropped(stress_bound):
    points = np.random.default_rng(4).random((60, 3))
    tetrahedra = Delaunay(points).simplices
    vertices = waving(points)
    stress = vertices[:, tetrahedra].mean(axis=2)[..., 0]
    given = MeshSequence(
        vertices, cells=of_type(10, tetrahedra), tracks={"stress": Track(stress, "cell")}
    )
    data = meshreel.encode(
        given, max_error="0.01%", order="drop", tracks={"stress": stress_bound}, block_frames=2
    )
    found = meshreel.decode(data)
    assert not np.array_equal(found.surface.cells.nodes, given.surface.cells.nodes)
    nodes = found.surface.cells.nodes.reshape(-1, 4)
    expected = found.vertices[:, nodes].mean(axis=2)[..., 0]
    assert np.abs(found.tracks["stress"].values[..., 0] - expected).max() <= 0.002 * np.ptp(stress)
    compared = meshreel.compare(given, data)
    assert compared.tracks["stress"].largest <= 0.001 * np.ptp(stress)


def test_recordings_store_cells():
    points, hexahedra = boxes(3, 3, 3)
    given = MeshSequence(waving(points), cells=of_type(12, hexahedra))
    file = BytesIO()
    with meshreel.Encoder(given.surface.cells, file, max_error="0.1%") as encoder:
        for frame in given.vertices:
            encoder.push(frame, {"load": frame[hexahedra].mean(axis=1)[:, 0]})
            assert encoder.n_segments == 1
    found = meshreel.decode(file.getvalue())
    assert rows_of(found.surface.cells) == rows_of(given.surface.cells)
    assert found.tracks["load"].domain == "cell"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "pca-qp"}, "stores faces, and the mesh has cells; use reel or lossless"),
        ({"order": "vertices"}, "is keep or drop; got 'vertices'"),
    ],
)
def test_options_that_cells_do_not_allow_are_errors(options, message):
    points, hexahedra = boxes(2, 2, 2)
    given = MeshSequence(waving(points), cells=of_type(12, hexahedra))
    with pytest.raises(InvalidInputError, match=message):
        meshreel.encode(given, **options)


def test_values_of_faces_need_the_order_of_cells():
    points, hexahedra = boxes(2, 2, 2)
    given = MeshSequence(waving(points), cells=of_type(12, hexahedra))
    groups = meshreel.FaceGroups("material", ("a",), np.zeros(24, np.int32))
    given = given.replace(surface=replace(given.surface, groups=(groups,)))
    with pytest.raises(InvalidInputError, match="material need the order of cells"):
        meshreel.encode(given, order="drop")


def test_a_regular_block_of_hexahedra_takes_less_than_a_kilobyte():
    cells = of_type(12, boxes(60, 16, 16)[1])
    assert len(encode_cells(cells.types, cells.nodes, 61 * 17 * 17, listed=True).data) < 1000


def test_tetrahedra_take_less_than_five_bits():
    points, hexahedra = boxes(12, 12, 12)
    points = points + np.random.default_rng(5).normal(scale=0.15, size=points.shape)
    cells = of_type(10, Delaunay(points).simplices)
    data = encode_cells(cells.types, cells.nodes, len(points), listed=False).data
    assert 8 * len(data) < 5 * cells.n_cells
    regular = of_type(10, tetrahedra(points, hexahedra))
    data = encode_cells(regular.types, regular.nodes, len(points), listed=True).data
    assert 8 * len(data) < regular.n_cells


def test_info_counts_cells_as_connectivity():
    points, hexahedra = boxes(4, 4, 4)
    given = MeshSequence(waving(points), cells=of_type(12, hexahedra))
    assert meshreel.info(meshreel.encode(given)).part_bytes["connectivity"] > 20
