"""Streams of the paper's methods as arrays: the arrays satisfy the equations.

`rebuilt` and `laplacian_of` are written from the equations, in NumPy alone.
"""

import inspect
import sys
from dataclasses import replace

import numpy as np
import pytest

import meshreel
import meshreel.paper
from meshreel.codec.achieved import measure_stream
from meshreel.errors import InvalidInputError, MemoryLimitError, TruncatedStreamError
from meshreel.model.sequence import MeshSequence
from meshreel.paper import METHODS, graph_fourier, mesh_model, read
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid
from samples.programs import output_of

GRID = waving_grid(9, 5, 6, np.float64)
AS_COEFFICIENTS = {"choices": {"anchor_values": "coefficients"}}


def shuffled(sequence):
    """The same mesh with vertices in random order."""
    order = np.random.default_rng(3).permutation(sequence.n_verts)
    return MeshSequence(sequence.vertices[:, order], np.argsort(order)[sequence.faces])


SEQUENCES = {
    "grid": GRID,
    "shuffled": shuffled(GRID),
    "isolated vertices": shuffled(irregular_sequence(9)),
}


def encoded(sequence, method, **options):
    return meshreel.encode(sequence, method, **{"n_modes": 4, "block_frames": 5} | options)


def laplacian_of(faces, n_verts, *, normalized):
    """D - C (Eq. 1), or each vertex less the mean of its neighbors (Eq. 3); dense."""
    adjacent = np.zeros((n_verts, n_verts))
    for a, b, c in faces:
        adjacent[[a, b, b, c, c, a], [b, a, c, b, a, c]] = 1
    np.fill_diagonal(adjacent, 0)
    degrees = adjacent.sum(axis=1)
    combinatorial = np.diag(degrees) - adjacent
    return combinatorial / np.maximum(degrees, 1)[:, None] if normalized else combinatorial


def rebuilt(stream, n_modes=None):
    """Positions (T, V, 3) of all frames from the arrays of a stream, by dense least squares."""
    laplacian, anchors = stream.laplacian.toarray(), stream.anchors
    system = np.concatenate([laplacian, np.eye(len(laplacian))[anchors]])
    frames = []
    for block in stream.blocks:
        kept = block.n_modes if n_modes is None else min(n_modes, block.n_modes)
        values = []
        for axis in range(3):
            rows = block.coefficients[axis, :kept]
            if block.basis is None:
                signal = (stream.graph_fourier_basis(kept) @ rows).T
            else:
                signal = block.basis[axis][:, :kept] @ rows
            if len(anchors):
                at_anchors = block.anchor_positions[axis]
                if block.anchor_residuals is None:
                    at_anchors = (
                        block.basis[axis][:, :kept] @ block.anchor_coefficients[axis][:kept]
                    )
                right = np.concatenate([signal.T, at_anchors.T])
                signal = np.linalg.lstsq(system, right, rcond=None)[0].T  # Eq. 12
            values.append(signal)
        positions = np.array(stream.origin) + stream.scale * np.stack(values, axis=2)
        if block.isolated_positions is not None:
            positions[:, stream.isolated] = block.isolated_positions
        frames.append(positions)
    return np.concatenate(frames)


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize(
    ("method", "name", "options"),
    [
        *((method, name, {}) for method in METHODS for name in SEQUENCES),
        *(
            (method, "shuffled", {"anchors": 0.2, **AS_COEFFICIENTS})
            for method in ("pca-qp", "pca-qs", "blocks")
        ),
        ("pca-qp", "shuffled", {"laplacian": "cotangent"}),
        ("pca-qp", "shuffled", {"laplacian": "combinatorial", "anchors": 0.3}),
        ("pca-qp", "shuffled", {"order": "drop"}),
        ("pca-qp", "shuffled", {"anchors": 0.5, **AS_COEFFICIENTS}),
        ("pca-qp", "shuffled", {"anchors": 1.0}),  # more anchors than three times the frames
    ],
)
def test_arrays_satisfy_the_equations_that_decode_solves(method, name, options):
    """Eqs. 11 and 12, or the product for v2v; `reconstruct` equals `decode` to the bit."""
    data = encoded(SEQUENCES[name], method, **options)
    stream = read(data)
    for n_modes in (None, 2, 100):
        wanted = meshreel.decode(data, n_modes=n_modes).vertices
        np.testing.assert_allclose(rebuilt(stream, n_modes), wanted, atol=1e-9)
        np.testing.assert_array_equal(stream.reconstruct(n_modes), wanted)


def test_reconstruct_has_the_number_type_of_the_sequence():
    assert read(encoded(waving_grid(6), "pca-qp")).reconstruct().dtype == np.float32


@pytest.mark.parametrize("laplacian", ["normalized", "combinatorial"])
@pytest.mark.parametrize("name", SEQUENCES)
def test_laplacian_is_that_of_the_faces_in_output_order(name, laplacian):
    """Eqs. 1 and 3."""
    sequence = SEQUENCES[name]
    stream = read(encoded(sequence, "pca-qp", laplacian=laplacian))
    np.testing.assert_array_equal(stream.faces, sequence.faces)
    wanted = laplacian_of(sequence.faces, sequence.n_verts, normalized=laplacian == "normalized")
    np.testing.assert_allclose(stream.laplacian.toarray(), wanted, atol=1e-15)


@pytest.mark.parametrize("name", SEQUENCES)
def test_coefficients_are_projected_deltas_to_half_a_step(name):
    """Eqs. 8 to 10: Q(U^T (L A^T)^T), on the basis as the decoder has it."""
    sequence = SEQUENCES[name]
    stream = read(encoded(sequence, "pca-qp"))
    for block in stream.blocks:
        frames = sequence.vertices[block.start : block.start + block.n_frames]
        for axis in range(3):
            matrix = (frames[:, :, axis] - stream.origin[axis]) / stream.scale
            projected = block.basis[axis].T @ (stream.laplacian @ matrix.T).T
            error = np.abs(block.coefficients[axis] - projected).max()
            assert error <= 0.5001 * block.coefficient_steps[0]


def test_coefficients_are_multiples_of_the_step_of_their_row():
    data = encoded(GRID, "pca-qp", bits=6, allocation="constant")
    for block in read(data).blocks:
        assert block.coefficient_steps.shape == (4,)
        integers = block.coefficients / block.coefficient_steps.astype(float)[None, :, None]
        np.testing.assert_allclose(integers, np.rint(integers), atol=1e-9)
        assert np.abs(integers).max() == pytest.approx(31)


def test_anchors_are_the_given_vertices_with_their_motion_to_half_a_step():
    sequence, given, bits = SEQUENCES["shuffled"], [23, 4, 17], 14
    stream = read(encoded(sequence, "pca-qp", anchors=given, choices={"anchor_bits": bits}))
    assert stream.anchors.tolist() == sorted(given)
    for block in stream.blocks:
        frames = sequence.vertices[block.start : block.start + block.n_frames]
        wanted = (frames[:, stream.anchors] - np.array(stream.origin)) / stream.scale
        step = np.abs(wanted).max() / (2 ** (bits - 1) - 1)
        positions = np.stack(list(block.anchor_positions), axis=2)
        np.testing.assert_allclose(positions, wanted, atol=0.51 * step)


def test_isolated_vertices_have_their_exact_positions():
    sequence = SEQUENCES["isolated vertices"]
    for method in METHODS:
        stream = read(encoded(sequence, method, bits=4))
        degrees = laplacian_of(sequence.faces, sequence.n_verts, normalized=False).diagonal()
        assert stream.isolated.tolist() == np.flatnonzero(degrees == 0).tolist()
        result = stream.reconstruct()[:, stream.isolated]
        np.testing.assert_array_equal(result, sequence.vertices[:, stream.isolated])


def test_graph_fourier_basis_has_the_lowest_frequencies():
    """Eq. 6, up to the numbers below 0.001 that separate equal eigenvalues."""
    sequence = SEQUENCES["shuffled"]
    basis = read(encoded(sequence, "gft")).graph_fourier_basis(5)
    np.testing.assert_allclose(basis.T @ basis, np.eye(5), atol=1e-10)
    laplacian = laplacian_of(sequence.faces, sequence.n_verts, normalized=False)
    frequencies = np.diag(basis.T @ laplacian @ basis)
    np.testing.assert_allclose(frequencies, np.linalg.eigvalsh(laplacian)[:5], atol=1e-3)


@pytest.fixture
def all_of_gft(monkeypatch):
    """A stream with all frequencies, and its frames; the limit of decoders is below them."""
    data = encoded(SEQUENCES["shuffled"], "gft", n_modes=30)
    wanted = meshreel.decode(data).vertices
    monkeypatch.setattr(graph_fourier, "MAX_WORK", 30**3 - 1)
    return data, wanted


def test_decoders_refuse_many_frequencies_unless_all_are_allowed(all_of_gft):
    data, wanted = all_of_gft
    stream = read(data)
    refused = [lambda: meshreel.decode(data), stream.reconstruct]
    for compute in (*refused, lambda: stream.graph_fourier_basis(30)):
        with pytest.raises(InvalidInputError, match=r"at most 10 \(.*option all_frequencies"):
            compute()
    allowed = read(data, all_frequencies=True)
    np.testing.assert_array_equal(allowed.reconstruct(), wanted)
    assert allowed.graph_fourier_basis(30).shape == (30, 30)


def test_own_streams_are_measured_with_any_number_of_frequencies(all_of_gft):
    """The command line measures the streams that it writes."""
    data, decoded = all_of_gft
    original = SEQUENCES["shuffled"]
    result = measure_stream(original, data).kg_error_percent
    assert result == pytest.approx(kg_error_percent(original.vertices, decoded))


def test_decoders_accept_the_leading_frequencies_of_many(all_of_gft):
    data, _ = all_of_gft
    np.testing.assert_array_equal(
        read(data).reconstruct(5), meshreel.decode(data, n_modes=5).vertices
    )


def test_basis_of_a_stream_is_computed_once(all_of_gft, monkeypatch):
    data, _ = all_of_gft
    computed = []

    def counting(laplacian, n_modes, **options):
        computed.append(n_modes)
        return graph_fourier.graph_fourier_basis(laplacian, n_modes, **options)

    monkeypatch.setattr(mesh_model, "graph_fourier_basis", counting)
    stream = read(data, all_frequencies=True)
    assert len(stream.blocks) == 2
    assert computed == []
    stream.reconstruct()
    stream.graph_fourier_basis(30)
    assert computed == [30]
    encoded(GRID, "gft", n_modes=30)
    assert computed == [30, 30]


def test_memory_limits_a_stream_and_its_basis(all_of_gft, monkeypatch):
    data, _ = all_of_gft
    with pytest.raises(MemoryLimitError, match=r"68.1 kB of memory; .* memory"):
        read(data, memory="50kB")
    stream = read(data, all_frequencies=True, memory="95kB")
    monkeypatch.setattr(graph_fourier, "basis_bytes", lambda *_: 95_001)
    with pytest.raises(InvalidInputError, match=r"30 vertices take 95 kB .*memory"):
        stream.reconstruct()


def test_reconstruct_uses_replaced_arrays():
    data = encoded(SEQUENCES["shuffled"], "pca-qp")
    stream = read(data)
    without = [block.coefficients.copy() for block in stream.blocks]
    for rows in without:
        rows[:, 2:] = 0
    blocks = tuple(
        replace(block, coefficients=rows)
        for block, rows in zip(stream.blocks, without, strict=True)
    )
    result = replace(stream, blocks=blocks).reconstruct()
    np.testing.assert_array_equal(result, meshreel.decode(data, n_modes=2).vertices)
    assert np.abs(result - stream.reconstruct()).max() > 1e-3


@pytest.mark.parametrize(
    ("method", "name", "value"),
    [
        ("pca-qp", "coefficients", np.zeros((3, 4, 7))),
        ("pca-qp", "basis", None),
        ("pca-qp", "anchor_coefficients", None),
        ("pca-qp", "anchor_residuals", np.zeros((3, 5, 1))),
        ("gft", "anchor_residuals", None),
        ("v2v", "anchor_residuals", np.zeros((3, 1, 5))),
        ("pca", "isolated_positions", np.zeros((5, 1, 3))),
    ],
)
def test_error_names_an_array_that_does_not_fit(method, name, value):
    stream = read(encoded(GRID, method))
    blocks = (replace(stream.blocks[0], **{name: value}), *stream.blocks[1:])
    with pytest.raises(InvalidInputError, match=f"{name} of the block at frame 0 must"):
        replace(stream, blocks=blocks).reconstruct()


def test_read_accepts_a_path(tmp_path):
    path = tmp_path / "grid.reel"
    path.write_bytes(encoded(GRID, "blocks"))
    for given in (path, str(path)):
        np.testing.assert_array_equal(read(given).reconstruct(), meshreel.decode(path).vertices)


def test_error_for_another_method_gives_the_remedy():
    with pytest.raises(InvalidInputError, match=r"method reel, .*pca-qp.* or use meshreel\.decode"):
        read(meshreel.encode(GRID, effort=5))


def test_read_refuses_other_files(tmp_path):
    with pytest.raises(InvalidInputError, match=r"nothing\.reel cannot be read: No such file"):
        read(tmp_path / "nothing.reel")
    with pytest.raises(InvalidInputError, match="got MeshSequence"):
        read(GRID)
    with pytest.raises(TruncatedStreamError):
        read(encoded(GRID, "pca-qp")[:-9])


def test_reconstruct_refuses_zero_modes():
    with pytest.raises(InvalidInputError, match="n_modes must be"):
        read(encoded(GRID, "pca-qp")).reconstruct(0)


def test_methods_are_those_of_the_paper():
    wanted = ["pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft"]
    assert sorted(METHODS) == sorted(wanted)


def test_every_name_of_the_package_is_documented():
    assert [name for name in dir(meshreel.paper) if not name.startswith("__")] == sorted(
        meshreel.paper.__all__
    )
    for name in meshreel.paper.__all__:
        assert inspect.getdoc(getattr(meshreel.paper, name)), name
        assert name in meshreel.paper.__doc__, name


def test_package_is_imported_on_first_use():
    code = "import sys, meshreel; print('scipy' in sys.modules, 'meshreel.paper' in sys.modules)"
    assert output_of(sys.executable, "-c", code).split() == ["False", "False"]


def test_repr_is_one_line():
    stream = read(encoded(GRID, "pca-qp"))
    assert repr(stream) == "<PaperStream pca-qp: 9 frames, 30 vertices, 1 anchor, 2 blocks>"
    assert repr(stream.blocks[1]) == "<PaperBlock: frames 5..8, 4 modes>"
