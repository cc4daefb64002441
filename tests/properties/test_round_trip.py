import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.model.sequence import MeshSequence
from samples.costs import draws


@st.composite
def irregular_sequences(draw):
    """Any faces over a few vertices: isolated, degenerate, duplicate, non-manifold, scattered."""
    n_verts = draw(st.integers(1, 12))
    corner = st.integers(0, n_verts - 1)
    faces = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=20))
    n_frames = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size, offset = draw(st.sampled_from([(1.0, 0.0), (1e-6, 0.0), (1.0, 1e6), (1e9, -1e9)]))
    vertices = rng.normal(size=(n_frames, n_verts, 3)) * size + offset
    if draw(st.booleans()):
        vertices[:] = vertices[0]
    if draw(st.booleans()):
        vertices[:, :, 2] = offset
    return MeshSequence(vertices, np.array(faces))


@settings(max_examples=draws(150))
@given(irregular_sequences(), st.sampled_from(["normalized", "combinatorial"]))
def test_the_papers_method_with_all_modes_round_trips_any_mesh(sequence, laplacian):
    data = encode(sequence, "pca-qp", n_modes=sequence.n_frames, bits=24, laplacian=laplacian)
    decoded = decode(data)
    np.testing.assert_array_equal(decoded.faces, sequence.faces)
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    # The dictionary and the anchors are rounded to 16 bits.
    assert np.abs(decoded.vertices - sequence.vertices).max() <= 2e-3 * diagonal
