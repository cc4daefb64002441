import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.codec.connectivity.order import encode_order, inverse_permutation
from meshreel.errors import CorruptStreamError
from samples.coded_meshes import decode_order


def in_other_order(faces, n_verts, seed=4):
    """Renumber and reorder a mesh; return internal faces and the permutations."""
    rng = np.random.default_rng(seed)
    internal_to_given = rng.permutation(n_verts)
    internal = inverse_permutation(internal_to_given)[faces][rng.permutation(len(faces))]
    turned = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return np.take_along_axis(internal, turned, axis=1), internal_to_given


def coded_order(faces, n_verts, keep_faces, seed=4):
    """Return the coded order, internal faces and the permutation of vertices."""
    internal, internal_to_given = in_other_order(faces, n_verts, seed)
    payload = encode_order(faces, internal, internal_to_given, keep_faces)
    return payload, internal, internal_to_given


def assert_round_trips(faces, n_verts, keep_faces, seed):
    payload, internal, internal_to_given = coded_order(faces, n_verts, keep_faces, seed)
    decoded, listed = decode_order(payload, internal, n_verts)
    np.testing.assert_array_equal(decoded, internal_to_given)
    np.testing.assert_array_equal(listed, faces if keep_faces else internal_to_given[internal])


def size_bits(faces, n_verts, *, keep_faces=True):
    return 8 * len(coded_order(faces, n_verts, keep_faces)[0])


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.tuples(
            st.just(n), st.lists(st.tuples(*[st.integers(0, n - 1)] * 3), min_size=1, max_size=20)
        )
    ),
    st.booleans(),
    st.integers(0, 1 << 30),
)
def test_order_is_lossless_for_any_faces(mesh, keep_faces, seed):
    n_verts, listed = mesh
    assert_round_trips(np.array(listed, np.int32), n_verts, keep_faces, seed)


def test_regular_order_costs_almost_nothing(meshes):
    faces, n_verts = meshes["torus"]
    assert size_bits(faces, n_verts) < 0.4 * n_verts
    assert size_bits(faces, n_verts, keep_faces=False) < 0.3 * n_verts


def test_random_order_costs_little_more_than_its_entropy(meshes):
    faces, n_verts = meshes["shuffled torus"]
    verts = np.log2(np.arange(1, n_verts + 1)).sum()
    both = verts + np.log2(np.arange(1, len(faces) + 1)).sum() + np.log2(3) * len(faces)
    assert size_bits(faces, n_verts, keep_faces=False) < 1.13 * verts
    assert size_bits(faces, n_verts) < 1.12 * both


def test_scattered_quads_cost_half_of_scattered_triangles(meshes):
    faces, n_verts = meshes["torus"]
    pairs = 2 * np.random.default_rng(9).permutation(len(faces) // 2)
    scattered = faces[np.stack([pairs, pairs + 1], axis=1).ravel()]
    alone = size_bits(faces[np.random.default_rng(9).permutation(len(faces))], n_verts)
    assert size_bits(scattered, n_verts) < 0.6 * alone


def test_jittered_sweep_order_costs_less_than_a_random_one(meshes):
    faces, n_verts = meshes["torus"]
    rng = np.random.default_rng(2)
    swept = faces[np.argsort(np.arange(len(faces)) + rng.normal(size=len(faces)) * 10)]
    assert size_bits(swept, n_verts) < 0.72 * size_bits(rng.permutation(faces), n_verts)


@pytest.mark.every_case
@pytest.mark.parametrize(
    "change",
    [lambda coded: b"\0" + coded[1:], lambda coded: b"\3", lambda coded: coded + b"\0"],
    ids=["other start", "only a start", "a trailing zero"],
)
def test_damaged_order_is_refused(change):
    faces = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
    payload, internal, _ = coded_order(faces, 4, keep_faces=True)
    assert payload[-1] != 0
    decode_order(payload, internal, 4)
    with pytest.raises(CorruptStreamError):
        decode_order(change(payload), internal, 4)
