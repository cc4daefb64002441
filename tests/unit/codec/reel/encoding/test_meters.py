"""Errors computed from fields equal those of decoded frames."""

import numpy as np
import pytest

from meshreel.codec.options import config_of
from meshreel.codec.reel.encoding.block_coder import SLACK, KeyedBlocks, KgMeter, coder_of
from meshreel.codec.source import Source
from meshreel.metrics.position_errors import position_errors
from meshreel.model.sequence import MeshSequence
from samples.meshes import irregular_sequence, waving_grid


def metered(sequence, step, block_frames=8):
    """The error of the meter, and that of decoded frames."""
    source = Source(sequence, config_of(block_frames=block_frames))
    coder = coder_of(source.mesh, source.frame).with_step(step, None)
    blocks, meter, decoded = KeyedBlocks(coder), KgMeter(), []
    for frames in map(coder.frames, source.blocks()):
        coded = blocks.code(frames)
        meter.add(frames, coded)
        decoded.append(coded.decoded(frames))
    original = sequence.vertices[:, source.mesh.order]
    return meter.value, position_errors(original, np.concatenate(decoded)).kg_error_percent


@pytest.mark.parametrize("make", [waving_grid, irregular_sequence])
@pytest.mark.parametrize("step", [1e-2, 1e-4, 1e-6, 1e-8])
def test_kg_error_of_fields_equals_that_of_decoded_frames(make, step):
    result, exact = metered(make(20), step)
    assert result == pytest.approx(exact, rel=1e-4 if step > 1e-5 else 1e-2)


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_kg_error_far_from_the_origin_is_not_underestimated(offset):
    grid = waving_grid(20)
    moved = MeshSequence((grid.vertices + offset).astype(np.float32), grid.faces)
    result, exact = metered(moved, 1e-4)
    assert exact * (1 - SLACK) <= result * (1 + 1e-2)
    assert result == pytest.approx(exact, rel=1e-2)


def test_kg_error_is_infinite_for_coincident_vertices():
    still = MeshSequence(np.ones((3, 4, 3)) * np.arange(3)[:, None, None], [[0, 1, 2]])
    result, _ = metered(still, 1e-2)
    assert result == np.inf or result == 0.0
