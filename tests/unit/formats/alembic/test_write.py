import errno
import os

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.write import object_paths
from meshreel.formats.load import load
from meshreel.kernel.polygons import triangulate
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.model.tracks import Track
from meshreel.operations.save import save
from meshreel.runtime.extras import Extra
from samples.meshes import quad_sheet
from samples.surfaces import two_cubes

pytest.importorskip("alembic3d")

SIZES = np.array([4, 3, 5], np.int32)
CORNERS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 4, 6], np.int32)
N_ITEMS = {Domain.VERTEX: 8, Domain.FACE: 3, Domain.CORNER: 12}


def animated(n_frames=3, dtype=np.float32, surface=None, offset=0.0, **rest):
    vertices = np.random.default_rng(3).standard_normal((n_frames, 8, 3)) + offset
    faces, _ = triangulate(SIZES, CORNERS, vertices[0])
    return MeshSequence(vertices.astype(dtype), faces, surface=surface or Surface(SIZES), **rest)


def saved_and_loaded(path, sequence, notes=None, **choice):
    save(sequence, path, notes=notes)
    return load(path, **choice)


@pytest.mark.parametrize("domain", N_ITEMS)
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
def test_attributes_round_trip_exactly(tmp_path, domain, is_indexed, kind, width, dtype):
    rng, n_items = np.random.default_rng(width), N_ITEMS[domain]
    values = (rng.random((n_items, width)) * 200).astype(dtype)
    indices = rng.permutation(n_items).astype(np.int32) if is_indexed else None
    attributes = tuple(
        Attribute(name, kind, domain, values + np.ones(1, dtype) * number, indices)
        for number, name in enumerate(("first", "second"))
    )
    loaded = saved_and_loaded(tmp_path / "a.abc", animated(surface=Surface(SIZES, attributes)))
    for own, back in zip(attributes, loaded.surface.attributes, strict=True):
        assert (back.name, back.kind, back.domain) == (own.name, kind, domain)
        assert back.values.dtype == dtype
        np.testing.assert_array_equal(back.per_item(), own.per_item())
        assert (back.indices is None) == (own.indices is None)


def test_save_notes_the_conversion_of_byte_colors(tmp_path, notes):
    colors = np.arange(24, dtype=np.uint8).reshape(8, 3) * 10
    attribute = Attribute("Cd", Kind.COLOR, Domain.VERTEX, colors)
    sequence = animated(fps=24, surface=Surface(SIZES, (attribute,)))
    [back] = saved_and_loaded(tmp_path / "a.abc", sequence, notes).surface.attributes
    np.testing.assert_array_equal(back.values, (colors / 255).astype(np.float32))
    assert notes == ["color 'Cd' is written as float32, not uint8"]


def test_groups_round_trip_exactly(tmp_path):
    groups = (
        FaceGroups("material", ("red", "ö"), np.array([1, -1, 0], np.int32)),
        FaceGroups("layer", ("a", "b"), np.array([0, 1, -1], np.int32)),
        FaceGroups("group", ("all",), np.zeros(3, np.int32)),
    )
    loaded = saved_and_loaded(tmp_path / "a.abc", animated(surface=Surface(SIZES, groups=groups)))
    for own, back in zip(groups, loaded.surface.groups, strict=True):
        assert (back.name, back.labels) == (own.name, own.labels)
        np.testing.assert_array_equal(back.numbers, own.numbers)


def test_parts_round_trip_as_meshes(tmp_path):
    vertices = np.random.default_rng(0).standard_normal((2, 10, 3)).astype(np.float32)
    sizes = np.array([4, 3, 3], np.int32)
    faces, _ = triangulate(sizes, np.arange(10), vertices[0])
    parts = (Part("/root/a", 4, 1), Part("/root/b/c", 3, 1), Part("/root/b/d", 3, 1))
    colors = Attribute("Cd", Kind.COLOR, Domain.FACE, np.eye(3, dtype=np.float32))
    sequence = MeshSequence(vertices, faces, 24, surface=Surface(sizes, (colors,), (), parts))
    loaded = saved_and_loaded(tmp_path / "a.abc", sequence, merge=True)
    assert loaded.surface.parts == parts
    np.testing.assert_array_equal(loaded.vertices, vertices)
    np.testing.assert_array_equal(loaded.faces, faces)
    np.testing.assert_array_equal(loaded.surface.attributes[0].values, colors.values)
    alone = load(tmp_path / "a.abc", object="c")
    np.testing.assert_array_equal(alone.vertices, vertices[:, 4:7])


@pytest.mark.parametrize("has_limits", [True, False])
def test_save_refuses_to_start_without_enough_disk_space(tmp_path, monkeypatch, has_limits):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    usage = type("Usage", (), {"free": 100})
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage)
    monkeypatch.setattr("os.posix_fallocate", refuse, raising=False)
    if not has_limits:
        monkeypatch.delattr("os.posix_fallocate")
    with pytest.raises(
        InvalidInputError, match=r"a\.abc needs up to \d+ bytes .* not enough space"
    ):
        save(animated(), tmp_path / "a.abc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="needs posix_fallocate")
@pytest.mark.parametrize("sequence", [animated(1), animated(300), quad_sheet(), two_cubes(50)])
def test_saved_file_is_no_larger_than_the_space_checked(tmp_path, monkeypatch, sequence):
    allocated = []
    monkeypatch.setattr("os.posix_fallocate", lambda *args: allocated.append(args[2]))
    save(sequence, tmp_path / "a.abc")
    assert (tmp_path / "a.abc").stat().st_size <= allocated[0] < 500_000


def test_save_names_the_install_command_for_a_missing_library(tmp_path, monkeypatch):
    missing = Extra("alembic", "alembic3d", "no_such_module")
    monkeypatch.setattr("meshreel.formats.registry.SEQUENCE_FORMATS", {})
    monkeypatch.setattr("meshreel.formats.alembic.write.ALEMBIC", missing)
    with pytest.raises(FormatError, match=r"pip install 'meshreel\[alembic\]'"):
        save(animated(), tmp_path / "a.abc")


def test_save_is_deterministic(tmp_path):
    for name in ("a.abc", "b.abc"):
        save(animated(fps=24), tmp_path / name)
    assert (tmp_path / "a.abc").read_bytes() == (tmp_path / "b.abc").read_bytes()


VERTICES = np.random.default_rng(0).random((2, 4, 3)).astype(np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
LABEL_OF = np.array([0, 1], np.int32)


def attribute(name, kind=Kind.OTHER):
    width = 2 if kind is Kind.UV else 1
    return Attribute(name, kind, Domain.VERTEX, VERTICES[0, :, :width])


def group(name, *labels):
    return FaceGroups(name, labels, np.minimum(LABEL_OF, len(labels) - 1).astype(np.int32))


def track(width=1, **facts):
    return Track(VERTICES[:, :, :width], **facts)


def round_trip(tmp_path, attributes=(), groups=(), parts=(), tracks=None):
    """Return the sequence after a round trip through Alembic, and the notes on writing it."""
    surface = Surface(None, tuple(attributes), tuple(groups), tuple(parts))
    notes = []
    sequence = MeshSequence(VERTICES, FACES, 24, "a", 0.0, surface, tracks or {})
    save(sequence, tmp_path / "a.abc", overwrite=True, notes=notes)
    return load(tmp_path / "a.abc"), notes


def rename_note(kind, name, written_name):
    return f"{kind} {name!r} is called {written_name!r} in .abc files"


@pytest.mark.parametrize("name", ["a;b", "a=b", "a\0b", "a\udc80b"])
def test_reserved_characters_in_names_of_texture_coordinates_are_replaced(tmp_path, name):
    returned, notes = round_trip(tmp_path, [attribute(name, Kind.UV)])
    assert [one.name for one in returned.surface.attributes] == ["a_b"]
    assert notes == [rename_note("attribute", name, "a_b")]
    returned, notes = round_trip(tmp_path, tracks={name: track(2, kind="uv")})
    assert (list(returned.tracks), notes) == (["a_b"], [rename_note("track", name, "a_b")])


def test_cleaned_name_of_texture_coordinates_stays_unique(tmp_path):
    returned, notes = round_trip(tmp_path, [attribute("a;b", Kind.UV), attribute("a_b")])
    assert [one.name for one in returned.surface.attributes] == ["a_b_2", "a_b"]
    assert notes == [rename_note("attribute", "a;b", "a_b_2")]


@pytest.mark.parametrize("name", ["a;b", "a=b", "a\x1bb"])
def test_names_outside_metadata_keep_their_characters(tmp_path, name):
    returned, notes = round_trip(
        tmp_path, [attribute(name)], [group("material", name, "c"), group("g", name)],
        [Part(name, 4, 2)], {f"{name} track": track()},
    )  # fmt: skip
    assert [one.name for one in returned.surface.attributes] == [name]
    assert [one.labels for one in returned.surface.groups] == [(name, "c"), (name,)]
    assert (returned.name, list(returned.tracks), notes) == (name, [f"{name} track"], [])


@pytest.mark.parametrize("name", ["a/b", "a\0b", "a\udc80b"])
def test_changed_names_are_noted(tmp_path, name):
    returned, notes = round_trip(
        tmp_path, [attribute(name)], [group("material", name, "c"), group(name, "d")]
    )
    assert [one.name for one in returned.surface.attributes] == ["a_b"]
    assert [(one.name, one.labels) for one in returned.surface.groups] == [
        ("material", ("a_b", "c")),
        ("a_b_2", ("d",)),
    ]
    assert notes == [
        rename_note("attribute", name, "a_b"),
        rename_note("material", name, "a_b"),
        rename_note("group", name, "a_b_2"),
    ]


def test_names_that_differ_only_in_slashes_stay_distinct(tmp_path):
    returned, _ = round_trip(
        tmp_path,
        [attribute("a/b"), attribute("a_b")],
        [group("a/b", "l"), group("a_b", "m")],
        tracks={"a/b": track(), "a_b": track(), "a;b": track()},
    )
    assert [one.name for one in returned.surface.attributes] == ["a_b", "a_b_2"]
    assert [one.name for one in returned.surface.groups] == ["a_b_3", "a_b_4"]
    assert set(returned.tracks) == {"a/b", "a_b", "a;b"}


@pytest.mark.parametrize("text", ["a;b", "a=b", "a\0b"])
def test_changed_units_and_labels_are_noted(tmp_path, text):
    returned, notes = round_trip(
        tmp_path, groups=[group("g", "a\0b")], tracks={"t": track(unit=text)}
    )
    assert (returned.tracks["t"].unit, returned.surface.groups[0].labels) == ("a_b", ("a_b",))
    assert notes == [rename_note("label", "a\0b", "a_b"), rename_note("unit", text, "a_b")]


def test_changed_part_name_is_noted(tmp_path):
    returned, notes = round_trip(tmp_path, parts=[Part("a\0b", 4, 2)])
    assert (returned.name, notes) == ("a_b", [rename_note("part", "a\0b", "a_b")])


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["/root/body"], ["root/body"]),
        (["body"], ["body/body"]),
        (["", "//"], ["mesh/mesh", "mesh/mesh_2"]),
        (["/a/b", "/a/c"], ["a/b", "a/c"]),
        (["/a/b", "/a/b"], ["a/b", "a/b_2"]),
        (["/a/b", "/a/b/c"], ["a/b/b", "a/b/c"]),
        (["/a/b/b", "/a/b"], ["a/b/b", "a/b/b_2"]),
        (["a", "/a/a"], ["a/a", "a/a_2"]),
    ],
)
def test_object_paths_are_unique_and_have_a_transform(names, expected):
    assert ["/".join(path) for path in object_paths(names)] == expected
