"""Names that separate entries of an Alembic file; of some the library ends the process."""

import numpy as np
import pytest

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


def stored(tmp_path, attributes=(), groups=(), parts=(), tracks=None):
    """The sequence with these read back from an Alembic file, and the notes on writing it."""
    surface = Surface(None, tuple(attributes), tuple(groups), tuple(parts))
    notes = []
    sequence = MeshSequence(VERTICES, FACES, 24, "a", 0.0, surface, tracks or {})
    save(sequence, tmp_path / "a.abc", overwrite=True, notes=notes)
    return load(tmp_path / "a.abc"), notes


def renamed(what, name, called):
    return f"{what} {name!r} is called {called!r} in .abc files"


@pytest.mark.parametrize("name", ["a;b", "a=b", "a\0b", "a\udc80b"])
def test_texture_coordinates_are_renamed_when_metadata_cannot_hold_the_name(tmp_path, name):
    found, notes = stored(tmp_path, [attribute(name, Kind.UV)])
    assert [one.name for one in found.surface.attributes] == ["a_b"]
    assert notes == [renamed("attribute", name, "a_b")]
    found, notes = stored(tmp_path, tracks={name: track(2, kind="uv")})
    assert (list(found.tracks), notes) == (["a_b"], [renamed("track", name, "a_b")])


def test_texture_coordinates_get_a_number_when_the_new_name_is_taken(tmp_path):
    found, notes = stored(tmp_path, [attribute("a;b", Kind.UV), attribute("a_b")])
    assert [one.name for one in found.surface.attributes] == ["a_b_2", "a_b"]
    assert notes == [renamed("attribute", "a;b", "a_b_2")]


@pytest.mark.parametrize("name", ["a;b", "a=b", "a\x1bb"])
def test_names_stay_when_no_metadata_hold_them(tmp_path, name):
    found, notes = stored(
        tmp_path, [attribute(name)], [group("material", name, "c"), group("g", name)],
        [Part(name, 4, 2)], {f"{name} track": track()},
    )  # fmt: skip
    assert [one.name for one in found.surface.attributes] == [name]
    assert [one.labels for one in found.surface.groups] == [(name, "c"), (name,)]
    assert (found.name, list(found.tracks), notes) == (name, [f"{name} track"], [])


@pytest.mark.parametrize("name", ["a/b", "a\0b", "a\udc80b"])
def test_names_are_noted_when_they_change(tmp_path, name):
    found, notes = stored(
        tmp_path, [attribute(name)], [group("material", name, "c"), group(name, "d")]
    )
    assert [one.name for one in found.surface.attributes] == ["a_b"]
    assert [(one.name, one.labels) for one in found.surface.groups] == [
        ("material", ("a_b", "c")),
        ("a_b_2", ("d",)),
    ]
    assert notes == [
        renamed("attribute", name, "a_b"),
        renamed("material", name, "a_b"),
        renamed("group", name, "a_b_2"),
    ]


def test_names_of_all_kinds_are_written_when_they_are_the_same_but_for_slashes(tmp_path):
    found, _ = stored(
        tmp_path,
        [attribute("a/b"), attribute("a_b")],
        [group("a/b", "l"), group("a_b", "m")],
        tracks={"a/b": track(), "a_b": track(), "a;b": track()},
    )
    assert [one.name for one in found.surface.attributes] == ["a_b", "a_b_2"]
    assert [one.name for one in found.surface.groups] == ["a_b_3", "a_b_4"]
    assert set(found.tracks) == {"a/b", "a_b", "a;b"}


@pytest.mark.parametrize("text", ["a;b", "a=b", "a\0b"])
def test_units_and_labels_are_noted_when_they_change(tmp_path, text):
    found, notes = stored(tmp_path, groups=[group("g", "a\0b")], tracks={"t": track(unit=text)})
    assert (found.tracks["t"].unit, found.surface.groups[0].labels) == ("a_b", ("a_b",))
    assert notes == [renamed("label", "a\0b", "a_b"), renamed("unit", text, "a_b")]


def test_part_is_noted_when_its_name_changes(tmp_path):
    found, notes = stored(tmp_path, parts=[Part("a\0b", 4, 2)])
    assert (found.name, notes) == ("a_b", [renamed("part", "a\0b", "a_b")])
