import errno
import os

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.extras import Extra
from meshreel.formats.load import load, open_source
from meshreel.formats.save import save
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from samples.meshes import quad_sheet
from samples.surfaces import two_cubes

pytest.importorskip("alembic3d")

SIZES = np.array([4, 3, 5], np.int32)
CORNERS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 4, 6], np.int32)
FACES = triangulate_fans(SIZES, CORNERS)
N_ITEMS = {Domain.VERTEX: 8, Domain.FACE: 3, Domain.CORNER: 12}


def moving(n_frames=3, dtype=np.float32, surface=None, offset=0.0, **rest):
    vertices = np.random.default_rng(3).standard_normal((n_frames, 8, 3)) + offset
    return MeshSequence(vertices.astype(dtype), FACES, surface=surface or Surface(SIZES), **rest)


def saved_and_loaded(path, sequence, notes=None, **choice):
    save(sequence, path, notes=notes)
    return load(path, **choice)


def test_load_gives_back_positions_and_polygons_exactly_when_save_wrote_them(tmp_path):
    sequence = moving(name="Ödipus")
    found = saved_and_loaded(tmp_path / "a.abc", sequence)
    assert found.vertices.dtype == np.float32
    np.testing.assert_array_equal(found.vertices, sequence.vertices)
    np.testing.assert_array_equal(found.faces, FACES)
    np.testing.assert_array_equal(found.surface.face_sizes, SIZES)
    assert found.name == "Ödipus"


def test_open_source_gives_back_positions_exactly_when_they_stay_in_the_file(tmp_path):
    sequence = moving(5, fps=24)
    save(sequence, tmp_path / "a.abc")
    found = open_source(tmp_path / "a.abc", max_loaded_bytes=0)
    assert not isinstance(found, MeshSequence)
    np.testing.assert_array_equal(found.read(1, 4), sequence.vertices[1:4])


@pytest.mark.parametrize("fps", [12.5, 24.0, 25.0, 29.97, 30000 / 1001, 60.0])
@pytest.mark.parametrize("start_s", [0.0, -1.25, 3.5, 1001 / 24])
def test_load_gives_back_rate_and_start_when_save_wrote_them(tmp_path, fps, start_s):
    found = saved_and_loaded(tmp_path / "a.abc", moving(fps=fps, start_s=start_s))
    assert (found.fps, found.start_s) == (fps, start_s)


@pytest.mark.parametrize(("fps", "start_s"), [(0.0, 0.0), (0.0, 2.5), (24.0, 2.5)])
def test_load_gives_back_a_single_frame_when_save_wrote_one(tmp_path, fps, start_s):
    sequence, notes = moving(1, fps=fps, start_s=start_s), []
    found = saved_and_loaded(tmp_path / "a.abc", sequence, notes)
    assert (found.n_frames, found.fps, found.start_s, notes) == (1, fps, start_s, [])
    np.testing.assert_array_equal(found.vertices, sequence.vertices)


def test_save_assumes_24_frames_per_second_when_the_rate_is_not_known(tmp_path):
    notes = []
    assert saved_and_loaded(tmp_path / "a.abc", moving(), notes).fps == 24
    assert notes == ["the frame rate is not known; written as 24 frames per second"]


@pytest.mark.parametrize("domain", Domain)
@pytest.mark.parametrize("is_indexed", [False, True])
@pytest.mark.parametrize(
    ("kind", "width", "dtype"),
    [
        (Kind.UV, 2, np.float32),
        (Kind.COLOR, 3, np.float32),
        (Kind.COLOR, 4, np.float32),
        (Kind.OTHER, 1, np.uint8),
        (Kind.OTHER, 2, np.float32),
        (Kind.OTHER, 3, np.int32),
        (Kind.OTHER, 16, np.float64),
    ],
)
def test_load_gives_back_attributes_exactly_when_save_wrote_them(
    tmp_path, domain, is_indexed, kind, width, dtype
):
    rng, n_items = np.random.default_rng(width), N_ITEMS[domain]
    values = (rng.random((n_items, width)) * 200).astype(dtype)
    indices = rng.permutation(n_items).astype(np.int32) if is_indexed else None
    attributes = tuple(
        Attribute(name, kind, domain, values + np.ones(1, dtype) * number, indices)
        for number, name in enumerate(("first", "second"))
    )
    found = saved_and_loaded(tmp_path / "a.abc", moving(surface=Surface(SIZES, attributes)))
    for own, back in zip(attributes, found.surface.attributes, strict=True):
        assert (back.name, back.kind, back.domain) == (own.name, kind, domain)
        assert back.values.dtype == dtype
        np.testing.assert_array_equal(back.per_item(), own.per_item())
        assert (back.indices is None) == (own.indices is None)


def test_save_leaves_a_note_when_colours_are_bytes(tmp_path):
    colours = np.arange(24, dtype=np.uint8).reshape(8, 3) * 10
    attribute = Attribute("Cd", Kind.COLOR, Domain.VERTEX, colours)
    notes = []
    sequence = moving(fps=24, surface=Surface(SIZES, (attribute,)))
    [back] = saved_and_loaded(tmp_path / "a.abc", sequence, notes).surface.attributes
    np.testing.assert_array_equal(back.values, (colours / 255).astype(np.float32))
    assert notes == ["color 'Cd' is written as float32, not uint8"]


def test_load_gives_back_groups_exactly_when_save_wrote_them(tmp_path):
    groups = (
        FaceGroups("material", ("red", "ö"), np.array([1, -1, 0], np.int32)),
        FaceGroups("layer", ("a", "b"), np.array([0, 1, -1], np.int32)),
        FaceGroups("group", ("all",), np.zeros(3, np.int32)),
    )
    found = saved_and_loaded(tmp_path / "a.abc", moving(surface=Surface(SIZES, groups=groups)))
    for own, back in zip(groups, found.surface.groups, strict=True):
        assert (back.name, back.labels) == (own.name, own.labels)
        np.testing.assert_array_equal(back.numbers, own.numbers)


def test_load_gives_back_parts_as_meshes_when_save_wrote_them(tmp_path):
    vertices = np.random.default_rng(0).standard_normal((2, 10, 3)).astype(np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9]])
    sizes = np.array([4, 3, 3], np.int32)
    parts = (Part("/root/a", 4, 1), Part("/root/b/c", 3, 1), Part("/root/b/d", 3, 1))
    colours = Attribute("Cd", Kind.COLOR, Domain.FACE, np.eye(3, dtype=np.float32))
    sequence = MeshSequence(vertices, faces, 24, surface=Surface(sizes, (colours,), (), parts))
    found = saved_and_loaded(tmp_path / "a.abc", sequence, merge=True)
    assert found.surface.parts == parts
    np.testing.assert_array_equal(found.vertices, vertices)
    np.testing.assert_array_equal(found.faces, faces)
    np.testing.assert_array_equal(found.surface.attributes[0].values, colours.values)
    alone = load(tmp_path / "a.abc", object="c")
    np.testing.assert_array_equal(alone.vertices, vertices[:, 4:7])


def test_save_notes_the_rounding_when_positions_are_float64(tmp_path):
    sequence, notes = moving(dtype=np.float64, fps=24), []
    found = saved_and_loaded(tmp_path / "a.abc", sequence, notes)
    np.testing.assert_array_equal(found.vertices, sequence.vertices.astype(np.float32))
    error = np.abs(found.vertices - sequence.vertices).max()
    assert notes == [
        f"positions in an Alembic file are float32: coordinates are off by up to {error:.2g}"
    ]


def test_save_keeps_float64_near_a_millionth_of_its_size_when_it_is_far_away(tmp_path):
    sequence, notes = moving(dtype=np.float64, offset=[3e8, -4e8, 0.5], fps=24), []
    found = saved_and_loaded(tmp_path / "a.abc", sequence, notes)
    assert found.vertices.dtype == np.float64
    assert np.abs(found.vertices - sequence.vertices).max() < 3e-7
    assert notes[0].startswith("positions in an Alembic file are float32, beside the middle of")


def test_save_writes_float32_as_it_is_when_it_is_far_away(tmp_path):
    sequence, notes = moving(offset=1e6, fps=24), []
    found = saved_and_loaded(tmp_path / "a.abc", sequence, notes)
    np.testing.assert_array_equal(found.vertices, sequence.vertices)
    assert notes == []


def test_save_refuses_positions_when_float32_cannot_hold_them(tmp_path):
    vertices = np.zeros((1, 8, 3))
    vertices[0, 0], vertices[0, 1] = 1e300, -1e300
    with pytest.raises(InvalidInputError, match=r"go up to 3\.4e\+38; got 1e\+300; scale"):
        save(MeshSequence(vertices, FACES, surface=Surface(SIZES)), tmp_path / "a.abc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("has_limits", [True, False])
def test_save_refuses_to_begin_when_the_disk_is_too_small(tmp_path, monkeypatch, has_limits):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    usage = type("Usage", (), {"free": 100})
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    monkeypatch.setattr("os.posix_fallocate", refuse, raising=False)
    if not has_limits:
        monkeypatch.delattr("os.posix_fallocate")
    with pytest.raises(InvalidInputError, match=r"a\.abc takes up to \d+ bytes .* is no room"):
        save(moving(), tmp_path / "a.abc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room is not taken here")
@pytest.mark.parametrize("sequence", [moving(1), moving(300), quad_sheet(), two_cubes(50)])
def test_save_takes_no_more_room_than_it_tried_when_it_writes(tmp_path, monkeypatch, sequence):
    tried = []
    monkeypatch.setattr("os.posix_fallocate", lambda *of: tried.append(of[2]))
    save(sequence, tmp_path / "a.abc")
    assert (tmp_path / "a.abc").stat().st_size <= tried[0] < 500_000


def test_save_names_the_command_when_the_library_is_not_installed(tmp_path, monkeypatch):
    missing = Extra("alembic", "alembic3d", "no_such_module")
    monkeypatch.setattr("meshreel.formats.registry.SEQUENCE_FORMATS", {})
    monkeypatch.setattr("meshreel.formats.alembic.write.ALEMBIC", missing)
    with pytest.raises(FormatError, match=r"pip install 'meshreel\[alembic\]'"):
        save(moving(), tmp_path / "a.abc")


def test_save_writes_the_same_bytes_when_it_is_called_twice(tmp_path):
    for name in ("a.abc", "b.abc"):
        save(moving(fps=24), tmp_path / name)
    assert (tmp_path / "a.abc").read_bytes() == (tmp_path / "b.abc").read_bytes()
