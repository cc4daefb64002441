"""Animated properties of Alembic meshes, read and written as tracks."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("alembic3d")
import imath
from alembic3d import Abc, AbcGeom

from meshreel.formats.load import load
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import Track, domain_sizes
from meshreel.operations.save import save
from samples import alembic as sample
from samples.meshes import quad_sheet
from samples.tracks import assert_same_tracks, tracked_sheet

RNG = np.random.default_rng(9)
N_FRAMES = 3
MOVES = RNG.normal(size=(N_FRAMES, 6, 3)).astype(np.float32)
REVERSED = [3, 2, 1, 0, 7, 6, 5, 4]
"""Corner permutation between the file, whose faces are clockwise, and meshreel."""

SCOPES = {"Vertex": ("vertex", 6), "Varying": ("vertex", 6), "Uniform": ("face", 2),
          "Facevarying": ("corner", 8)}  # fmt: skip


def scope(name):
    return getattr(AbcGeom.GeometryScope, f"k{name}Scope")


def array_of(kind, values):
    if kind[0] == "C":
        array = getattr(imath, f"{kind}Array")(len(values))
        for channel, numbers in zip("rgba", values.T, strict=False):
            np.asarray(getattr(array, channel))[:] = numbers
        return array
    name = {"N3f": "V3f"}.get(kind, kind)
    return getattr(imath, f"{name}ArrayFromBuffer")(np.ascontiguousarray(values))


def add_param(parent, kind, name, values, scope_name, sampling):
    """Add a property with a sample for each entry of values."""
    param = getattr(AbcGeom, f"O{kind}GeomParam")(
        parent, name, False, scope(scope_name), 1, Abc.Argument(sampling)
    )
    for value in values:
        made = getattr(AbcGeom, f"O{kind}GeomParamSample")()
        made.setVals(array_of({"Int32": "Int"}.get(kind, kind), value))
        made.setScope(scope(scope_name))
        param.set(made)


def file_with(path, *params, frames=MOVES, step_s=0.1):
    """Write an animated mesh at 10 frames per second, with properties of arguments of add_param."""
    archive = sample.archive(path)
    at_frames, sampling = (
        archive.addTimeSampling(sample.uniform(step, 0.0)) for step in (0.1, step_s)
    )
    schema = sample.add_mesh(archive.getTop(), "m", frames, at_frames).getSchema()
    for kind, name, values, scope_name in params:
        add_param(schema.getArbGeomParams(), kind, name, values, scope_name, sampling)
    return path


@pytest.mark.parametrize("scope_name", SCOPES)
@pytest.mark.parametrize(
    ("kind", "dtype", "width", "track_kind"),
    [
        ("Float", "f4", 1, "scalar"),
        ("Double", "f8", 1, "scalar"),
        ("Int32", "i4", 1, "scalar"),
        ("V3f", "f4", 3, "vector"),
        ("V3d", "f8", 3, "vector"),
        ("V2f", "f4", 2, "uv"),
        ("C3f", "f4", 3, "color"),
        ("C4f", "f4", 4, "color"),
    ],
)
def test_animated_parameters_become_tracks(
    tmp_path, read, scope_name, kind, dtype, width, track_kind
):
    domain, n_items = SCOPES[scope_name]
    values = (100 * RNG.random((N_FRAMES, n_items, width))).astype(dtype)
    param = kind, "stuff", values[..., 0] if width == 1 else values, scope_name
    notes = []
    result = read(file_with(tmp_path / "a.abc", param), notes=notes)
    [(name, track)] = result.tracks.items()
    assert (name, track.kind, track.domain) == ("stuff", track_kind, domain)
    expected = values[:, REVERSED] if domain == "corner" else values
    assert track.read(0, N_FRAMES).tobytes() == np.ascontiguousarray(expected).tobytes()
    assert result.surface.attributes == ()
    assert notes == []


def test_constant_parameters_become_attributes(tmp_path):
    values = np.tile(RNG.random(6).astype(np.float32), (N_FRAMES, 1))
    changing = values * np.float32([[1], [2], [3]])
    named = {"heat": values, "weight": values[:1], "speed": changing}
    params = [("Float", name, samples, "Vertex") for name, samples in named.items()]
    loaded = load(file_with(tmp_path / "a.abc", *params))
    assert list(loaded.tracks) == ["speed"]
    assert [attribute.name for attribute in loaded.surface.attributes] == ["heat", "weight"]
    for attribute in loaded.surface.attributes:
        assert (attribute.kind, attribute.domain) == (Kind.OTHER, Domain.VERTEX)
        np.testing.assert_array_equal(attribute.values, values[0][:, np.newaxis])


def test_values_are_interpolated_at_frames_between_samples(tmp_path):
    heat, paint = (RNG.random((2, 6, *rest)).astype(np.float32) for rest in ((), (3,)))
    params = ("Float", "heat", heat, "Vertex"), ("C3f", "paint", paint, "Vertex")
    tracks = load(file_with(tmp_path / "a.abc", *params, step_s=0.2)).tracks
    middle = heat.astype(float).mean(axis=0).astype(np.float32)
    np.testing.assert_allclose(tracks["heat"][:, :, 0], [heat[0], middle, heat[1]], rtol=1e-6)
    assert np.array_equal(tracks["paint"].values, paint[[0, 0, 1]])


def test_static_mesh_has_the_frames_of_its_animated_colors(tmp_path):
    paint = RNG.random((5, 6, 3)).astype(np.float32)
    param = "C3f", "Cd", paint, "Vertex"
    loaded = load(file_with(tmp_path / "a.abc", param, frames=MOVES[:1]))
    assert (loaded.n_frames, loaded.fps) == (5, 10)
    assert np.array_equal(loaded.vertices, np.tile(MOVES[:1], (5, 1, 1)))
    assert np.array_equal(loaded.tracks["Cd"].values, paint)


def test_note_names_samples_that_no_frame_has(tmp_path, notes):
    param = "Float", "heat", RNG.random((7, 6)).astype(np.float32), "Vertex"
    load(file_with(tmp_path / "a.abc", param, step_s=0.05), notes=notes)
    assert notes == ["left out: samples where positions have no frame: heat (4 of 7)"]


def test_values_are_nan_in_frames_where_they_do_not_fit(tmp_path, notes):
    heat = [np.ones(6, np.float32), np.zeros(5, np.float32), np.full(6, 2, np.float32)]
    bad = RNG.random((3, 5)).astype("f4")
    params = ("Float", "heat", heat, "Vertex"), ("Float", "bad", bad, "Vertex")
    [(name, track)] = load(file_with(tmp_path / "a.abc", *params), notes=notes).tracks.items()
    assert name == "heat"
    assert np.isnan(track[1]).all()
    assert (track[0] == 1).all()
    assert (track[2] == 2).all()
    assert notes == [
        "left out: properties that do not fit the faces: bad",
        "'heat' is in 2 of 3 frames, and NaN in the others",
    ]


def test_normals_and_velocities_are_transformed_with_the_mesh(tmp_path, notes):
    normals, speeds = RNG.normal(size=(2, N_FRAMES, 6, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    linear = np.array([[0, 2, 0], [-1, 0, 0], [0, 0, 3.0]])
    rows = np.eye(4)
    rows[:3, :3], rows[3, :3] = linear, [5, 6, 7]
    path = tmp_path / "a.abc"
    archive = sample.archive(path)
    transform = [([("kMatrixOperation", sample.matrix(rows))], True)]
    above = sample.add_transform(archive.getTop(), "t", transform)
    mesh = AbcGeom.OPolyMesh(above, "m")
    mesh.getSchema().setTimeSampling(sample.uniform(0.1, 0.0))
    for frame in range(N_FRAMES):
        made = AbcGeom.OPolyMeshSchemaSample()
        made.setPositions(sample.points_array(MOVES[frame]))
        made.setFaceIndices(sample.int_array(sample.QUADS.ravel()))
        made.setFaceCounts(sample.int_array([4, 4]))
        made.setVelocities(sample.points_array(speeds[frame]))
        own = AbcGeom.ON3fGeomParamSample()
        own.setVals(sample.points_array(normals[frame]))
        own.setScope(scope("Vertex"))
        made.setNormals(own)
        mesh.getSchema().set(made)
    del mesh, above, archive
    tracks = load(path, notes=notes).tracks
    expected = normals @ np.linalg.inv(linear).T
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    assert (tracks["N"].kind, tracks["velocities"].kind) == ("normal", "velocity")
    np.testing.assert_allclose(tracks["N"].values, expected, atol=1e-6)
    np.testing.assert_allclose(tracks["velocities"].values, speeds @ linear, atol=1e-5)
    assert notes == []


def as_written(tracks):
    """Return tracks as a file stores them: byte colors and vertex velocities become float32."""
    written = {}
    for name, track in tracks.items():
        values, written_name = track.values, name
        if track.kind == "color":
            values = (values / 255).astype(np.float32)
        if track.kind == "velocity" and track.domain is Domain.VERTEX:
            values, written_name = values.astype(np.float32), "velocities"
        written[written_name] = Track(values, track.domain, track.kind, track.unit)
    return written


@pytest.mark.parametrize("n_frames", [2, 5])
def test_tracks_round_trip(tmp_path, n_frames, notes):
    sheet = tracked_sheet(n_frames)
    small = {
        name: Track(track.values >> 33, track.domain) if name.startswith("step") else track
        for name, track in sheet.tracks.items()
    }
    save(sheet.replace(tracks=small), tmp_path / "a.abc", notes=notes)
    loaded = load(tmp_path / "a.abc")
    assert_same_tracks(loaded.tracks, as_written(small))
    assert "track 'flow_vertex' is called 'velocities' in .abc files" in notes
    assert not any("units" in note for note in notes)
    assert "track 'shade_face' is written as float32, not uint8" in notes
    assert {attribute.kind for attribute in loaded.surface.attributes} == {"uv", "color"}


def test_save_notes_tracks_beyond_32_bits(tmp_path, notes):
    save(tracked_sheet(2), tmp_path / "a.abc", notes=notes)
    assert (
        "tracks left out: step_vertex, step_face, step_corner: .abc cannot store integers beyond "
        "32 bits (a limit of its library)"
    ) in notes
    assert not any(name.startswith("step") for name in load(tmp_path / "a.abc").tracks)


@pytest.mark.parametrize("dtype", ["u1", "i1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
@pytest.mark.parametrize("width", [1, 2, 3, 9])
def test_tracks_of_every_number_type_round_trip(tmp_path, dtype, width):
    sheet = quad_sheet(3)
    values = (250 * RNG.random((3, sheet.n_verts, width)) - 120 * (dtype[0] != "u")).astype(dtype)
    tracks = {"a = b; c": Track(values, kind="other", unit="m/s²")}
    save(sheet.replace(tracks=tracks), tmp_path / "a.abc")
    [(name, track)] = load(tmp_path / "a.abc").tracks.items()
    assert (name, track.kind, track.unit) == ("a = b; c", "other", "m/s²")
    assert track.dtype == {"i1": "i4", "i2": "i4", "u2": "i4"}.get(dtype, dtype)
    assert np.array_equal(track.values, values)


def test_constant_track_round_trips(tmp_path):
    sheet = quad_sheet(3)
    tracks = {"id": Track(np.tile(np.arange(sheet.n_verts, dtype="i4"), (3, 1)))}
    save(sheet.replace(tracks=tracks), tmp_path / "a.abc")
    assert_same_tracks(load(tmp_path / "a.abc").tracks, tracks)


def test_alembic_library_reads_the_saved_tracks(tmp_path):
    sheet = quad_sheet(3).replace(start_s=0.0)
    surface = replace(sheet.surface, attributes=())
    normals = RNG.normal(size=(3, sheet.n_verts, 3))
    normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
    corners = domain_sizes(sheet.n_verts, sheet.n_faces, surface)[Domain.CORNER]
    tracks = {
        "N": Track(normals, kind="normal"),
        "velocities": Track(RNG.normal(size=normals.shape).astype("f4"), kind="velocity"),
        "map1": Track(RNG.random((3, corners, 2)).astype("f4"), "corner", "uv"),
        "Cd": Track(RNG.random((3, sheet.n_verts, 4)).astype("f4"), kind="color"),
    }
    save(sheet.replace(surface=surface, tracks=tracks), tmp_path / "a.abc")
    archive = Abc.IArchive(str(tmp_path / "a.abc"))
    above = archive.getTop().children[0]
    mesh = AbcGeom.IPolyMesh(above, above.children[0].getName()).getSchema()
    colors = AbcGeom.IC4fGeomParam(mesh.getArbGeomParams(), "Cd")
    assert mesh.getUVsParam().getNumSamples() == 3
    for frame in range(3):
        chosen = Abc.ISampleSelector(frame / sheet.fps)
        got = mesh.getValue(chosen)
        speeds = np.array([list(getVelocity) for getVelocity in got.getVelocities()], np.float32)
        assert np.array_equal(speeds, tracks["velocities"][frame])
        shown = mesh.getNormalsParam().getExpandedValue(chosen).getVals()
        assert np.array_equal(np.array([list(one) for one in shown], np.float32), normals[frame])
        own = colors.getExpandedValue(chosen).getVals()
        rows = np.array([[one.r, one.g, one.b, one.a] for one in own], np.float32)
        assert np.array_equal(rows, tracks["Cd"][frame])
    assert_same_tracks(load(tmp_path / "a.abc").tracks, tracks)


def test_save_notes_units_of_standard_properties(tmp_path, notes):
    sheet = quad_sheet(3)
    speed = Track(RNG.normal(size=(3, sheet.n_verts, 3)).astype("f4"), kind="velocity", unit="m/s")
    heat = Track(RNG.normal(size=(3, sheet.n_verts)), unit="K")
    save(sheet.replace(tracks={"velocities": speed, "heat": heat}), tmp_path / "a.abc", notes=notes)
    assert [note for note in notes if "units" in note] == [
        "units left out: velocities (m/s): .abc cannot store them"
    ]
    assert load(tmp_path / "a.abc").tracks["heat"].unit == "K"


def test_second_parameter_of_a_name_is_renamed(tmp_path, notes):
    heat = RNG.random((N_FRAMES, 6)).astype(np.float32)
    path = file_with(tmp_path / "a.abc", ("Float", "velocities", heat, "Vertex"))
    sheet = load(path)
    speed = Track(RNG.normal(size=(N_FRAMES, 6, 3)).astype("f4"), kind="velocity")
    save(sheet.replace(tracks={**sheet.tracks, "v": speed}), path.with_name("b.abc"))
    result = load(path.with_name("b.abc"), notes=notes).tracks
    assert np.array_equal(result["velocities"].values[..., 0], heat)
    assert np.array_equal(result["velocities_"].values, speed.values)
    assert any(
        "has 'velocities' twice; the second is called 'velocities_'" in note for note in notes
    )
