"""Meshes, transforms and times of Alembic files, and files of arbitrary bytes."""

import struct
from functools import partial

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.archive import TimeSampling
from meshreel.formats.load import load
from meshreel.model.geometry.polygons import join_triangles
from samples import alembic as sample
from samples.datasets import read_damaged
from samples.opening import open_source

MOVES = [sample.POINTS, sample.POINTS * 2, sample.POINTS * 4]


NO_MESH = r"a\.abc: contains no mesh, only NURBS patches \(1\), cameras \(2\), point clouds \(1\);"


def polygons(sequence):
    sizes = sequence.surface.sizes(sequence.n_faces)
    return np.split(join_triangles(sizes, sequence.faces), np.cumsum(sizes)[:-1])


@pytest.mark.parametrize(
    ("sampling", "fps", "start_s"),
    [
        (sample.uniform(1 / 24, 0.0), 24.0, 0.0),
        (sample.uniform(1 / 25, -0.48), 25.0, -0.48),
        (sample.uniform(1 / 29.97, 3.5), 29.97, 3.5),
        (sample.uniform(1 / 60, 1001 / 60), 60.0, 1001 / 60),
        (sample.acyclic([2.0, 2.5, 3.0]), 2.0, 2.0),
        (sample.cyclic(1.0, [0.25, 0.75]), 2.0, 0.25),
    ],
)
def test_load_derives_frame_rate_and_start_from_even_times(tmp_path, sampling, fps, start_s):
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES, sampling)
    loaded = load(tmp_path / "a.abc")
    assert (loaded.fps, loaded.start_s) == (fps, start_s)
    np.testing.assert_array_equal(loaded.vertices, MOVES)


def test_load_returns_one_frame_of_a_constant_mesh(tmp_path):
    frames, sampling = [sample.POINTS] * 5, sample.uniform(1 / 24, 1.0)
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", frames, sampling)
    loaded = load(tmp_path / "a.abc")
    assert (loaded.n_frames, loaded.fps, loaded.start_s) == (1, 24.0, 1.0)


def test_load_keeps_repeated_frames_before_and_after_a_motion(tmp_path):
    frames = [MOVES[number] for number in (0, 0, 0, 1, 2, 2, 2)]
    sampling = sample.uniform(1 / 24, 0.0)
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", frames, sampling)
    np.testing.assert_array_equal(load(tmp_path / "a.abc").vertices, frames)


def test_load_reverses_the_clockwise_faces_of_the_file(tmp_path):
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES)
    results = [polygon.tolist() for polygon in polygons(load(tmp_path / "a.abc"))]
    assert results == [[3, 2, 1, 0], [5, 4, 2, 3]]


def test_load_reads_the_cage_of_a_subdivision_surface(tmp_path, notes):
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES, kind="SubD")
    np.testing.assert_array_equal(load(tmp_path / "a.abc", notes=notes).vertices, MOVES)
    assert "left out: subdivision, whose cages are read: /m" in notes


def test_load_rejects_more_objects_than_the_limit(tmp_path, monkeypatch):
    sample.add_mesh(parent := sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES)
    sample.add_mesh(parent, "n", MOVES)
    del parent
    monkeypatch.setattr("meshreel.formats.alembic.meshes.MAX_OBJECTS", 2)
    assert load(tmp_path / "a.abc", merge=True).n_frames == len(MOVES)
    monkeypatch.setattr("meshreel.formats.alembic.meshes.MAX_OBJECTS", 1)
    with pytest.raises(FormatError, match="contains more than 1 objects"):
        load(tmp_path / "a.abc")


def test_load_rejects_a_hierarchy_that_is_too_deep(tmp_path):
    parent = sample.archive(tmp_path / "a.abc").getTop()
    for _ in range(300):
        parent = sample.add_transform(parent, "t", [])
    del parent
    with pytest.raises(FormatError, match="t below more than 256 objects; flatten it"):
        load(tmp_path / "a.abc")


def test_load_transforms_instances(tmp_path):
    top = sample.archive(tmp_path / "a.abc").getTop()
    shift = [([("kTranslateOperation", sample.vector(5, 0, 0))], True)]
    first = sample.add_transform(top, "first", shift)
    sample.add_mesh(first, "body", MOVES[:1])
    second = sample.add_transform(
        top, "second", [([("kScaleOperation", sample.vector(2, 2, 2))], True)]
    )
    second.addChildInstance(first, "again")
    del top, first, second
    loaded = load(tmp_path / "a.abc", merge=True)
    assert [part.name for part in loaded.surface.parts] == ["/first/body", "/second/again/body"]
    expected = sample.POINTS + np.float32([5, 0, 0])
    np.testing.assert_array_equal(loaded.vertices[0], np.concatenate([expected, 2 * expected]))


def test_segment_begins_with_the_frame_in_which_faces_change(tmp_path):
    faces = [sample.QUADS, sample.QUADS, sample.QUADS[:1]]
    sampling = sample.uniform(1 / 24, 0.0)
    sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES, sampling, faces)
    segments = load(tmp_path / "a.abc").segments
    assert [(one.n_frames, len(one.faces)) for one in segments] == [(2, 4), (1, 2)]


def test_load_lists_the_contents_of_a_file_without_meshes(tmp_path):
    top = sample.archive(tmp_path / "a.abc").getTop()
    for name, kind in (("c", "Camera"), ("d", "Camera"), ("p", "Points"), ("n", "NuPatch")):
        getattr(sample.AbcGeom, f"O{kind}")(top, name)
    del top
    with pytest.raises(FormatError, match=NO_MESH):
        load(tmp_path / "a.abc")


def test_load_explains_how_to_convert_an_hdf5_archive(tmp_path):
    (tmp_path / "a.abc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    with pytest.raises(FormatError, match=r"a\.abc: is an Alembic file of the older HDF5 kind;"):
        load(tmp_path / "a.abc")


def test_overlapping_face_sets_become_separate_groups(tmp_path):
    mesh = sample.add_mesh(sample.archive(tmp_path / "a.abc").getTop(), "m", MOVES)
    for name, faces in (("red", [0]), ("blue", [1]), ("all", [0, 1])):
        chosen = sample.AbcGeom.OFaceSetSchemaSample(sample.int_array(faces))
        mesh.getSchema().createFaceSet(name).getSchema().set(chosen)
    del mesh
    result = load(tmp_path / "a.abc").surface.groups
    assert [(one.name, one.labels, one.numbers.tolist()) for one in result] == [
        ("material", ("red", "blue"), [0, 1]),
        ("all", ("all",), [0, 0]),
    ]


def test_open_source_detects_that_the_file_changed(tmp_path):
    path = tmp_path / "a.abc"
    sample.add_mesh(sample.archive(path).getTop(), "m", MOVES)
    opened = open_source(path)
    np.testing.assert_array_equal(opened.read(1, 3), MOVES[1:])
    data = path.read_bytes()
    path.write_bytes(data.replace(MOVES[2].tobytes(), (MOVES[2] + 1).tobytes()))
    np.testing.assert_array_equal(opened.read(0, 2), MOVES[:2])
    with pytest.raises(InvalidInputError, match=r"a\.abc changed after it was first read"):
        opened.read(2, 3)
    path.write_bytes(data[:100])
    with pytest.raises(InvalidInputError, match=r"a\.abc changed after it was first read"):
        opened.read(0, 1)


def write_late_transform(path):
    """Write points sampled up to 7/30 s at 30 fps, below a transform that moves until 0.25 s."""
    moves = [([("kTranslateOperation", sample.vector(x, 0, 0))], True) for x in (0, 6)]
    top = sample.archive(path).getTop()
    moved = sample.add_transform(top, "x", moves, sample.acyclic([0.0, 0.25]))
    frames = [sample.POINTS] * 7 + [sample.POINTS * 2]
    sample.add_mesh(moved, "m", frames, sample.uniform(1 / 30, 0))


def test_load_keeps_the_final_pose_of_a_transform_between_two_point_samples(tmp_path, notes):
    write_late_transform(tmp_path / "a.abc")
    loaded = load(tmp_path / "a.abc", notes=notes)
    np.testing.assert_allclose(loaded.vertices[-1], sample.POINTS * 2 + np.float32([6, 0, 0]))
    np.testing.assert_allclose(loaded.times, [*np.arange(8) / 30, 0.25])
    assert (loaded.n_frames, loaded.fps, notes) == (9, 32, [])


TIMES = np.array([1.0, 2.0, 4.0])


def test_uniform_times_are_evenly_spaced():
    result = TimeSampling(np.array([0.5]), 0.25).times(4)
    np.testing.assert_array_equal(result, [0.5, 0.75, 1.0, 1.25])


def test_cyclic_times_repeat():
    result = TimeSampling(np.array([0.0, 0.1]), 1.0).times(5)
    np.testing.assert_array_equal(result, [0.0, 0.1, 1.0, 1.1, 2.0])


def test_acyclic_times_are_the_first_stored():
    np.testing.assert_array_equal(TimeSampling(TIMES, None).times(2), [1.0, 2.0])


@pytest.mark.parametrize(
    ("sampling", "n_samples", "message"),
    [
        (TimeSampling(TIMES, None), 4, "it lists 3 times for 4 samples"),
        (TimeSampling(TIMES[::-1], None), 3, "do not ascend"),
        (TimeSampling(np.array([0.0]), -1.0), 2, "do not ascend"),
        (TimeSampling(np.array([np.nan]), 1.0), 1, "do not ascend"),
        (TimeSampling(np.array([0.0]), 1e308), 1000, "do not ascend"),
        (TimeSampling(np.array([0.0]), 1e-300), 10, "10 samples span only 9e-300 s"),
    ],
)
def test_implausible_times_are_rejected(sampling, n_samples, message):
    with pytest.raises(FormatError, match=message):
        sampling.times(n_samples)


OPERATIONS = {
    "translate": ("kTranslateOperation", sample.vector(1.5, -2, 3)),
    "scale": ("kScaleOperation", sample.vector(2, 0.5, -1)),
    "rotate": ("kRotateOperation", sample.vector(1, 2, 3), 40.0),
    "rotate_x": ("kRotateXOperation", 30.0),
    "rotate_y": ("kRotateYOperation", -75.0),
    "rotate_z": ("kRotateZOperation", 200.0),
    "matrix": (
        "kMatrixOperation",
        sample.matrix([[1, 0.5, 0, 0], [0, 2, 0.25, 0], [0.1, 0, 1, 0], [7, 8, 9, 1]]),
    ),
}


def write_below_transforms(path, chain, frames=(sample.POINTS,), sampling=None):
    """Write a mesh below a chain of transforms, each a pair of samples and a time sampling."""
    parent = sample.archive(path).getTop()
    for number, (samples, own) in enumerate(chain):
        parent = sample.add_transform(parent, f"t{number}", samples, own)
    sample.add_mesh(parent, "mesh", frames, sampling)
    return path


def library_positions(path):
    [(points, world)] = sample.library_meshes(path).values()
    return (points.astype(float) @ world[:3, :3] + world[3, :3]).astype(np.float32)


def assert_close(found, expected):
    """Allow for the last bit of float32, since sums may be in another order."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", OPERATIONS)
def test_load_applies_each_transform_operation_like_the_library(tmp_path, name):
    path = write_below_transforms(tmp_path / "a.abc", [([([OPERATIONS[name]], True)], None)])
    assert_close(load(path).vertices[0], library_positions(path))


def test_load_applies_nested_transforms_like_the_library(tmp_path):
    every = list(OPERATIONS.values())
    chain = [([(every, True)], None), ([(every[::-1], True)], None), ([], None)]
    path = write_below_transforms(tmp_path / "a.abc", chain)
    np.testing.assert_allclose(load(path).vertices[0], library_positions(path), rtol=1e-6)


def test_transform_that_does_not_inherit_ignores_its_parents(tmp_path):
    chain = [([([OPERATIONS["scale"]], True)], None), ([([OPERATIONS["translate"]], False)], None)]
    loaded = load(write_below_transforms(tmp_path / "a.abc", chain))
    np.testing.assert_array_equal(loaded.vertices[0], sample.POINTS + np.float32([1.5, -2, 3]))


def test_load_has_a_frame_at_every_sample_of_points_and_transforms(tmp_path):
    right = [([("kTranslateOperation", sample.vector(x, 0, 0))], True) for x in (0, 2)]
    up = [([("kTranslateOperation", sample.vector(0, 0, z))], True) for z in (0, 1, 2)]
    chain = [(right, sample.uniform(2.0, 0.0)), (up, sample.acyclic([0.5, 1.0, 3.0]))]
    frames = [sample.POINTS, sample.POINTS + np.float32([0, 8, 0])]
    path = write_below_transforms(tmp_path / "a.abc", chain, frames, sample.uniform(2.0, 1.0))
    loaded = load(path)
    times = np.array([0, 0.5, 1, 2, 3])
    shift = [np.interp(times, [0, 2], [0, 2]), np.interp(times, [1, 3], [0, 8])]
    shift.append(np.interp(times, [0.5, 1, 3], [0, 1, 2]))
    expected = sample.POINTS + np.stack(shift, axis=1)[:, np.newaxis]
    np.testing.assert_array_equal(loaded.vertices, expected.astype(np.float32))


def test_load_interpolates_rotations_spherically_and_stretches_linearly(tmp_path):
    turning = [
        ([("kMatrixOperation", sample.matrix(np.diag([x, 3, 1, 1]) @ rotation_z(angle)))], True)
        for x, angle in ((2, 0), (6, 90))
    ]
    frames = [sample.POINTS, sample.POINTS + 1, *[sample.POINTS] * 3]
    chain = [(turning, sample.uniform(4.0, 0.0))]
    path = write_below_transforms(tmp_path / "a.abc", chain, frames, sample.uniform(1.0, 0.0))
    quarter = (sample.POINTS + 1.0) @ (np.diag([3, 3, 1, 1]) @ rotation_z(22.5))[:3, :3]
    assert_close(load(path).vertices[1], quarter)


def test_load_returns_float64_for_a_mesh_moved_far_from_the_origin(tmp_path):
    far = [([("kTranslateOperation", sample.vector(1e7 + 0.25, 0, 0))], True)]
    loaded = load(write_below_transforms(tmp_path / "a.abc", [(far, None)]))
    assert loaded.vertices.dtype == np.float64
    np.testing.assert_array_equal(loaded.vertices[0], sample.POINTS + np.array([1e7 + 0.25, 0, 0]))


def rotation_z(angle_deg):
    """Return the rotation of row vectors about the z axis."""
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    matrix = np.eye(4)
    matrix[:2, :2] = [[cosine, sine], [-sine, cosine]]
    return matrix


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
    with pytest.raises(FormatError, match=r"a\.abc: is (damaged|empty|not an Alembic file)"):
        load(tmp_path / "a.abc", merge=True)


@pytest.mark.damaged
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
