"""Segments that are decoded in parallel equal those decoded alone."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import CorruptStreamError
from meshreel.kernel.files import OpenFile
from meshreel.model.sequence import MeshSequence
from meshreel.runtime import threads


def segments_of(n_segments=5, n_frames=40):
    """Return segments whose faces differ."""
    sizes = range(5, 5 + n_segments)
    return MeshSequence.of_segments(
        [meshreel.simulate_flag(n_frames, n_rows=n, n_columns=6) for n in sizes]
    )


@pytest.fixture(params=[1, None], ids=["one core", "all cores"])
def cores(request, monkeypatch):
    monkeypatch.setattr(threads, "_core_limit", request.param)


@pytest.mark.slow
@pytest.mark.usefixtures("cores")
def test_ranges_of_frames_and_modes_are_those_of_single_segments():
    data = meshreel.encode(segments_of(n_frames=8), effort=5)
    part = meshreel.decode(data, frames=slice(6, 30), n_modes=1).segments
    assert [one.n_frames for one in part] == [2, 8, 8, 6]
    first = meshreel.decode(data, segment=0, frames=slice(6, 8), n_modes=1)
    last = meshreel.decode(data, segment=3, frames=slice(0, 6), n_modes=1)
    np.testing.assert_array_equal(part[0].read(0, 2), first.vertices)
    np.testing.assert_array_equal(part[-1].read(0, 6), last.vertices)


def test_first_damaged_segment_raises():
    given = segments_of()
    data = bytearray(meshreel.encode(given, "lossless"))
    place = OpenFile(bytes(data), 1e9).segments[3]
    data[place.offset + place.size_bytes - 8] ^= 1
    with pytest.raises(CorruptStreamError) as alone:
        meshreel.decode(bytes(data), segment=3)
    with pytest.raises(CorruptStreamError) as together:
        meshreel.decode(bytes(data))
    assert str(together.value) == str(alone.value)


@pytest.mark.parametrize("damages_mesh", [True, False])
@pytest.mark.usefixtures("cores")
def test_damage_of_the_first_segment_raises_though_others_share_its_mesh(damages_mesh):
    first, other = segments_of(2, n_frames=20).segments
    data = bytearray(meshreel.encode(meshreel.concatenate([first, other, first, other, first])))
    file = OpenFile(bytes(data), 1e9)
    place = file.segments[0]
    after = place.offset + place.size_bytes - 8
    data[file.segment(0).leading[0].payload_offset if damages_mesh else after] ^= 1
    with pytest.raises(CorruptStreamError):
        meshreel.decode(bytes(data))
