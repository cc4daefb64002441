"""Layouts and corrections that the core reads or refuses."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from meshreel.codec.bitstream.container import write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel.normative import blocks
from meshreel.codec.reel.normative.blocks import Corrections
from meshreel.codec.reel.normative.fields import Layout
from meshreel.errors import CorruptStreamError
from meshreel.kernel.basis import BasisCoding, Rests
from meshreel.kernel.integers import encode_integers
from samples.meshes import waving_grid
from samples.streams import Stream, layout_of, layouts, parts_of, raw_stream

STREAM = Stream(encode(waving_grid(9, 4, 5), step=0.003))
CORRECTED = Stream(encode(waving_grid(9, 4, 5), max_error=0.5, effort=5))
(LAYOUT,) = layouts(encode(waving_grid(9, 4, 5), step=0.003))


def read(payload, section=Section.FIELDS, stream=STREAM):
    """Decode a stream with another payload of a section."""
    parts = [(own, payload if own is section else data) for own, data in parts_of(stream)]
    return decode(raw_stream(stream.header, parts))


RESTS = Rests(((1, 2), (5, 9)), 8)
REUSED = Layout(np.float32(0.1), 16, 32, 300, False, 2, np.float32(2.5), BasisCoding(RESTS))


@pytest.mark.parametrize(
    "layout",
    [
        LAYOUT,
        replace(REUSED, coding=BasisCoding(RESTS, is_adaptive=True)),
        replace(REUSED, is_single=True),
        replace(LAYOUT, coding=BasisCoding(has_cosines=True), is_single=True),
    ],
)
def test_layout_round_trips_through_the_plain_reader(layout):
    sections = {Section.BLOCK: b"\x09\x02", Section.FIELDS: blocks.write_layout(layout)}
    assert layout_of(sections, 9) == layout


@pytest.mark.parametrize(
    "changes",
    [
        *({"step": np.float32(step)} for step in (0.0, -1.0, np.nan, np.inf, 1e6)),
        {"stencil_size": 0},
        {"stencil_size": 17},
        {"n_learned": 256},
        {"coding": BasisCoding(Rests(((0, 1),)))},
        {"coding": BasisCoding(Rests(((1, 1),)))},
        {"coding": BasisCoding(Rests(((1, 2),), 9))},
        {"coding": BasisCoding(RESTS, has_cosines=True)},
        {"coding": BasisCoding(has_cosines=True, is_adaptive=True)},
        {"n_reused": 1, "finer": np.float32(4.0), "reference": 0},
        {"n_reused": 1, "finer": np.float32(np.nan), "reference": 1},
    ],
    ids=str,
)
def test_invalid_layout_is_refused(changes):
    layout = replace(LAYOUT, coding=BasisCoding())
    with pytest.raises(CorruptStreamError):
        read(blocks.write_layout(replace(layout, **changes)))


def test_layout_with_missing_or_trailing_bytes_is_refused():
    payload = blocks.write_layout(LAYOUT)
    for damaged in (*(payload[:size] for size in range(len(payload))), payload + b"\0"):
        with pytest.raises(CorruptStreamError):
            read(damaged)


def corrections(step=0.5):
    """Corrections of a block of 9 frames of 20 vertices."""
    vertices = np.array([3, 3, 3, 7, 19, 19])
    frames = np.array([0, 1, 5, 8, 2, 3])
    offsets = np.arange(18).reshape(6, 3) - 9
    return Corrections(np.float32(step), vertices, frames, offsets)


def written_raw(step, n_corrected, columns):
    """Encode invalid corrections."""
    return b"".join(
        [
            struct.pack("<f", step),
            write_varint(n_corrected),
            write_varint(len(columns[2])),
            encode_integers([np.array(column) for column in columns], [0, 1, 2, 3, 3, 3]),
        ]
    )


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf, 1e6])
def test_corrections_with_an_invalid_step_are_refused(step):
    with pytest.raises(CorruptStreamError):
        read(blocks.write_corrections(corrections(step)), Section.CORRECTIONS, CORRECTED)


NONE = [0, 0, 0]


@pytest.mark.parametrize(
    ("n_corrected", "columns"),
    [
        (2, [[3, 0], [0, 0], [0, 0], [1, 1], [0, 0], [0, 0]]),  # a vertex twice
        (2, [[3, -1], [0, 0], [0, 0], [1, 1], [0, 0], [0, 0]]),  # descending
        (1, [[-1], [0], [0], [1], [0], [0]]),
        (1, [[20], [0], [0], [1], [0], [0]]),
        (1, [[3], [-1], [0], [1], [0], [0]]),  # a vertex without corrections
        (2, [[3, 1], [1, -1], [0, 0], [1, 1], [0, 0], [0, 0]]),
        (1, [[3], [2], [0, 1], [1, 1], [0, 0], [0, 0]]),  # more than their total
        (1, [[3], [0], [-1], [1], [0], [0]]),
        (1, [[3], [0], [9], [1], [0], [0]]),
        (1, [[3], [1], [4, -5], [1, 1], [0, 0], [0, 0]]),
        (3, [[3, 1, 1], NONE, [0, 0], [1, 1], [0, 0], [0, 0]]),  # fewer than vertices
    ],
)
def test_contradictory_corrections_are_refused(n_corrected, columns):
    with pytest.raises(CorruptStreamError):
        read(written_raw(0.5, n_corrected, columns), Section.CORRECTIONS, CORRECTED)


def test_valid_corrections_in_place_of_others_decode():
    """Otherwise the tests above would prove nothing."""
    assert Section.CORRECTIONS in CORRECTED.block(0)
    read(blocks.write_corrections(corrections()), Section.CORRECTIONS, CORRECTED)


def test_runs_of_equal_offsets_take_few_bytes():
    frames = np.arange(500)
    nothing = np.zeros(500, np.int64)
    run, scattered = (
        Corrections(np.float32(1), nothing, frames, offsets)
        for offsets in (
            np.tile([700, -90, 33], (500, 1)),
            np.random.default_rng(0).integers(-700, 701, (500, 3)),
        )
    )
    sizes = [len(blocks.write_corrections(one)) for one in (run, scattered)]
    assert sizes[0] < 60 < 1000 < sizes[1]
