"""Information about a stream."""

from collections import Counter

import numpy as np
import pytest

import meshreel
from meshreel.app.figures import player_rows
from meshreel.kernel.files import OpenFile
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from samples.materials import dressed_sheet
from samples.meshes import quad_sheet, waving_grid
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
    info = meshreel.info(meshreel.encode(sequence))
    assert info.raw_size_bytes == sequence.raw_size_bytes
    assert info.ratio == sequence.raw_size_bytes / info.size_bytes
    assert {track.name: track.raw_size_bytes for track in info.tracks} == {
        "heat": 9 * GRID.n_verts * 3 * 8, "on": 9 * GRID.n_faces,
    }  # fmt: skip


def test_sizes_state_geometry_and_images_apart():
    plain, sequence = quad_sheet(), dressed_sheet()
    figures = meshreel.info(meshreel.encode(sequence))
    stored = sum(len(image.data) for image in sequence.surface.images)
    assert stored < figures.image_bytes < stored + 100
    assert figures.part_bytes["images"] == figures.image_bytes
    assert sum(figures.part_bytes.values()) == sum(figures.budget_bytes.values())
    assert figures.raw_size_bytes == sequence.raw_size_bytes == plain.raw_size_bytes
    geometry = figures.size_bytes - figures.image_bytes
    assert figures.ratio == figures.raw_size_bytes / geometry
    assert figures.rate_bpvf == 8 * geometry / (figures.n_verts * figures.n_frames)
    rows = player_rows(figures)
    assert "geometry" in rows["file"]
    assert "images" in rows["file"]
    assert rows["rate"].endswith("bits per vertex and frame, without images")
    assert "images" not in player_rows(meshreel.info(meshreel.encode(plain)))["rate"]


def test_sizes_of_sections_and_tracks_are_parts_of_the_whole():
    data = meshreel.encode(dressed(), block_frames=4)
    info = meshreel.info(data)
    assert sum(info.budget_bytes.values()) == info.size_bytes == len(data)
    assert sum(info.part_bytes.values()) == len(data)
    assert info.rate_bpvf == 8 * len(data) / (info.n_verts * info.n_frames)
    assert info.block_frames == (4, 4, 1)
    assert min(info.block_bytes) > 0
    of_tracks = sum(track.size_bytes for track in info.tracks)
    assert 0 < sum(info.block_bytes) < info.size_bytes - of_tracks


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
    assert calls["group_of"] == 5 * 3  # of positions and two tracks


def test_damage_anywhere_in_a_file_is_detected(tmp_path):
    data = bytearray(meshreel.encode(dressed(), block_frames=4))
    start, stop = Stream(bytes(data)).groups[1][2]  # of the second track
    data[(start + stop) // 2] ^= 1
    path = tmp_path / "damaged.reel"
    path.write_bytes(data)
    with meshreel.open(path) as reel, pytest.raises(meshreel.CorruptStreamError):
        reel.info()
