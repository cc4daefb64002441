"""Corrections that the core decodes."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.encoder import encode
from meshreel.codec.reel.normative.blocks import Corrections, write_corrections
from meshreel.kernel.files import FrameDecoder, OpenFile
from samples.costs import draws
from samples.meshes import waving_grid
from samples.streams import Stream, parts_of, raw_stream

N_FRAMES, N_VERTS = 9, 20
STREAM = Stream(encode(waving_grid(N_FRAMES, 4, 5), max_error=0.5, effort=5))


def decoded_moves(payload):
    """Return the displacements that the core reads from corrections, in diagonals."""
    parts = [
        (section, payload if section is Section.CORRECTIONS else data)
        for section, data in parts_of(STREAM)
    ]
    file = OpenFile(raw_stream(STREAM.header, parts), float("inf"))
    modes = FrameDecoder(file).modes(0)
    internal = file.stored_mesh[1][modes.corrected]
    return modes.correction_starts, internal, modes.corrections / file.info.diagonal


@st.composite
def corrections_of_a_block(draw):
    """Corrections: none, some, in runs, or all."""
    is_dense = draw(st.booleans())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    chosen = rng.random((N_VERTS, N_FRAMES)) < draw(st.sampled_from([0.0, 0.1, 0.5, 0.9, 1.0]))
    if is_dense:
        chosen[:, draw(st.integers(0, N_FRAMES - 1)) :] = True
    vertices, frames = np.nonzero(chosen)
    size = draw(st.sampled_from([1, 3, 300, 2**29]))
    offsets = rng.integers(-size, size + 1, (len(vertices), 3))
    step = np.float32(draw(st.sampled_from([1e-30, 1e-7, 0.1, 1.0, 9e5])))
    return Corrections(step, vertices, frames, offsets)


@settings(max_examples=draws(300))
@given(corrections_of_a_block())
def test_core_decodes_any_corrections(corrections):
    before = [corrections.vertices.copy(), corrections.frames.copy(), corrections.offsets.copy()]
    starts, vertices, displacements = decoded_moves(write_corrections(corrections))
    after = [corrections.vertices, corrections.frames, corrections.offsets]
    for array, copy in zip(after, before, strict=True):
        np.testing.assert_array_equal(array, copy)
    moves = corrections.by_frame(N_FRAMES)
    np.testing.assert_array_equal(starts, moves.starts)
    for start, end in pairwise(starts):
        order = np.argsort(vertices[start:end])
        np.testing.assert_array_equal(vertices[start:end][order], moves.vertices[start:end])
        np.testing.assert_allclose(
            displacements[start:end][order], moves.displacements[start:end], rtol=1e-12
        )
