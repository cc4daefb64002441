"""Small, deterministic meshes and animations shared by tests."""

from dataclasses import replace

import numpy as np

from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.kernel.polygons import triangulate
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface


def grid_faces(rows, columns):
    """Return the triangles of a grid of rows x columns vertices."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = corner + columns
    return np.concatenate(
        [np.stack([corner, below, corner + 1], 1), np.stack([corner + 1, below, below + 1], 1)]
    ).astype(np.int32)


def waving_grid(n_frames=12, rows=9, columns=11, dtype=np.float32):
    """Return a sheet with traveling waves: one component, with a boundary."""
    y, x = np.mgrid[0:rows, 0:columns] / 8.0
    time = np.arange(n_frames)[:, None, None] / 5.0
    height = 0.2 * np.sin(4 * x - 2 * time) + 0.1 * np.cos(5 * y + 3 * time) * x
    vertices = np.stack(np.broadcast_arrays(x + 0.05 * time, y, height), axis=-1)
    return MeshSequence(
        vertices.reshape(n_frames, -1, 3).astype(dtype), grid_faces(rows, columns), 25.0, "grid"
    )


def octahedron_faces():
    """Return a closed surface of six vertices."""
    return np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
        np.int32,
    )


def torus_faces(rows, columns):
    """A torus of rows x columns vertices, whose triangles form quads listed row by row."""
    index = np.arange(rows * columns).reshape(rows, columns)
    right, below = np.roll(index, -1, 1), np.roll(index, -1, 0)
    across = np.roll(right, -1, 0)
    quads = np.stack([index, below, across, index, across, right], axis=-1)
    return quads.reshape(-1, 3).astype(np.int32)


def irregular_sequence(n_frames=8):
    """Return two components, isolated vertices, degenerate, duplicate and non-manifold faces."""
    grid = waving_grid(n_frames, 5, 6, np.float64)
    rng = np.random.default_rng(7)
    body = rng.normal(size=(6, 3))
    path = np.cumsum(rng.normal(size=(n_frames, 1, 3)), axis=0)
    loose = rng.normal(size=(n_frames, 2, 3))
    vertices = np.concatenate([loose[:, :1], grid.vertices, body + path, loose[:, 1:]], axis=1)
    extra = [[3, 3, 4], [1, 2, 7], [1, 2, 7], [2, 3, 20], [5, 5, 5]]
    faces = np.concatenate([grid.faces + 1, octahedron_faces() + 31, extra])
    return MeshSequence(vertices, faces, 30.0, "irregular")


def quad_sheet(n_frames=6, dtype=np.float32, name="sheet", shift=0.0):
    """Return a waving sheet of quads, a pentagon and a triangle, with attributes of every kind."""
    grid = waving_grid(n_frames, 5, 6, dtype)
    corner = (np.arange(4)[:, None] * 6 + np.arange(5)).ravel()
    quads = np.stack([corner, corner + 6, corner + 7, corner + 1], axis=1)
    polygons = [*quads[:-1].tolist(), [22, 28, 29, 23, 17], [0, 1, 6]]
    sizes = np.array([len(polygon) for polygon in polygons], np.int32)
    corners = np.concatenate(polygons).astype(np.int32)
    rng = np.random.default_rng(3)
    uv_rows = np.concatenate([np.arange(30), [30, 31, 30]])
    uv = Attribute(
        "st", Kind.UV, Domain.CORNER, rng.random((32, 2)).astype(np.float32),
        np.where(np.arange(len(corners)) < 8, corners % 32, uv_rows[corners % 33]).astype(np.int32),
    )  # fmt: skip
    color = Attribute(
        "color", Kind.COLOR, Domain.VERTEX, rng.integers(0, 256, (30, 4)).astype(np.uint8)
    )
    material = FaceGroups(
        "material", ("red", "gr\u00fcn"), rng.integers(0, 2, len(sizes)).astype(np.int32)
    )
    return MeshSequence(
        grid.vertices + np.asarray(shift, dtype),
        triangulate(sizes, corners, grid.vertices[0])[0],
        24.0,
        name,
        1001 / 24,
        Surface(sizes, (uv, color), (material,)),
    )


def two_sheets(n_frames=6, dtype=np.float32):
    """Return two `quad_sheet` parts in one mesh, with attributes of every kind."""
    first, second = (quad_sheet(n_frames, dtype, name, at) for name, at in (("a", 0), ("b", 2)))
    n_faces, surface = len(first.surface.face_sizes), first.surface
    uv, color = surface.attributes
    return MeshSequence(
        np.concatenate([first.vertices, second.vertices], axis=1),
        np.concatenate([first.faces, second.faces + first.n_verts]),
        24.0,
        "sheets",
        1001 / 24,
        Surface(
            np.tile(surface.face_sizes, 2),
            (
                Attribute("st", uv.kind, uv.domain, uv.values, np.tile(uv.indices, 2)),
                Attribute("color", color.kind, color.domain, np.tile(color.values, (2, 1))),
            ),
            (FaceGroups("material", ("red", "gr\u00fcn"), np.tile(surface.groups[0].numbers, 2)),),
            (Part("/root/a", first.n_verts, n_faces), Part("/root/b", first.n_verts, n_faces)),
        ),
    )


def every_third_edge(surface, faces):
    sizes = surface.sizes(len(faces))
    return shared_edges(sizes, join_triangles(sizes, faces)).ends[::3].astype(np.int32)


def hard_sheet(n_frames=6):
    """Return `quad_sheet` with every third edge hard."""
    sheet = quad_sheet(n_frames)
    edges = every_third_edge(sheet.surface, sheet.faces)
    return sheet.replace(surface=replace(sheet.surface, hard_edges=edges))


BOX_QUADS = np.array(
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
)
"""Corners of a box, whose vertex x + 2 y + 4 z is at (x, y, z); faces look outwards."""

BOX_CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)


def hard_box(n_frames=4):
    """Return a growing box of quads with hard edges."""
    sizes, corners = np.full(6, 4, np.int32), BOX_QUADS.ravel()
    edges = shared_edges(sizes, corners).ends
    growth = 1 + np.arange(n_frames, dtype=np.float32) / n_frames
    return MeshSequence(
        BOX_CORNERS * growth[:, None, None],
        triangulate(sizes, corners, BOX_CORNERS)[0],
        24.0,
        "box",
        surface=Surface(sizes, hard_edges=edges),
    )


def cake(n_frames=3, n_around=24):
    """Return a leaning cylinder: a smooth side of quads, flat ends of triangles, hard rims."""
    angles = np.arange(n_around) * (2 * np.pi / n_around)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(n_around)], axis=1)
    points = np.concatenate([ring, np.add(ring, [0, 0, 0.5]), [[0, 0, 0], [0, 0, 0.5]]])
    low = np.arange(n_around)
    after = np.roll(low, -1)
    bottom, top = np.full(n_around, 2 * n_around), np.full(n_around, 2 * n_around + 1)
    side = np.stack([low, after, after + n_around, low + n_around], axis=1)
    ends = [np.stack([bottom, after, low], 1), np.stack([top, low + n_around, after + n_around], 1)]
    sizes = np.repeat([4, 3, 3], n_around).astype(np.int32)
    corners = np.concatenate([side.ravel(), *(end.ravel() for end in ends)]).astype(np.int32)
    rims = np.concatenate([np.stack([low, after], 1), np.stack([low, after], 1) + n_around])
    shear = np.eye(3) + np.linspace(0, 0.1, n_frames)[:, None, None] * np.eye(3, k=1)
    return MeshSequence(
        (points @ shear).astype(np.float32),
        triangulate(sizes, corners, points)[0],
        24.0,
        "cake",
        surface=Surface(sizes, hard_edges=rims),
    )


def cake_normals(sequence):
    """Return the exact corner normals of a `cake` in its first frame: (C, 3)."""
    corners = join_triangles(sequence.surface.face_sizes, sequence.faces)
    radial = sequence.vertices[0][corners].astype(float) * [1, 1, 0]
    n_side = 4 * (len(sequence.surface.face_sizes) // 3)
    n_end = (len(corners) - n_side) // 2
    ends = np.repeat([[0, 0, -1], [0, 0, 1]], n_end, axis=0)
    return np.concatenate([radial[:n_side], ends])


def assert_same_surface(found, expected):
    """Assert that all arrays, names and types of two surfaces are equal."""
    assert (found.face_sizes is None) == (expected.face_sizes is None)
    if expected.face_sizes is not None:
        np.testing.assert_array_equal(found.face_sizes, expected.face_sizes)
    assert len(found.attributes) == len(expected.attributes)
    for one, other in zip(found.attributes, expected.attributes, strict=True):
        assert (one.name, one.kind, one.domain) == (other.name, other.kind, other.domain)
        assert one.values.dtype == other.values.dtype
        assert one.values.tobytes() == other.values.tobytes()
        assert (one.indices is None) == (other.indices is None)
        if other.indices is not None:
            np.testing.assert_array_equal(one.indices, other.indices)
    assert [(group.name, group.labels) for group in found.groups] == [
        (group.name, group.labels) for group in expected.groups
    ]
    for one, other in zip(found.groups, expected.groups, strict=True):
        np.testing.assert_array_equal(one.numbers, other.numbers)
    assert found.parts == expected.parts
    assert found.materials == expected.materials
    assert found.images == expected.images
    assert (found.hard_edges is None) == (expected.hard_edges is None)
    if expected.hard_edges is not None:
        np.testing.assert_array_equal(found.hard_edges, expected.hard_edges)
    assert (found.cells is None) == (expected.cells is None)
    if expected.cells is not None:
        np.testing.assert_array_equal(found.cells.types, expected.cells.types)
        np.testing.assert_array_equal(found.cells.nodes, expected.cells.nodes)


def encoded(encoder, vertices, faces):
    """Return the file of a frame, given the encoder of a format."""
    sequence = MeshSequence(np.asarray(vertices)[np.newaxis], np.array(faces))
    return encoder(SegmentedStream(sequence).only())(vertices, {})


def kg_error_percent(original, decoded):
    """Return the KG error of two position arrays, independently of the library."""
    original = np.asarray(original, np.float64)
    centered = original - original.mean(axis=1, keepdims=True)
    return 100 * np.linalg.norm(original - decoded) / np.linalg.norm(centered)
