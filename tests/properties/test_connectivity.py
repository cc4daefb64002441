import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.codec.connectivity.order import encode_order
from meshreel.errors import MeshReelError
from meshreel.kernel.connectivity import encode_faces
from samples.coded_meshes import (
    assert_faces_round_trip,
    decode_connectivity,
    decode_order,
    sorted_triangles,
)
from samples.costs import draws
from samples.meshes import grid_faces

orders = st.sampled_from(["keep", "vertices", "drop"])


@st.composite
def random_meshes(draw):
    """Any faces over a few vertices: isolated, degenerate, duplicate, non-manifold, scattered."""
    n_verts = draw(st.integers(1, 14))
    corner = st.integers(0, n_verts - 1)
    faces = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=40))
    return np.array(faces, np.int32), n_verts


@st.composite
def torn_grids(draw):
    """A sheet with missing, flipped and duplicate faces, merged corners and any order."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows, columns = draw(st.integers(2, 40)), draw(st.integers(2, 30))
    faces = grid_faces(rows, columns)
    faces = faces[rng.random(len(faces)) >= draw(st.sampled_from([0, 0.02, 0.3]))]
    faces = np.concatenate([faces, [[0, 1, 1]]])
    again = rng.integers(0, len(faces), draw(st.integers(0, 5)))
    faces = np.concatenate([faces, faces[again][:, :: draw(st.sampled_from([1, -1]))]])
    names = np.arange(rows * columns)
    merged = rng.integers(0, len(names), (2, draw(st.integers(0, 6))))
    names[merged[0]] = merged[1]
    if draw(st.booleans()):
        names = rng.permutation(len(names))[names]
        faces = rng.permutation(faces)
    return names[faces].astype(np.int32), len(names)


meshes = st.one_of(random_meshes(), torn_grids())


@settings(max_examples=draws(250))
@given(meshes, orders)
def test_any_connectivity_round_trips(mesh, order):
    faces, n_verts = mesh
    assert_faces_round_trip(faces, n_verts, order)


@settings(max_examples=draws(250))
@given(meshes, st.booleans())
def test_listed_and_walked_faces_decode_to_the_same_triangles(mesh, listed):
    faces, n_verts = mesh
    payload, internal_to_given, internal, _ = encode_faces(faces, n_verts, listed=listed)
    np.testing.assert_array_equal(decode_connectivity(payload, n_verts, len(faces)), internal)
    if listed:
        np.testing.assert_array_equal(internal, faces)
        np.testing.assert_array_equal(internal_to_given, np.arange(n_verts))
    np.testing.assert_array_equal(
        sorted_triangles(internal_to_given[internal], n_verts), sorted_triangles(faces, n_verts)
    )
    order = encode_order(faces, internal, internal_to_given, keep_faces=True)
    np.testing.assert_array_equal(decode_order(order, internal, n_verts)[1], faces)


@settings(max_examples=draws(300))
@given(st.binary(max_size=120), st.integers(1, 200), st.integers(1, 200))
def test_random_bytes_decode_to_a_mesh_or_our_error(data, n_verts, n_faces):
    try:
        faces = decode_connectivity(data, n_verts, n_faces)
    except MeshReelError:
        return
    assert faces.shape == (n_faces, 3)
    assert 0 <= faces.min() <= faces.max() < n_verts
