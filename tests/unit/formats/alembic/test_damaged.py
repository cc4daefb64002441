"""Reading arbitrary bytes as an Alembic file returns a sequence or raises an error of meshreel."""

import struct
from functools import partial

import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples import alembic as sample
from samples.datasets import read_damaged


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A file with transforms, an instance, attributes and a face set."""
    path = tmp_path_factory.mktemp("alembic") / "whole.abc"
    top = sample.archive(path).getTop()
    operations = [("kRotateXOperation", 30.0), ("kTranslateOperation", sample.vector(1, 2, 3))]
    first = sample.add_transform(top, "first", [(operations, True)] * 2)
    mesh = sample.add_mesh(first, "m", [sample.POINTS, sample.POINTS * 2, sample.POINTS * 3])
    schema, scope = mesh.getSchema(), sample.AbcGeom.GeometryScope.kFacevaryingScope
    colors = sample.AbcGeom.OC3fGeomParamSample(sample.imath.C3fArray(8), scope)
    sample.AbcGeom.OC3fGeomParam(schema.getArbGeomParams(), "Cd", False, scope, 1).set(colors)
    faces = sample.AbcGeom.OFaceSetSchemaSample(sample.int_array([1]))
    schema.createFaceSet("red").getSchema().set(faces)
    top.addChildInstance(first, "again")
    del top, first, mesh, schema
    return path.read_bytes()


def test_load_reads_the_undamaged_file(tmp_path, whole):
    (tmp_path / "a.abc").write_bytes(whole)
    loaded = load(tmp_path / "a.abc", merge=True)
    assert [part.name for part in loaded.surface.parts] == ["/first/m", "/again/m"]


@pytest.mark.parametrize("keep", [0, 1, 5, 15, 16, 40, 500, -500, -1])
def test_load_describes_the_damage_of_a_truncated_file(tmp_path, whole, keep):
    (tmp_path / "a.abc").write_bytes(whole[:keep])
    with pytest.raises(FormatError, match=r"a\.abc: is (damaged|not an Alembic file)"):
        load(tmp_path / "a.abc", merge=True)


@pytest.mark.slow
def test_load_raises_only_our_errors_for_changed_bytes(tmp_path, whole):
    (tmp_path / "a.abc").write_bytes(whole)
    merged = partial(load, merge=True)
    read_damaged(tmp_path / "a.abc", 1000, n_header=len(whole), readers=(merged,))


def test_load_rejects_a_file_that_was_not_completely_written(tmp_path, whole):
    (tmp_path / "a.abc").write_bytes(whole[:5] + b"\0" + whole[6:])
    with pytest.raises(
        FormatError, match=r"a\.abc: is an Alembic file that was not completely written"
    ):
        load(tmp_path / "a.abc")


def test_load_rejects_a_group_larger_than_the_file(tmp_path, whole):
    (root,) = struct.unpack_from("<Q", whole, 8)
    many = whole[:root] + struct.pack("<Q", 1 << 60) + whole[root + 8 :]
    (tmp_path / "a.abc").write_bytes(many)
    with pytest.raises(FormatError, match=f"the block at byte {root} ends after the end"):
        load(tmp_path / "a.abc")


def test_load_rejects_an_object_that_contains_itself(tmp_path, whole):
    root = struct.unpack_from("<Q", whole, 8)[0]
    top = struct.unpack_from("<Q", whole, root + 8 + 8 * 2)[0]
    damaged = bytearray(whole)
    struct.pack_into("<Q", damaged, top + 8 + 8, top)  # first child of the root
    (tmp_path / "a.abc").write_bytes(damaged)
    with pytest.raises(FormatError, match=r"a\.abc: is damaged: /first contains itself"):
        load(tmp_path / "a.abc")
