import base64
import gzip
import json
import math
import re

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.gltf.write import write_gltf
from meshreel.formats.options import Origin, WriteOptions
from meshreel.formats.save import save_part
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.operations.save import save
from meshreel.runtime.counting import size_text
from samples.glb import Glb, largest_error_percent, stream_of, written
from samples.meshes import irregular_sequence, waving_grid
from samples.surfaces import rich_cube, srgb


def grid(n_frames=30, dtype=np.float32, **changes):
    """Return a sheet with traveling waves and random ripples, which needs several targets."""
    sequence = waving_grid(n_frames, 15, 17, dtype)
    ripples = np.random.default_rng(2).standard_normal(sequence.vertices.shape) * 0.002
    return sequence.replace(vertices=(sequence.vertices + ripples).astype(dtype), **changes)


def two_parts(names=("left", "right"), **changes):
    """Return an animated and a static sheet of quads, with materials and colors."""
    sheet = waving_grid(12, 5, 6)
    static = np.broadcast_to(sheet.vertices[:1] + np.float32([3, 0, 0]), sheet.vertices.shape)
    squares = sheet.faces.reshape(2, -1, 3).transpose(1, 0, 2)
    quads = np.stack([squares[:, 0, 0], squares[:, 0, 1], squares[:, 1, 2], squares[:, 0, 2]], 1)
    fans = np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    n_quads, rng = len(quads), np.random.default_rng(4)
    surface = Surface(
        np.full(2 * n_quads, 4, np.int32),
        (
            Attribute("uv", Kind.UV, Domain.CORNER, rng.random((8 * n_quads, 2)).astype("f4")),
            Attribute("c", Kind.COLOR, Domain.VERTEX, rng.integers(0, 255, (60, 4)).astype("u1")),
        ),
        (FaceGroups("material", ("red", "blue"), np.arange(2 * n_quads, dtype=np.int32) % 3 - 1),),
        tuple(Part(name, 30, n_quads) for name in names),
    )
    vertices = np.concatenate([sheet.vertices, static], axis=1)
    faces = np.concatenate([fans, fans + 30])
    return MeshSequence(vertices, faces, 25.0, "pair", surface=surface, **changes)


@pytest.mark.parametrize("percent", [1.0, 0.1, 0.02])
def test_error_measured_in_the_file_meets_the_bound(tmp_path, percent, notes):
    sequence = grid()
    result = written(tmp_path, sequence, notes, max_error=percent)
    error = largest_error_percent(sequence, result.world("grid"))
    assert error <= percent
    assert notes[0].startswith(f"the largest error is {error:.4f} % of the diagonal, in frame ")


@pytest.mark.slow
def test_default_bound_is_a_tenth_of_a_percent(tmp_path):
    sequence = grid()
    assert largest_error_percent(sequence, written(tmp_path, sequence).world("grid")) <= 0.1


@pytest.mark.slow
def test_larger_bounds_need_fewer_targets(tmp_path):
    counts = [
        written(tmp_path, grid(), max_error=percent).weights("grid")[1].shape[1]
        for percent in (0.05, 0.1, 0.5)
    ]
    assert counts == sorted(set(counts), reverse=True)


def test_bound_that_integers_cannot_meet_is_rejected(tmp_path):
    with pytest.raises(InvalidInputError, match=r"0\.00\d+ % .*; 0\.0015 % is allowed"):
        written(tmp_path, grid(), max_error=0.0015)  # which some frames meet


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_error": 0.0}, "max_error must be above 0"),
        ({"max_error": float("nan")}, "max_error must be above 0"),
        ({"max_error": "0.5mm"}, "the model has no length unit"),
    ],
)
def test_options_out_of_range_are_rejected(tmp_path, options, message):
    with pytest.raises(InvalidInputError, match=message):
        written(tmp_path, grid(2), **options)


@pytest.mark.slow
@pytest.mark.parametrize("fps", [24.0, 25.0, 30000 / 1001, 60.0])
@pytest.mark.parametrize("start_s", [0.0, 2.5])
def test_times_have_frame_rate_and_start_of_the_sequence(tmp_path, fps, start_s):
    times, _ = written(tmp_path, grid(fps=fps, start_s=start_s)).weights("grid")
    np.testing.assert_array_equal(times, np.float32(start_s + np.arange(30) / fps))


def test_times_before_zero_are_shifted_to_zero(tmp_path, notes):
    times, _ = written(tmp_path, grid(start_s=-1.5), notes).weights("grid")
    assert (times[0], times[-1]) == (0, np.float32(29 / 25))
    assert notes[0] == "starts at 0 s, not -1.5 s: glTF has no time before 0"


def test_unknown_frame_rate_is_noted(tmp_path, notes):
    times, _ = written(tmp_path, grid(fps=0.0), notes).weights("grid")
    assert times[24] == 1
    assert notes[0] == "the frame rate is unknown; written as 24 fps"


def test_default_weights_show_the_first_frame(tmp_path):
    result = written(tmp_path, grid())
    (mesh,) = result.document["meshes"]
    np.testing.assert_array_equal(np.float32(mesh["weights"]), result.weights("grid")[1][0])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_single_frame_is_an_exact_static_mesh(tmp_path, notes, dtype):
    sequence = MeshSequence(np.float32(grid(1).vertices).astype(dtype), grid(1).faces, name="one")
    result = written(tmp_path, sequence, notes)
    assert [note[:13] for note in notes] == ["serve gzipped"]
    assert result.document.keys().isdisjoint({"animations", "extensionsUsed"})
    assert result.node("one") == {"name": "one", "mesh": 0}
    np.testing.assert_array_equal(result.world("one"), sequence.vertices)
    np.testing.assert_array_equal(result.triangles("one"), sequence.faces)


@pytest.mark.parametrize(
    "vertices", [grid(1).vertices, np.ones((1, 255, 3))], ids=["mesh", "point"]
)
def test_constant_sequence_is_a_static_mesh(tmp_path, notes, vertices):
    vertices = np.repeat(vertices, 5, axis=0)
    result = written(tmp_path, MeshSequence(vertices, grid(1).faces, 25.0, "static"), notes)
    assert notes[0] == "no vertex moves by more than the error bound: written as a static mesh"
    np.testing.assert_array_equal(result.world("static")[0], vertices[0])


@pytest.mark.slow
def test_float64_positions_far_from_the_origin_meet_the_bound(tmp_path):
    near = grid(dtype=np.float64)
    sequence = near.replace(vertices=near.vertices + 1e6)
    result = written(tmp_path, sequence, max_error=0.05)
    assert largest_error_percent(sequence, result.world("grid")) <= 0.05


def test_irregular_mesh_keeps_its_triangles(tmp_path, notes):
    sequence = irregular_sequence()
    result = written(tmp_path, sequence, notes)
    used = np.unique(sequence.faces)
    np.testing.assert_array_equal(used[result.triangles("irregular")], sequence.faces)
    assert (
        largest_error_percent(
            sequence.replace(vertices=sequence.vertices[:, used], faces=np.array([[0, 1, 2]])),
            result.world("irregular"),
        )
        <= 0.2
    )  # relative to a smaller diagonal
    n_isolated = sequence.n_verts - len(used)
    assert f"left out {n_isolated} vertices that no face uses" in notes


def test_each_part_has_a_node(tmp_path):
    sequence = two_parts()
    result = written(tmp_path, sequence)
    for name, verts in (("left", slice(0, 30)), ("right", slice(30, 60))):
        own = np.unique(result.world(name).round(5), axis=1)
        expected = sequence.vertices[: len(own), verts]
        distances = np.linalg.norm(own[:, :, None] - expected[:, None], axis=3)
        assert distances.min(axis=2).max() < 0.005
        assert distances.min(axis=1).max() < 0.005
    assert (result.weights("left") is None, result.weights("right") is None) == (False, True)


@pytest.mark.parametrize(("name", "names"), [("pair", ("pair",) * 2), ("", ("scene", "animation"))])
def test_scene_and_animation_have_the_name_of_the_sequence_if_it_has_one(tmp_path, name, names):
    document = written(tmp_path, two_parts().replace(name=name)).document
    assert (document["scenes"][0]["name"], document["animations"][0]["name"]) == names


def test_accessors_of_positions_and_times_alone_have_bounds(tmp_path):
    document = written(tmp_path, two_parts()).document
    needed = {sampler["input"] for one in document["animations"] for sampler in one["samplers"]}
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            needed |= {primitive["attributes"]["POSITION"]}
            needed |= {target["POSITION"] for target in primitive.get("targets", ())}
    accessors = enumerate(document["accessors"])
    assert {number for number, accessor in accessors if "min" in accessor} == needed


def test_part_names_that_are_paths_become_a_hierarchy(tmp_path):
    sequence = two_parts(("/root/arm", "/root"))
    result = written(tmp_path, sequence)
    (root,) = result.document["scenes"][0]["nodes"]
    assert result.document["nodes"][root]["name"] == "root"
    assert result.document["nodes"][root]["children"] == [1]
    low, high = result.world("arm").min(axis=(0, 1)), result.world("arm").max(axis=(0, 1))
    np.testing.assert_allclose(low, sequence.vertices[:, :30].min(axis=(0, 1)), atol=0.005)
    np.testing.assert_allclose(high, sequence.vertices[:, :30].max(axis=(0, 1)), atol=0.005)


def test_each_label_has_one_material_for_all_parts(tmp_path):
    result = written(tmp_path, two_parts())
    names = [one.get("name") for one in result.document["materials"]]
    assert sorted(names, key=str) == [None, "blue", "red"]
    for part in ("left", "right"):
        assert len({primitive["material"] for primitive in result.primitives(part)}) == 3


def test_corner_attributes_are_stored_per_split_vertex(tmp_path):
    sequence = two_parts()
    result = written(tmp_path, sequence)
    uv, colors = sequence.surface.attributes
    written_uvs = set()
    for part in ("left", "right"):
        for primitive in result.primitives(part):
            own = result.array(primitive["attributes"]["TEXCOORD_0"])
            written_uvs |= set(map(tuple, own.tolist()))
            bytes_ = 255 * srgb(result.array(primitive["attributes"]["COLOR_0"]))
            assert set(map(tuple, bytes_.round().tolist())) <= set(map(tuple, colors.values))
    flipped = np.stack([uv.values[:, 0], np.float32(1 - uv.values[:, 1].astype("f8"))], axis=1)
    assert written_uvs == set(map(tuple, flipped.tolist()))


def test_triangulation_of_polygons_is_noted(tmp_path, notes):
    written(tmp_path, two_parts(), notes)
    assert "triangulated 40 quads, the same way in every frame" in notes


def test_requested_normals_have_unit_length(tmp_path):
    result = written(tmp_path, two_parts(), normals=True)
    for part, tolerance in (("left", 0.01), ("right", 1e-6)):
        for primitive in result.primitives(part):
            lengths = np.linalg.norm(result.array(primitive["attributes"]["NORMAL"]), axis=1)
            np.testing.assert_allclose(lengths, 1, atol=tolerance)
            assert all("NORMAL" in target for target in primitive.get("targets", []))


def test_smooth_surface_has_normals_by_default(tmp_path, notes):
    result = written(tmp_path, grid(), notes)
    (primitive,) = result.primitives("grid")
    assert all("NORMAL" in one for one in (primitive["attributes"], *primitive["targets"]))
    assert notes[-2].startswith("normals are smooth, with a mean error of ")


def test_reading_a_written_file_notes_its_normals_once(tmp_path):
    notes = Notes()
    write_gltf(tmp_path / "a.glb", stream_of(grid(), Notes()), WriteOptions(max_error=1.0))
    meshreel.load(tmp_path / "a.glb", notes=notes)
    assert notes == ["left out: normals, which programs compute"]


def test_normals_can_be_disabled(tmp_path, notes):
    (primitive,) = written(tmp_path, grid(), notes, normals=False).primitives("grid")
    assert not any("NORMAL" in one for one in (primitive["attributes"], *primitive["targets"]))
    assert not any("normals" in note for note in notes)


def test_missing_normals_of_a_creased_mesh_are_explained(tmp_path, notes):
    result = written(tmp_path, rich_cube(4).replace(name="cube", fps=24.0), notes)
    (primitive,) = result.primitives("cube")
    assert "NORMAL" not in primitive["attributes"]
    assert notes[-2].startswith(
        "no normals, so viewers use flat shading: much of the surface is creased"
    )


def test_positions_beyond_float32_are_rejected(tmp_path):
    sequence = MeshSequence(grid(2, np.float64).vertices * 1e39, grid(2).faces)
    with pytest.raises(InvalidInputError, match="glTF stores float32"):
        written(tmp_path, sequence)


@pytest.mark.slow
@pytest.mark.parametrize("meshopt", [False, True])
def test_gltf_has_the_same_contents_as_glb(tmp_path, meshopt):
    options = {"max_error": 1.0, "meshopt": meshopt}
    glb = written(tmp_path, grid(), **options)
    write_gltf(tmp_path / "a.gltf", stream_of(grid()), WriteOptions(**options))
    document = json.loads((tmp_path / "a.gltf").read_text("utf-8"))
    uri = document["buffers"][0].pop("uri")
    assert document == glb.document
    data = base64.b64decode(uri.removeprefix("data:application/octet-stream;base64,"))
    assert Glb(document, data).buffer == glb.buffer


def test_compression_is_noted(tmp_path):
    notes = [Notes(), Notes()]
    for meshopt, each in zip((False, True), notes, strict=True):
        written(tmp_path, grid(), each, meshopt=meshopt)
    smallest = "; meshopt=True writes the smallest file, for viewers that load a decoder"
    assert notes[0][-1].endswith(smallest)
    assert notes[1][-1].startswith("compressed with EXT_meshopt_compression: vertices and triang")


def test_file_size_is_noted(tmp_path, notes):
    write_gltf(tmp_path / "a.glb", stream_of(grid(), notes), WriteOptions(max_error=1.0))
    size = (tmp_path / "a.glb").stat().st_size
    assert notes[0].endswith(f"morph targets: {size_text(size)}")
    served = len(gzip.compress((tmp_path / "a.glb").read_bytes(), 6))
    assert notes[-1].startswith(
        f"serve gzipped: {size_text(served)} instead of {size_text(size)}; "
    )


GUARANTEE = 0.1
AGAINST_THE_ORIGINAL = re.compile(
    r"against the original the largest error is at most ([\de.-]+) % of the diagonal, "
    r"of which the stream contributes ([\de.-]+) %"
)


@pytest.fixture(scope="module")
def waves():
    """A sheet with waves of several lengths, in 40 frames."""
    x, y = np.meshgrid(np.linspace(0, 1, 14), np.linspace(0, 1, 14))
    times = np.arange(40)[:, None, None] / 12
    z = sum(np.sin(k * (3 * x + 2 * y) - (k + 1) * times) / k**2 for k in range(1, 7)) / 8
    vertices = np.stack([x + 0 * z, y + 0 * z, z], axis=-1).reshape(40, -1, 3)
    corners = (np.arange(13) + 14 * np.arange(13)[:, None]).ravel()
    faces = np.concatenate([np.add.outer(corners, one) for one in ([0, 1, 15], [0, 15, 14])])
    return MeshSequence(vertices.astype(np.float32), faces, 24.0, "sheet")


@pytest.fixture(scope="module")
def stream_path(waves, tmp_path_factory):
    """A stream of the sheet with an error guarantee."""
    path = tmp_path_factory.mktemp("budget") / "waves.reel"
    path.write_bytes(meshreel.encode(waves, max_error=GUARANTEE))
    return path


def write_frames(reel, path, frames=None, **options):
    """Write frames of a stream, and return the positions in the file and the notes."""
    notes = Notes()
    wanted = range(reel.n_frames) if frames is None else frames
    plain = WriteOptions(**options)  # keeps the order of vertices
    save_part(reel, wanted, path, options=plain, notes=notes)
    return Glb.read(path.read_bytes()).world("sheet"), notes


def stated(notes):
    [result] = [result for note in notes if (result := AGAINST_THE_ORIGINAL.fullmatch(note))]
    return float(result[1]), float(result[2])


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"max_error": 0.2}, {"max_error": 0.12}])
def test_stated_error_against_the_original_holds(waves, stream_path, tmp_path, options):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", **options)
    total, of_stream = stated(notes)
    measured = largest_error_percent(waves, positions)
    assert of_stream == GUARANTEE
    assert measured <= total <= options.get("max_error", math.inf)


@pytest.mark.slow
def test_targets_use_the_rest_of_a_total_bound(stream_path, tmp_path):
    counts = {}
    with meshreel.open(stream_path) as reel:
        for bound in (0.11, 0.2, 0.4):
            notes = write_frames(reel, tmp_path / f"{bound}.glb", max_error=bound)[1]
            match = re.search(
                r"the largest error added is ([\d.]+) % .* with (\d+) morph", " ".join(notes)
            )
            assert float(match[1]) <= bound - GUARANTEE
            counts[bound] = int(match[2])
    assert counts[0.11] > counts[0.2] > counts[0.4]


@pytest.mark.parametrize("bound", [0.05, 0.1])
def test_bound_below_the_error_of_the_stream_is_rejected(stream_path, tmp_path, bound):
    with (
        meshreel.open(stream_path) as reel,
        pytest.raises(
            InvalidInputError,
            match=rf"max_error {bound} % leaves nothing .* error of up to 0\.1 % of the diagonal",
        ),
    ):
        save(reel, tmp_path / "a.glb", options=WriteOptions(max_error=bound))
    assert list(tmp_path.iterdir()) == []


def test_part_with_a_smaller_box_keeps_the_bound(waves, stream_path, tmp_path):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", range(3, 9), max_error=0.3)
    kept = waves.vertices[3:9].astype(np.float64)
    error = np.linalg.norm(positions - kept, axis=2).max()
    box = np.ptp(waves.vertices.astype(np.float64), axis=(0, 1))
    assert 100 * error / np.linalg.norm(box) <= stated(notes)[0] <= 0.3


@pytest.mark.parametrize(("options", "n_modes"), [({"quality": 70}, None), ({"max_error": 0.1}, 2)])
def test_note_says_that_a_stream_without_guarantee_limits_only_added_errors(
    waves, tmp_path, options, n_modes
):
    path = tmp_path / "a.reel"
    path.write_bytes(meshreel.encode(waves, **options))
    with meshreel.open(path, n_modes=n_modes) as reel:
        notes = write_frames(reel, tmp_path / "a.glb")[1]
    start = "errors are measured against the decoded animation, since the stream guarantees none"
    assert any(note.startswith(start) for note in notes)


def test_notes_on_an_original_do_not_mention_streams(waves, tmp_path, notes):
    save(waves, tmp_path / "a.glb", notes=notes)
    assert not any("original" in note or "stream" in note for note in notes)
    assert notes[0].startswith("the largest error is ")


def test_total_error_is_stated_for_a_static_mesh(waves, stream_path, tmp_path):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", max_error=60.0)
    assert notes[0] == "no vertex moves by more than the error bound: written as a static mesh"
    assert largest_error_percent(waves, positions) <= stated(notes)[0] <= 60


def budget_of(diagonal, origin, max_error=None):
    """Return the budget of frames in a box with this diagonal; 0.5 % may be added by default."""
    options, high = WriteOptions(origin=origin, max_error=max_error), np.array([diagonal, 0, 0])
    return requested_budget(np.zeros(3), high, options, 0.5, consumer="morph targets")[1]


@pytest.mark.parametrize("diagonal", [2.0, 2.002, 1.0])
def test_budget_is_relative_to_the_smaller_diagonal(diagonal):
    budget = budget_of(diagonal, Origin(0.002, 2.0), max_error=0.5)
    smaller = min(diagonal, 2.0)
    assert budget.diagonal == smaller
    assert budget.max_added == pytest.approx(0.005 * smaller - 0.002, rel=1e-3)
    assert budget.max_added < 0.005 * smaller - 0.002


def test_budget_exists_if_all_frames_are_one_point():
    budget = budget_of(0.0, Origin(0.001, 2.0), max_error=0.5)
    assert 0 < budget.max_added < 0.009


@pytest.mark.parametrize("total", [0.2, 0.1999999, 0.123456, 1e-7, 37.00001])
def test_stated_total_is_never_rounded_down(total):
    budget = budget_of(100.0, Origin(0.0, 100.0))
    [note] = budget.describe(total)
    assert total <= float(AGAINST_THE_ORIGINAL.fullmatch(note)[1]) <= 1.002 * total + 5e-5


@pytest.mark.filterwarnings("ignore:left out")
@pytest.mark.parametrize("options", [{}, {"rig": 4, "max_error": 5, "kg": 90}])
@pytest.mark.parametrize("is_lossy", [False, True])
def test_error_declared_by_a_file_is_added_to_the_bound_of_its_stream(
    waves, stream_path, tmp_path, is_lossy, options
):
    path = tmp_path / "a.glb"
    options = {"max_error": 0.3, **options, "normals": False}
    save(meshreel.load(stream_path) if is_lossy else waves, path, options=WriteOptions(**options))
    loaded = meshreel.load(path)
    largest = np.linalg.norm(loaded.vertices - waves.vertices, axis=2).max()
    diagonal = np.linalg.norm(np.ptp(waves.vertices, axis=(0, 1)))
    assert (
        largest <= loaded.error_bound <= largest + 2 * is_lossy * GUARANTEE / 100 * diagonal + 1e-5
    )
    with pytest.warns(match="bounds include the error of the source"):
        data = meshreel.encode(path, max_error=0.1)
    info = meshreel.info(data)
    total = info.error_bound_percent / 100 * info.diagonal
    assert total == pytest.approx(loaded.error_bound + info.diagonal / 1000, rel=1e-4)
    assert np.linalg.norm(meshreel.decode(data).vertices - waves.vertices, axis=2).max() <= total
    assert meshreel.load(path, fps=48).error_bound is None  # has frames between the original ones


@pytest.mark.parametrize(
    ("asset", "bound"),
    [
        ({}, None),
        ({"generator": "another program"}, 0.0),
        ({"extras": None}, 0.0),
        ({"extras": {"meshreelErrorBound": 0.25}}, 0.25),
        ({"extras": {"meshreelErrorBound": "0.25"}}, None),
        ({"extras": {"meshreelErrorBound": -1}}, None),
    ],
)
def test_declared_errors_are_those_of_files_that_no_other_program_changed(
    waves, tmp_path, asset, bound
):
    path = tmp_path / "a.gltf"
    save(meshreel.decode(meshreel.encode(waves, quality=50)), path)  # without a known error
    document = json.loads(path.read_text())
    document["asset"] |= asset
    path.write_text(json.dumps(document))
    assert meshreel.load(path).error_bound == bound
