"""Information about a stream."""

from collections import Counter

import numpy as np
import pytest

import meshreel
from meshreel.kernel.files import OpenFile
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from samples.meshes import waving_grid
from samples.streams import Stream

GRID = waving_grid(9)


def dressed(dtype=np.float32):
    """Positions, texture coordinates of vertices, and tracks of vertices and of faces."""
    uv = np.random.default_rng(1).random((GRID.n_verts, 2), np.float32)
    tracks = {
        "heat": np.random.default_rng(2).random((9, GRID.n_verts, 3)),
        "on": np.ones((9, GRID.n_faces), np.uint8),
    }
    surface = Surface(attributes=(Attribute("uv", Kind.UV, Domain.VERTEX, uv),))
    return meshreel.MeshSequence(
        GRID.vertices.astype(dtype), GRID.faces, 25.0, surface=surface, tracks=tracks
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_raw_size_is_that_of_the_sequence(dtype):
    sequence = dressed(dtype)
    found = meshreel.info(meshreel.encode(sequence))
    assert found.raw_size_bytes == sequence.raw_size_bytes
    assert found.ratio == sequence.raw_size_bytes / found.size_bytes
    assert {one.name: one.raw_size_bytes for one in found.tracks} == {
        "heat": 9 * GRID.n_verts * 3 * 8, "on": 9 * GRID.n_faces,
    }  # fmt: skip


def test_sizes_of_sections_and_tracks_are_parts_of_the_whole():
    data = meshreel.encode(dressed(), block_frames=4)
    found = meshreel.info(data)
    assert sum(found.budget_bytes.values()) == found.size_bytes == len(data)
    assert sum(found.part_bytes.values()) == len(data)
    assert found.rate_bpvf == 8 * len(data) / (found.n_verts * found.n_frames)
    assert found.block_frames == (4, 4, 1)
    assert min(found.block_bytes) > 0
    of_tracks = sum(one.size_bytes for one in found.tracks)
    assert 0 < sum(found.block_bytes) < found.size_bytes - of_tracks


def test_each_section_is_visited_once(monkeypatch):
    data = meshreel.encode(dressed(), block_frames=2)
    sections = Stream(data).sections
    calls, call = Counter(), OpenFile.call

    def counted(self, name, *arguments):
        calls[name] += 1
        return call(self, name, *arguments)

    monkeypatch.setattr(OpenFile, "call", counted)
    meshreel.info(data)
    assert calls["section_at"] == len(sections)
    assert calls["group_of"] == 5


def test_damage_anywhere_in_a_file_is_detected(tmp_path):
    data = bytearray(meshreel.encode(dressed(), block_frames=4))
    start, stop = Stream(bytes(data)).groups[1][2]  # of the second track
    data[(start + stop) // 2] ^= 1
    path = tmp_path / "damaged.reel"
    path.write_bytes(data)
    with meshreel.open(path) as reel, pytest.raises(meshreel.CorruptStreamError):
        reel.info()
