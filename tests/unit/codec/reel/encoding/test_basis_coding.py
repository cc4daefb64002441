"""Which blocks have cosines over time, and what these save."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding import basis_coding
from meshreel.codec.reel.encoding.basis_coding import saves_bits
from meshreel.codec.reel.normative.blocks import layout_of
from meshreel.codec.reel.normative.fields import Layout
from meshreel.codec.reel.normative.payloads import read_layout, write_layout
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.errors import CorruptStreamError
from meshreel.kernel.basis import MAX_COSINES
from samples.meshes import waving_grid
from samples.streams import Stream

PRICE = 0.116


def periodic(n_frames=48, side=14, period=24):
    """A sheet whose vertices repeat different smooth motions."""
    sheet = waving_grid(1, side, side, np.float64)
    rng, angles = np.random.default_rng(3), 2.0 * np.pi * np.arange(n_frames) / period
    waves = np.concatenate([np.sin(k * angles + k)[:, None] / k for k in range(1, 7)], axis=1)
    moves = np.tensordot(waves, 0.1 * rng.normal(size=(6, side * side, 3)), 1)
    return meshreel.MeshSequence((sheet.vertices + moves).astype(np.float32), sheet.faces)


def layouts(data):
    stream = Stream(data)
    blocks = map(stream.block, range(len(stream.groups)))
    return [read_layout(block[Section.FIELDS]) for block in blocks]


def by_times(monkeypatch, sequence, **options):
    """The stream without cosines."""
    with monkeypatch.context() as changed:
        changed.setattr(basis_coding, "saves_bits", lambda *_: False)
        return meshreel.encode(sequence, **options)


def test_periodic_motion_takes_fewer_bytes_as_cosines(monkeypatch):
    sequence = periodic()
    found, usual = meshreel.encode(sequence), by_times(monkeypatch, sequence)
    assert [one.has_cosines for one in layouts(found)] == [True]
    assert len(found) < 0.97 * len(usual)
    errors = [meshreel.compare(sequence, meshreel.decode(data)) for data in (found, usual)]
    assert errors[0].kg_error_percent < 1.02 * errors[1].kg_error_percent


def test_fields_are_reused_in_blocks_with_cosines():
    sequence = periodic(72)
    found = layouts(meshreel.encode(sequence, block_frames=24, quality=90))
    assert [one.has_cosines for one in found] == [True] * 3
    assert all(one.n_reused for one in found[1:])


def test_sudden_motion_is_coded_by_times():
    steps = np.random.default_rng(2).normal(size=(4, 3, 80)) * (np.arange(80) % 9 == 0)
    assert not saves_bits(40.0 * np.cumsum(steps, axis=2), PRICE)


@pytest.mark.parametrize(
    ("wanted", "price"),
    [
        (np.zeros((0, 3, 9)), PRICE),
        (np.zeros((2, 3, 1)), PRICE),
        (np.full((2, 3, 9), 2.0**28), PRICE),  # coefficients would be too large
        (np.ones((2, 3, MAX_COSINES + 1)), PRICE),
        (np.zeros((2, 3, 9)), 0.0),
    ],
)
def test_times_are_kept_when_cosines_cannot_be_or_save_nothing(wanted, price):
    assert not saves_bits(wanted, price)


def test_block_is_refused_when_it_has_cosines_and_too_many_frames():
    layout = Layout(np.float32(0.5), 1, 0, has_cosines=True)
    sections = {Section.FIELDS: write_layout(layout)}
    assert layout_of(StoredBlock(0, MAX_COSINES, 1, sections)) == layout
    with pytest.raises(CorruptStreamError, match="at most 1024 frames"):
        layout_of(StoredBlock(0, MAX_COSINES + 1, 1, sections))
