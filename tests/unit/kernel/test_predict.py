"""Prediction by the core against a second decoder, slow and written from `docs/format.md`."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.kernel.predict import Choice, decode_values, encode_values
from meshreel.reel.agreed.mesh import FieldMesh
from samples.meshes import irregular_sequence, waving_grid

F = np.float32
PLAIN = Choice(first_shaped=1 << 30, gain=0.0, price=0.0)


class Filter:
    """The weights of one vertex, step by step as the format has it, in float32."""

    def __init__(self, near, hops):
        self.near = near
        self.size = len(near)
        self.prior = np.array([F(hops[0] ** 2) / F(hop**2) for hop in hops], F)
        total = F(0)
        for one in self.prior:
            total += one
        self.share = np.array([one / total for one in self.prior], F)
        self.weights = self.share.copy()
        self.variance = np.zeros((self.size, self.size), F)

    def loosen(self, amount):
        for i in range(self.size):
            for j in range(i):
                self.variance[i, j] -= amount * (self.share[i] * self.prior[j])
            own = self.prior[i] - self.share[i] * self.prior[i]
            self.variance[i, i] += amount * own

    def predict(self, offsets):
        found = F(0)
        for weight, offset in zip(self.weights, offsets, strict=True):
            found += weight * offset
        return found

    def observe(self, offsets, predicted, error, noise, relative):
        apart = np.array([one - predicted for one in offsets], F)
        gain = np.zeros(self.size, F)
        for i in range(self.size):
            row = F(0)
            for j in range(i):
                row += self.variance[i, j] * apart[j]
                gain[j] += self.variance[i, j] * apart[i]
            gain[i] = row + self.variance[i, i] * apart[i]
        energy = F(0)
        for one in apart:
            energy += one * one
        total = noise + relative * energy + F(0.03125) * (error * error)
        for i in range(self.size):
            total += apart[i] * gain[i]
        factor = F(1) / total
        for i in range(self.size):
            scaled = gain[i] * factor
            self.weights[i] += scaled * error
            for j in range(i + 1):
                self.variance[i, j] -= scaled * gain[j]


def offsets_to_the_nearest(values, near, own):
    base = values[near[0]]
    return base, np.array([F(values[one] - base) for one in near]), F(values[own] - base)


def prepared(mesh, vertex, smooth, key, n_learned):
    size = int((mesh.stencil[vertex] >= 0).sum())
    found = Filter(mesh.stencil[vertex, :size], mesh.hops[vertex, :size].astype(int))
    found.loosen(F(0.5))
    all_offsets, own = [], []
    for field in smooth.T:
        all_offsets.append(np.array([field[one] - field[found.near[0]] for one in found.near], F))
        own.append(field[vertex] - field[found.near[0]])
    noise = F(0)
    for offsets, one in zip(all_offsets, own, strict=True):
        for offset in offsets:
            noise += (offset - one) * (offset - one)
    noise = F(0.004) / F(mesh.stencil.shape[1]) * noise + F(2.0**-24)
    for offsets, one in zip(all_offsets, own, strict=True):
        predicted = found.predict(offsets)
        found.observe(offsets, predicted, F(one - predicted), noise, F(0))
    found.loosen(F(0.15) * F(0.5))
    for field in () if key is None else key.T[:n_learned]:
        _, offsets, one = offsets_to_the_nearest(field, found.near, vertex)
        predicted = found.predict(offsets)
        relative = F(0.001) / F(mesh.stencil.shape[1])
        found.observe(offsets, predicted, F(one - predicted), F(0.3), relative)
    return found


def decode_slowly(mesh, residuals, n_learned, key=None):
    values = np.zeros((mesh.n_verts, len(residuals)))
    relative = F(0.001) / F(mesh.stencil.shape[1])
    for level, start in enumerate(mesh.smooth_starts):
        for vertex in range(mesh.level_starts[level], mesh.level_starts[level + 1]):
            if not level:
                values[vertex] = residuals[:, vertex]
                continue
            found = prepared(mesh, vertex, mesh.smooth[start:], key, n_learned)
            for mode, residual in enumerate(residuals[:, vertex].tolist()):
                base, offsets, _ = offsets_to_the_nearest(values[:, mode], found.near, vertex)
                predicted = found.predict(offsets)
                values[vertex, mode] = base + np.float64(predicted) + residual
                if mode < n_learned:
                    found.observe(offsets, predicted, F(residual), F(0.3), relative)
    return values


def sample(sequence, size=7, n_modes=6, seed=3):
    mesh = FieldMesh(sequence.faces, sequence.n_verts, size).hierarchy
    rng = np.random.default_rng(seed)
    scales = np.geomspace(300, 1, n_modes)[:, None]
    return mesh, np.rint(rng.laplace(scale=scales, size=(n_modes, mesh.n_verts))).astype(np.int32)


@pytest.mark.parametrize("size", [1, 7, 16])
@pytest.mark.parametrize("sequence", [waving_grid(1, 8, 9), irregular_sequence(1)])
def test_values_are_the_same_bits_when_a_second_decoder_follows_the_format(sequence, size):
    mesh, residuals = sample(sequence, size)
    expected = decode_slowly(mesh, residuals, 4)
    np.testing.assert_array_equal(decode_values(mesh, residuals, 4), expected)


@pytest.mark.parametrize("n_learned", [0, 2, 9])
def test_values_are_the_same_bits_when_weights_follow_a_key_block(n_learned):
    mesh, residuals = sample(waving_grid(1, 8, 9))
    key = decode_values(mesh, sample(waving_grid(1, 8, 9), seed=4)[1], 9)
    expected = decode_slowly(mesh, residuals, n_learned, key)
    np.testing.assert_array_equal(decode_values(mesh, residuals, n_learned, key), expected)


@pytest.mark.parametrize("scale", [1.0, 1e4, 1e7])
@pytest.mark.parametrize("choice", [PLAIN, Choice(1, 0.6, 0.1)])
def test_values_of_both_sides_are_the_same_bits_when_encoded(scale, choice):
    mesh, _ = sample(irregular_sequence(1), 16)
    wanted = scale * np.random.default_rng(2).normal(size=(mesh.n_verts, 9)).cumsum(axis=0)
    residuals, values = encode_values(mesh, wanted, choice, 5)
    np.testing.assert_array_equal(decode_values(mesh, residuals, 5), values)


def test_values_lie_within_half_a_step_when_bits_are_free():
    mesh, _ = sample(waving_grid(1, 20, 31), 16)
    wanted = 100 * np.random.default_rng(2).normal(size=(mesh.n_verts, 9)).cumsum(axis=0)
    _, values = encode_values(mesh, wanted, PLAIN, 5)
    assert np.abs(values - wanted).max() <= 0.5 + 1e-9


def test_weights_stay_small_when_parts_of_a_mesh_move_apart():
    """Two parts that begin alike: what no weights explain must not make them large."""
    mesh, _ = sample(irregular_sequence(1), 16)
    wanted = np.random.default_rng(5).normal(size=(mesh.n_verts, 8)) * 10.0 ** np.arange(8, 0, -1)
    residuals, _ = encode_values(mesh, wanted, PLAIN, 8)
    assert np.abs(residuals).max() < 100 * np.abs(wanted).max()


def test_values_do_not_depend_on_the_parts_of_a_level(monkeypatch):
    mesh, residuals = sample(waving_grid(1, 20, 31), 16)
    whole = decode_values(mesh, residuals, 5)
    monkeypatch.setattr("meshreel.kernel.predict.CHUNK_VERTICES", 16)
    np.testing.assert_array_equal(decode_values(mesh, residuals, 5), whole)


@pytest.mark.parametrize("value", [1e10, -1e10, np.nan, np.inf])
def test_error_is_raised_when_a_residual_is_too_large(value):
    mesh, _ = sample(waving_grid(1, 8, 9))
    wanted = np.zeros((mesh.n_verts, 2))
    wanted[40, 1] = value
    with pytest.raises(InvalidInputError, match="fields cannot be coded"):
        encode_values(mesh, wanted, PLAIN, 2)
