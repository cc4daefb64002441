"""Coding of corrections, and decoding of arbitrary bytes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.codec.corrections import Corrections
from meshreel.codec.reel.normative.payloads import read_corrections, write_corrections
from meshreel.errors import CorruptStreamError
from samples.costs import draws


@st.composite
def corrections_of_blocks(draw):
    """Corrections with the size of their block: none, some, in runs, or all."""
    n_frames, n_verts = draw(st.integers(1, 12)), draw(st.integers(1, 9))
    is_dense = draw(st.booleans())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    chosen = rng.random((n_verts, n_frames)) < draw(st.sampled_from([0.0, 0.1, 0.5, 0.9, 1.0]))
    if is_dense:
        chosen[:, draw(st.integers(0, n_frames - 1)) :] = True
    vertices, frames = np.nonzero(chosen)
    size = draw(st.sampled_from([1, 3, 300, 2**29]))
    offsets = rng.integers(-size, size + 1, (len(vertices), 3))
    step = np.float32(draw(st.sampled_from([1e-30, 1e-7, 0.1, 1.0, 9e5])))
    return Corrections(step, vertices, frames, offsets), n_frames, n_verts


def assert_equal(found, expected):
    assert found.step == expected.step
    assert found.step.dtype == np.float32
    np.testing.assert_array_equal(found.vertices, expected.vertices)
    np.testing.assert_array_equal(found.frames, expected.frames)
    np.testing.assert_array_equal(found.offsets, expected.offsets)


def assert_usable(found, n_frames, n_verts):
    """Assert that decoded corrections move existing positions."""
    assert found.vertices.shape == found.frames.shape == found.offsets.shape[:1]
    assert np.all((found.vertices >= 0) & (found.vertices < n_verts))
    assert np.all((found.frames >= 0) & (found.frames < n_frames))


@settings(max_examples=draws(300))
@given(corrections_of_blocks())
def test_any_corrections_round_trip(case):
    corrections, n_frames, n_verts = case
    payload = write_corrections(corrections)
    assert_equal(read_corrections(payload, 3, n_frames, n_verts), corrections)


@settings(max_examples=draws(200))
@given(corrections_of_blocks())
def test_writing_does_not_change_corrections(case):
    corrections, _, _ = case
    before = [corrections.vertices.copy(), corrections.frames.copy(), corrections.offsets.copy()]
    write_corrections(corrections)
    after = [corrections.vertices, corrections.frames, corrections.offsets]
    for array, copy in zip(after, before, strict=True):
        np.testing.assert_array_equal(array, copy)


@settings(max_examples=draws(500))
@given(st.binary(max_size=200), st.integers(1, 30), st.integers(1, 30))
def test_random_bytes_decode_to_corrections_or_our_error(data, n_frames, n_verts):
    try:
        found = read_corrections(data, 3, n_frames, n_verts)
    except CorruptStreamError:
        return
    assert_usable(found, n_frames, n_verts)


@settings(max_examples=draws(500))
@given(corrections_of_blocks(), st.lists(st.tuples(st.integers(0), st.integers(0, 7)), min_size=1))
def test_flipped_bits_decode_to_corrections_or_our_error(case, flips):
    corrections, n_frames, n_verts = case
    data = bytearray(write_corrections(corrections))
    for position, bit in flips:
        data[position % len(data)] ^= 1 << bit
    try:
        found = read_corrections(bytes(data), 3, n_frames, n_verts)
    except CorruptStreamError:
        return
    assert_usable(found, n_frames, n_verts)


@settings(max_examples=draws(100))
@given(corrections_of_blocks())
def test_truncated_corrections_are_valid_or_refused(case):
    corrections, n_frames, n_verts = case
    payload = write_corrections(corrections)
    for size in range(len(payload)):
        try:
            found = read_corrections(payload[:size], 3, n_frames, n_verts)
        except CorruptStreamError:
            continue
        assert_usable(found, n_frames, n_verts)


@settings(max_examples=draws(300))
@given(corrections_of_blocks(), st.integers(1, 12), st.integers(1, 9))
def test_corrections_outside_of_the_block_are_refused(case, n_frames, n_verts):
    corrections, _, _ = case
    fits = np.all(corrections.vertices < n_verts) and np.all(corrections.frames < n_frames)
    try:
        found = read_corrections(write_corrections(corrections), 3, n_frames, n_verts)
    except CorruptStreamError:
        assert not fits
        return
    assert fits
    assert_equal(found, corrections)
