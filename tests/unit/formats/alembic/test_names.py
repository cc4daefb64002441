"""Names with reserved characters, some of which make the Alembic library abort."""

import numpy as np
import pytest

from meshreel.formats.alembic.write import object_paths
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.model.tracks import Track

pytest.importorskip("alembic3d")

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
