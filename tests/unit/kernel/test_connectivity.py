"""Traversal of generated surfaces: size in bytes, and defects."""

import numpy as np
import pytest

from conformance.bits import DamagedError
from conformance.connectivity import read_faces
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.connectivity import encode_faces
from samples.coded_meshes import decode_connectivity, sorted_triangles
from samples.meshes import grid_faces, octahedron_faces, torus_faces


def subdivided(faces, times):
    """Split each face into four, `times` times."""
    for _ in range(times):
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]))
        _, middles = np.unique(ends, axis=0, return_inverse=True)
        a, b, c = faces.T
        x, y, z = faces.max() + 1 + middles.reshape(3, -1)
        faces = np.stack([a, x, z, x, b, y, z, y, c, x, y, z], axis=-1).reshape(-1, 3)
    return faces


def wheel(n_spokes):
    """Return a closed surface with two hubs and their common neighbors."""
    rim = 2 + np.arange(n_spokes)
    following = np.roll(rim, -1)
    above = np.stack([np.zeros_like(rim), rim, following], axis=-1)
    return np.concatenate([above, np.stack([np.ones_like(rim), following, rim], axis=-1)])


def moebius_strip(n_quads):
    upper, lower = 2 * np.arange(n_quads), 2 * np.arange(n_quads) + 1
    right, below = np.append(upper[1:], 1), np.append(lower[1:], 0)
    return np.stack([upper, lower, right, right, lower, below], axis=-1).reshape(-1, 3)


def fan(n_pages):
    """Return faces at one edge, like pages of a book, with alternating orientation."""
    pages = np.stack([np.zeros(n_pages, int), np.ones(n_pages, int), 2 + np.arange(n_pages)], -1)
    pages[1::2, :2] = pages[1::2, 1::-1]
    return pages


def turned_over(faces, seed=1):
    faces = faces.copy()
    chosen = np.random.default_rng(seed).random(len(faces)) < 0.5
    faces[chosen] = faces[chosen, ::-1]
    return faces


def copies(faces, n):
    return np.concatenate([faces + i * (faces.max() + 1) for i in range(n)])


def both_sides(faces):
    return np.stack([faces, faces[:, ::-1]], axis=1).reshape(-1, 3)


def sharing(faces, *pairs):
    """Replace the first vertex of each pair with the second."""
    for vertex, other in pairs:
        faces = np.where(faces == vertex, other, faces)
    return np.unique(faces, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)


def faces_or_nothing(read, *arguments):
    """Decode bytes; None if the decoder raises an error."""
    try:
        return [tuple(face) for face in np.array(read(*arguments)).tolist()]
    except (CorruptStreamError, DamagedError):
        return None


# Measured bytes, and a margin.
SURFACES = {
    "one face": ([[0, 1, 2]], 6),
    "sheet": (grid_faces(60, 60), 22),
    "large sheet": (grid_faces(300, 300), 64),
    "torus": (torus_faces(60, 40), 14),
    "torus turned over": (turned_over(torus_faces(60, 40)), 630),
    "sheet seen from both sides": (both_sides(grid_faces(20, 20)), 180),
    "sphere": (subdivided(octahedron_faces(), 4), 24),
    "large sphere": (subdivided(octahedron_faces(), 7), 46),
    "wheel": (wheel(5000), 18),
    "strip": (moebius_strip(100), 40),
    "book": (fan(101), 70),
    "many octahedra": (copies(octahedron_faces(), 40), 26),
    "many faces": (np.arange(300).reshape(-1, 3), 12),
}


@pytest.fixture(params=SURFACES)
def surface(request):
    """Faces, number of vertices, and maximum number of bytes."""
    faces, limit = SURFACES[request.param]
    faces = np.array(faces, np.int32)
    return faces, int(faces.max()) + 1, limit


def with_original_numbers(faces, n_verts):
    """Return the faces in internal order, with the original vertex numbers."""
    payload, internal_to_given, internal, _ = encode_faces(faces, n_verts, listed=False)
    np.testing.assert_array_equal(decode_connectivity(payload, n_verts, len(faces)), internal)
    return internal_to_given[internal], internal_to_given


def test_traversal_of_a_simple_surface_round_trips_in_few_bytes(surface):
    faces, n_verts, limit = surface
    assert len(encode_faces(faces, n_verts, listed=False)[0]) <= limit
    decoded, internal_to_given = with_original_numbers(faces, n_verts)
    np.testing.assert_array_equal(
        sorted_triangles(decoded, n_verts), sorted_triangles(faces, n_verts)
    )
    np.testing.assert_array_equal(np.sort(internal_to_given), np.arange(n_verts))


@pytest.mark.parametrize("name", ["sheet", "torus", "large sphere", "wheel"])
def test_every_vertex_but_the_first_has_a_lower_neighbor_on_a_connected_surface(name):
    faces = np.array(SURFACES[name][0], np.int32)
    internal = encode_faces(faces, int(faces.max()) + 1, listed=False).faces
    ends = np.concatenate([internal[:, [0, 1]], internal[:, [1, 2]], internal[:, [2, 0]]])
    assert set(range(1, internal.max() + 1)) == set(ends.max(axis=1).tolist())


def test_unused_vertices_are_numbered_last():
    faces = np.array([[1, 4, 6], [6, 4, 8]], np.int32)
    decoded, internal_to_given = with_original_numbers(faces, 10)
    assert internal_to_given[4:].tolist() == [0, 2, 3, 5, 7, 9]
    assert sorted(decoded[0]) != sorted(decoded[1])


def test_degenerate_faces_come_last():
    faces = np.array([[0, 0, 1], [0, 1, 2], [1, 4, 1], [1, 2, 0], [2, 1, 3]], np.int32)
    decoded, _ = with_original_numbers(faces, 5)
    assert decoded[3:].tolist() == [[0, 0, 1], [1, 4, 1]]


def test_order_without_faces_is_the_given_one():
    faces = np.zeros((0, 3), np.int32)
    assert encode_faces(faces, 3, listed=False).internal_to_given.tolist() == [0, 1, 2]


@pytest.mark.parametrize("corner", [-1, 4, 2**31 - 1])
def test_faces_are_rejected_when_a_corner_is_not_a_vertex(corner):
    with pytest.raises(InvalidInputError, match="number 1 "):
        encode_faces(np.array([[0, 1, 2], [0, corner, 2]], np.int32), 4, listed=False)


def faces_alone(data, n_verts, n_faces):
    return read_faces(data, n_verts, n_faces)[0]


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize(
    "faces",
    [
        sharing(copies(octahedron_faces(), 6), (6, 0), (12, 3), (18, 7), (25, 0), (31, 9)),
        sharing(np.arange(60).reshape(-1, 3), (5, 1), (20, 1), (8, 4), (50, 10), (58, 55)),
        turned_over(torus_faces(5, 4)),
        grid_faces(5, 4)[[*range(9), *range(11, 24)]],
        subdivided(octahedron_faces(), 1)[3:],
    ],
    ids=["octahedra", "triangles", "turned over", "holes", "cap"],
)
def test_plain_reader_agrees_for_every_flipped_bit(faces):
    faces = np.array(faces, np.int32)
    shape = int(faces.max()) + 1, len(faces)
    payload, _, internal, coded_twins = encode_faces(faces, shape[0], listed=False)
    faces, twins = read_faces(payload, *shape)
    assert faces == [tuple(face) for face in internal.tolist()]
    assert twins == coded_twins.tolist()
    for bit in range(8 * len(payload)):
        changed = bytearray(payload)
        changed[bit // 8] ^= 1 << bit % 8
        decoded = faces_or_nothing(decode_connectivity, bytes(changed), *shape)
        assert decoded == faces_or_nothing(faces_alone, bytes(changed), *shape)


@pytest.mark.parametrize(("position", "value"), [(4, 0b11), (5, 0b10)])
def test_copy_of_the_next_vertex_is_rejected(position, value):
    """There is no such vertex yet; each of `faces` shares a vertex with earlier ones."""
    faces = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6]], np.int32)
    changed = bytearray(encode_faces(faces, 7, listed=False)[0])
    changed[position] ^= value
    with pytest.raises(DamagedError, match="a copied vertex does not exist"):
        read_faces(bytes(changed), 7, 3)
    with pytest.raises(CorruptStreamError):
        decode_connectivity(bytes(changed), 7, 3)
