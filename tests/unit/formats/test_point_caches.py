import os
import struct

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import PLAIN
from meshreel.operations.save import save
from samples.datasets import (
    assert_same_positions,
    plain_sequence,
    polygon_surface,
    positions_of,
    surfaced_sequence,
)
from samples.meshes import assert_same_surface
from samples.opening import open_source

RATES = [24.0, 25.0, 30.0, 60.0, 29.97, 30000 / 1001, 24000 / 1001, 1000.0]


@pytest.fixture(params=["pc2", "mdd"])
def extension(request):
    return request.param


def round_trip(tmp_path, sequence, extension, **options):
    notes = []
    cache, mesh = save(sequence, tmp_path / f"walk.{extension}", notes=notes)
    return load(cache, topology=mesh, **options), notes


@pytest.mark.parametrize("n_frames", [1, 7])
@pytest.mark.parametrize("surface", [PLAIN, polygon_surface()], ids=["triangles", "polygons"])
def test_point_caches_round_trip_with_a_mesh_file_of_the_same_name(
    tmp_path, extension, n_frames, surface
):
    sequence = surfaced_sequence(n_frames, surface=surface)
    cache, mesh = save(sequence, tmp_path / f"walk.{extension}")
    assert mesh == tmp_path / "walk.obj"
    for options in ({}, {"topology": mesh}):
        loaded = load(cache, **options)
        assert_same_positions(loaded, sequence)
        assert_same_surface(loaded.surface, surface)
        assert (loaded.name, positions_of(loaded).dtype) == ("walk", np.float32)


def test_topology_option_gives_faces_and_polygons(tmp_path, extension):
    cache, mesh = save(plain_sequence(), tmp_path / f"walk.{extension}")
    text = mesh.read_text().splitlines()
    rows = [line for line in text if line.startswith("v ")] + ["f 1 2 3 4", "f 6 7 8 9 10"]
    (tmp_path / "quads.obj").write_text("\n".join(rows))
    loaded = load(cache, topology=tmp_path / "quads.obj")
    np.testing.assert_array_equal(loaded.surface.face_sizes, [4, 5])
    corners = join_triangles(loaded.surface.face_sizes, loaded.faces)
    assert corners.tolist() == [0, 1, 2, 3, 5, 6, 7, 8, 9]


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("start_s", [0.0, 0.1, 2.0, -1.5])
def test_mdd_round_trips_frame_rate_and_start(tmp_path, fps, start_s):
    returned, notes = round_trip(
        tmp_path, plain_sequence(n_frames=9, fps=fps, start_s=start_s), "mdd"
    )
    assert (returned.fps, returned.start_s, notes) == (fps, start_s, [])


@pytest.mark.parametrize("fps", RATES)
def test_pc2_round_trips_a_start_at_a_whole_frame(tmp_path, fps, extension):
    start_s = 1001 / fps
    sequence = plain_sequence(n_frames=9, fps=fps, start_s=start_s)
    returned, _ = round_trip(tmp_path, sequence, extension, fps=fps)
    assert (returned.fps, returned.start_s) == (fps, start_s)


def test_load_notes_a_later_first_frame_of_pc2(tmp_path, notes):
    cache, mesh = save(plain_sequence(fps=25.0, start_s=2.0), tmp_path / "walk.pc2")
    assert load(cache, topology=mesh, notes=notes).start_s == 0
    assert "begins at frame 50 of unknown rate" in notes[0]
    assert load(cache, topology=mesh, fps=25).start_s == 2.0


@pytest.mark.parametrize(
    ("extension", "options", "note", "fps"),
    [
        ("mdd", {"n_frames": 1}, "MDD has no frame rate for one frame: 25 fps is lost", 0),
        ("mdd", {"start_s": 1 / 3}, "the start at 0.3333333333333333 s reads as", 25.0),
        ("mdd", {"fps": 23.98765}, "23.98765 fps reads as 23.98", 23.98765),
        ("mdd", {"fps": 0.0, "start_s": 1.5}, "the frame rate is unknown; written as 24 fps", 24.0),
        ("pc2", {}, "PC2 has no frame rate: set 25 fps when reading it (fps)", 0),
        ("pc2", {"fps": 0.0, "start_s": 1.5},
         "PC2 stores the start at 1.5 s as frame 36 at 24 fps, which is 1.5 s", 0),
    ],
)  # fmt: skip
def test_save_notes_what_a_cache_cannot_store(tmp_path, extension, options, note, fps):
    returned, notes = round_trip(tmp_path, plain_sequence(**options), extension)
    assert len(notes) == 1
    assert note in notes[0]
    assert returned.fps == pytest.approx(fps)


@pytest.mark.parametrize("is_exact", [False, True])
def test_float64_positions_that_are_not_exact_are_rounded_with_a_note(
    tmp_path, extension, is_exact
):
    sequence = plain_sequence(dtype=np.float64)
    rounded = sequence.vertices.astype(np.float32)
    if is_exact:
        sequence = MeshSequence(rounded.astype(np.float64), sequence.faces, 25.0)
    returned, notes = round_trip(tmp_path, sequence, extension, fps=25)
    np.testing.assert_array_equal(returned.vertices, rounded)
    furthest = np.abs(rounded - sequence.vertices).max()
    note = f"positions were rounded to float32, by up to {furthest:.3g}"
    assert [text for text in notes if "rounded" in text] == ([] if is_exact else [note])


@pytest.mark.parametrize(
    ("scale", "start_s", "message"),
    [
        (1e39, 0.0, r"frame 0 has coordinates up to .*e\+3.*; point caches store"),
        (1.0, 1e300, r"too large for (PC2|MDD)"),
    ],
)
def test_save_rejects_numbers_beyond_float32(tmp_path, extension, scale, start_s, message):
    plain = plain_sequence(dtype=np.float64, start_s=start_s)
    with pytest.raises(InvalidInputError, match=message):
        save(plain.replace(vertices=plain.vertices * scale), tmp_path / f"a.{extension}")
    assert list(tmp_path.iterdir()) == []


def test_stored_frames_of_a_cache_equal_loaded_ones(tmp_path, extension, monkeypatch):
    monkeypatch.setattr("meshreel.formats.frames.stored_frames.BLOCK_BYTES", 300)
    sequence = plain_sequence(n_frames=9)
    cache, mesh = save(sequence, tmp_path / f"walk.{extension}")
    opened = open_source(cache, topology=mesh)
    assert isinstance(opened, StoredFrames)
    for start, stop in [(0, 9), (3, 4), (5, 20), (4, 4), (-2, 9)]:
        assert opened.read(start, stop).tobytes() == sequence.vertices[start:stop].tobytes()
    assert opened.extent.low.tolist() == sequence.extent.low.tolist()
    assert opened.extent.mean_diagonal == sequence.extent.mean_diagonal


def test_reading_frames_fails_if_the_cache_has_changed(tmp_path, extension):
    cache, mesh = save(plain_sequence(n_frames=4), tmp_path / f"walk.{extension}")
    opened = open_source(cache, topology=mesh)
    data = bytearray(cache.read_bytes())
    data[-140] ^= 1  # in frame 2
    cache.write_bytes(data)
    assert len(opened.read(0, 2)) == 2
    with pytest.raises(InvalidInputError, match=r"\(frame 2\) changed after"):
        opened.read(0, 4)
    os.truncate(cache, len(data) - 1)
    with pytest.raises(InvalidInputError, match=r"\(frame 3\) changed after"):
        opened.read(3, 4)


def test_error_without_topology_gives_the_remedy(tmp_path, extension):
    cache, mesh = save(plain_sequence(), tmp_path / f"walk.{extension}")
    mesh.unlink()
    message = r"has positions of 11 vertices without faces; .* topology=.* store it as walk.obj"
    with pytest.raises(InvalidInputError, match=message):
        load(cache)


@pytest.mark.parametrize(
    ("name", "text", "error", "message"),
    [
        ("few.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", InvalidInputError, "11 vertices and"),
        ("bad.obj", "v 0 0\n", FormatError, r"bad\.obj: line 1: a vertex needs x, y and z"),
        ("a.stl", "", FormatError, r"must be in a \.obj, \.ply, \.off"),
        ("a.txt", "", FormatError, r"must be in a \.obj"),
        ("none.obj", None, InvalidInputError, r"none\.obj cannot be read: No such file"),
    ],
)
def test_errors_explain_an_unsuitable_topology(tmp_path, name, text, error, message):
    cache, _ = save(plain_sequence(), tmp_path / "walk.pc2")
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(error, match=message):
        load(cache, topology=tmp_path / name)


def test_uneven_times_of_mdd_are_kept(tmp_path):
    uneven = plain_sequence(n_frames=3).replace(times=[0.5, 1.5, 3.5])
    cache, mesh = save(uneven, tmp_path / "walk.mdd")
    loaded = load(cache, topology=mesh)
    assert loaded.times.tolist() == [0.5, 1.5, 3.5]
    assert load(cache, topology=mesh, fps=10).times.tolist() == pytest.approx([0.5, 0.6, 0.7])


def test_mdd_whose_times_do_not_ascend_has_no_frame_rate(tmp_path, notes):
    cache, mesh = save(plain_sequence(n_frames=3), tmp_path / "walk.mdd")
    data = cache.read_bytes()
    cache.write_bytes(data[:8] + bytes(12) + data[20:])
    assert load(cache, topology=mesh, notes=notes).fps == 0
    assert notes == ["frame times are not ascending; the frame rate is unknown"]


def test_load_notes_the_sample_interval_of_pc2(tmp_path, notes):
    cache, mesh = save(plain_sequence(start_s=2.0), tmp_path / "walk.pc2")
    data = cache.read_bytes()
    cache.write_bytes(data[:24] + struct.pack("<f", 2) + data[28:])
    loaded = load(cache, topology=mesh, fps=12.5, notes=notes)
    assert (loaded.fps, loaded.start_s) == (12.5, 2.0)
    assert notes == ["samples are 2 frames apart; each is read as one frame"]


@pytest.mark.parametrize("keep", [3, 7, 11, 31, 60, -1])
def test_error_for_a_truncated_cache_names_the_file(tmp_path, extension, keep):
    cache, mesh = save(plain_sequence(), tmp_path / f"walk.{extension}")
    cache.write_bytes(cache.read_bytes()[:keep])
    with pytest.raises(FormatError, match=rf"walk\.{extension}: is (truncated|not )"):
        load(cache, topology=mesh)


@pytest.mark.parametrize(
    ("extension", "place", "bytes_", "message"),
    [
        ("pc2", 0, b"POINT", "is not a PC2 file"),
        ("pc2", 12, struct.pack("<i", 2), "has PC2 version 2; version 1 is supported"),
        ("pc2", 16, struct.pack("<i", 2**31 - 1), "is truncated: 5 frames of 2147483647 vertices"),
        ("pc2", 16, struct.pack("<i", -1), "declares 5 frames of -1 vertices"),
        ("pc2", 20, struct.pack("<f", float("nan")), "begins at frame nan"),
        ("mdd", 0, struct.pack(">i", 2**31 - 1), "is truncated: 2147483647 frames"),
        ("mdd", 4, struct.pack(">i", 0), "declares 5 frames of 0 vertices"),
        ("mdd", 8, struct.pack(">f", float("inf")), "frame times are not finite"),
    ],
)
def test_error_for_an_invalid_header_names_the_file(tmp_path, extension, place, bytes_, message):
    cache, mesh = save(plain_sequence(), tmp_path / f"walk.{extension}")
    data = bytearray(cache.read_bytes())
    if bytes_ != b"POINT":
        data[place : place + len(bytes_)] = bytes_
    else:
        data[0] = 0
    cache.write_bytes(data)
    with pytest.raises(FormatError, match=rf"walk\.{extension}: .*{message}"):
        load(cache, topology=mesh)


def test_error_names_the_vertex_of_a_non_finite_position(tmp_path, extension):
    cache, mesh = save(plain_sequence(), tmp_path / f"walk.{extension}")
    data = bytearray(cache.read_bytes())
    data[-12:] = np.array([np.nan] * 3, ">f4" if extension == "mdd" else "<f4").tobytes()
    cache.write_bytes(data)
    with pytest.raises(InvalidInputError, match=r"walk\..*vertex 10 of frame 4 has x = nan"):
        load(cache, topology=mesh)


def test_topology_option_is_rejected_for_other_formats(tmp_path):
    save(plain_sequence(), tmp_path / "a.npz")
    with pytest.raises(InvalidInputError, match=r"topology .* it is for \.pc2, \.mdd"):
        load(tmp_path / "a.npz", topology=tmp_path / "a.obj")
