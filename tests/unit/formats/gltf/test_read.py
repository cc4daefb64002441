import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from samples.gltf import SQUARE, SQUARE_FACES, TRIANGLE, Gltf, moving_triangle, rich_gltf, shifted
from samples.opening import open_source

HALF = np.sqrt(0.5)
QUARTER_Z = [0, 0, HALF, HALF]


def test_load_returns_one_frame_without_animation(read):
    result, notes = read(Gltf.of_mesh([[0.1, 1 / 3, -7], [1e-20, 2, 3], [4, 1e20, 6]], name="a"))
    expected = np.array([[[0.1, 1 / 3, -7], [1e-20, 2, 3], [4, 1e20, 6]]], np.float32)
    assert (result.vertices.tobytes(), result.dtype) == (expected.tobytes(), np.float32)
    assert (result.fps, result.start_s, result.name, notes) == (0, 0, "a", [])
    np.testing.assert_array_equal(result.faces, [[0, 1, 2]])


@pytest.mark.parametrize("extension", ["glb", "gltf"])
def test_load_samples_even_keys(tmp_path, extension):
    result = load(moving_triangle().save(tmp_path / f"a.{extension}"))
    expected = [shifted(TRIANGLE, [step, 0, 0]) for step in range(3)]
    np.testing.assert_array_equal(result.vertices, expected)
    assert (result.fps, result.start_s) == (2, 0)


def test_load_samples_at_the_requested_rate(read):
    result, _ = read(moving_triangle(), fps=24)
    assert (result.n_frames, result.fps) == (25, 24)
    expected = np.arange(25) / 12
    np.testing.assert_array_equal(result.vertices[:, 0, 0], expected.astype(np.float32))


def test_load_keeps_the_final_pose_between_two_frames(read):
    file = Gltf.of_mesh()
    file.animate(0, "translation", [0, 0.25], [[0, 0, 0], [1, 0, 0]])
    result, [note] = read(file, fps=30)
    assert (result.n_frames, result.fps) == (9, 30)
    assert result.vertices[-1, 0].tolist() == [1, 0, 0]
    np.testing.assert_allclose(np.diff(result.vertices[:8, 0, 0]), 4 / 30, rtol=1e-5)
    assert note == (
        "the animation takes 0.25 s, which is 7.5 frames at 30 per second; the last frame, "
        "0.266667 s after the first, shows its final pose"
    )


@pytest.mark.parametrize("fps", [-1, float("nan")])
def test_load_rejects_an_invalid_frame_rate(read, fps):
    with pytest.raises(InvalidInputError, match=r"a\.glb: fps must be finite and at least 0"):
        read(moving_triangle(), fps=fps)


@pytest.mark.parametrize("fps", [24, 25, 30000 / 1001, 60])
@pytest.mark.parametrize("first", [0, 1, 101])
def test_load_derives_frame_rate_and_start_from_keys(read, fps, first):
    file = Gltf.of_mesh()
    rng = np.random.default_rng(1)
    translations = rng.standard_normal((40, 3)).astype(np.float32)
    file.animate(0, "translation", (first + np.arange(40)) / fps, translations)
    result, _ = read(file)
    assert result.fps == pytest.approx(fps, rel=1e-12)
    assert result.start_s == first / result.fps
    np.testing.assert_array_equal(result.vertices[:, 0], translations)


def test_load_scales_then_rotates_then_translates(read):
    result, _ = read(Gltf.of_mesh(translation=[1, 2, 3], rotation=QUARTER_Z, scale=[2, 3, 4]))
    np.testing.assert_allclose(result.vertices[0], [[1, 2, 3], [1, 4, 3], [-2, 2, 3]], atol=1e-7)


def test_load_reads_matrices_by_column(read):
    file = Gltf()
    columns = [0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1]
    file.node(mesh=file.mesh(), matrix=columns)
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[0], [[1, 2, 3], [1, 4, 3], [-2, 2, 3]])


def test_load_applies_animated_transforms_of_ancestors(read):
    file = Gltf()
    leaf = file.node(is_root=False, mesh=file.mesh(), translation=[1, 0, 0], name="leaf")
    arm = file.node(is_root=False, children=[leaf], name="arm")
    root = file.node(children=[arm], scale=[2, 2, 2], name="root")
    file.animate(arm, "rotation", [0, 1], [[0, 0, 0, 1], QUARTER_Z], "STEP")
    file.animate(root, "translation", [0, 1], [[0, 0, 0], [0, 0, 5]])
    result, _ = read(file)
    assert result.name == "leaf"
    expected = [[[2, 0, 0], [4, 0, 0], [2, 2, 0]], [[0, 2, 5], [0, 4, 5], [-2, 2, 5]]]
    np.testing.assert_allclose(result.vertices, expected, rtol=0, atol=1e-6)


def test_load_interpolates_rotations_spherically(read):
    file = Gltf.of_mesh()
    file.animate(0, "rotation", [1, 2], [[0, 0, 0, 1], QUARTER_Z])
    result, [note] = read(file)
    angles = np.radians(90) * np.arange(31) / 30
    assert "curved motion between them" in note
    assert (result.n_frames, result.fps, result.start_s) == (31, 30, 1)
    expected = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    np.testing.assert_allclose(result.vertices[:, 1], expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2"])
def test_load_reads_rotations_in_normalized_integers(read, dtype):
    file = Gltf.of_mesh()
    maximum = np.iinfo(dtype).max
    file.animate(
        0, "rotation", [0, 1], [[0, 0, 0, maximum], [0, 0, maximum, 0]], "STEP", dtype=dtype
    )
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[1], [[0, 0, 0], [-1, 0, 0], [0, -1, 0]])


def test_load_interpolates_cubic_splines(read):
    file = Gltf.of_mesh()
    keys = np.array([0, 0.5, 1.5])
    flat = np.zeros_like(keys)
    positions = np.stack([keys**3, flat, flat], axis=1)
    slopes = np.stack([3 * keys**2, flat, flat], axis=1)
    rows = np.stack([slopes, positions, slopes], axis=1).reshape(-1, 3)
    file.animate(0, "translation", keys, rows, "CUBICSPLINE")
    result, _ = read(file)  # at 30 fps, as the motion is curved between sparse keys
    expected = (np.arange(46) / 30) ** 3
    np.testing.assert_allclose(result.vertices[:, 0, 0], expected, rtol=0, atol=3e-7)


def morphing(**mesh):
    file = Gltf()
    targets = [[[1, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0], [0, 0, 2]]]
    node = file.node(mesh=file.mesh(TRIANGLE, None, targets, **mesh))
    return file, node


@pytest.mark.parametrize(("of_mesh", "of_node"), [([0.5, 2], None), ([1, 1], [0.5, 2])])
def test_load_applies_default_weights(read, of_mesh, of_node):
    file, node = morphing(weights=of_mesh)
    if of_node:
        file.json["nodes"][node]["weights"] = of_node
    result, _ = read(file)
    np.testing.assert_array_equal(
        result.vertices[0], np.array([[0.5, 0, 0], [1, 0.2, 0], [0, 1, 4]], np.float32)
    )


def test_default_weights_are_zero(read):
    result, _ = read(morphing()[0])
    np.testing.assert_array_equal(result.vertices[0], TRIANGLE)


def test_load_applies_animated_weights(read):
    file, node = morphing(weights=[9, 9])
    file.animate(node, "weights", [0, 0.5, 1], [0, 0, 1, 0, 0.5, 2])
    result, _ = read(file, fps=4)
    assert result.vertices[:, 0, 0].tolist() == [0, 0.5, 1, 0.75, 0.5]
    assert result.vertices[:, 2, 2].tolist() == [0, 0, 0, 2, 4]


def test_load_applies_weights_on_a_spline(read):
    file, node = morphing()
    rows = [[0, 0], [0, 0], [1, 0], [1, 0], [1, 0], [0, 0]]  # the first weight grows linearly
    file.animate(node, "weights", [0, 1], np.ravel(rows), "CUBICSPLINE")
    result, _ = read(file, fps=8)
    np.testing.assert_allclose(result.vertices[:, 0, 0], np.arange(9) / 8, rtol=0, atol=1e-7)


def test_targets_with_only_normals_move_no_vertex(read):
    file, _ = morphing(weights=[1, 1])
    file.json["meshes"][0]["primitives"][0]["targets"][0] = {"NORMAL": file.accessor(TRIANGLE)}
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[0, 0], [0, 0, 0])
    assert result.vertices[0, 2, 2] == 2


WALK, JUMP = [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0], [0, 0, 7]]


BYSTANDER = "left out: other nodes: bystander"


def two_animations(*names):
    """Return a triangle that walks or jumps, with a third animation of a node without a mesh."""
    file = moving_triangle()
    bystander = file.node(name="bystander")
    file.animate(0, "translation", [0, 1], JUMP, animation=1)
    file.animate(bystander, "translation", [0, 1], JUMP, animation=2)
    for animation, name in zip(file.json["animations"], names or ("walk", "jump"), strict=False):
        animation["name"] = name
    return file


@pytest.mark.parametrize(
    ("names", "wanted", "path", "note"),
    [
        ((), None, WALK, "read the animation walk, not jump, animation_2; choose with animation"),
        *(((), wanted, JUMP, "") for wanted in ("jump", 1, "1")),
        (("walk", "0"), "0", JUMP, ""),  # names have precedence over indices
        (("walk", "0"), 0, WALK, ""),
        (("walk", "walk"), "walk_1", JUMP, ""),
        (
            (),
            "animation_2",
            JUMP[:1],
            "the animation animation_2 moves no mesh; read a single frame",
        ),
    ],
)
def test_load_selects_an_animation_by_name_or_index(read, names, wanted, path, note):
    result, notes = read(two_animations(*names), animation=wanted)
    assert result.vertices[:, 0].tolist() == path
    assert notes == [*([note] if note else []), BYSTANDER]


def test_load_skips_animations_that_move_no_mesh(read):
    file = two_animations()
    file.json["animations"].reverse()
    result, notes = read(file)
    assert result.vertices[-1, 0].tolist() == [0, 0, 7]
    assert notes == [
        "read the animation jump, not animation_0, walk; choose with animation",
        BYSTANDER,
    ]


def test_load_returns_one_frame_if_no_animation_moves_a_mesh(read):
    file = two_animations()
    file.json["animations"] = 2 * file.json["animations"][2:]
    result, notes = read(file)
    assert (result.n_frames, result.start_s) == (1, 0)
    text = "the animations animation_0, animation_1 move no mesh; read a single frame"
    assert notes == [text, BYSTANDER]


@pytest.mark.parametrize("wanted", ["run", "3", 3, -1])
def test_load_lists_the_animations_for_an_unknown_one(read, wanted):
    message = (
        rf"a\.glb: has no animation {wanted!r}; it contains walk, jump, animation_2; "
        "choose one of these names, or an index from 0 to 2"
    )
    with pytest.raises(InvalidInputError, match=message):
        read(two_animations(), animation=wanted)


@pytest.mark.parametrize("wanted", ["run", 0])
def test_load_rejects_an_animation_of_a_file_without_any(read, wanted):
    file = Gltf.of_mesh()
    with pytest.raises(
        InvalidInputError, match=r"has no animation .*; it contains no animations; omit"
    ):
        read(file, animation=wanted)


@pytest.mark.parametrize("wanted", ["walk", 0])
def test_animation_is_rejected_for_formats_without_several(tmp_path, wanted):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    message = r"animation has no effect on a \.obj file; it is for \.glb, \.gltf"
    with pytest.raises(InvalidInputError, match=message):
        load(tmp_path / "a.obj", animation=wanted)


def test_load_reads_the_next_animation_after_a_malformed_one(read):
    file = two_animations()
    file.json["animations"][0]["samplers"][0]["interpolation"] = "SMOOTH"
    result, notes = read(file)
    assert result.vertices[-1, 0].tolist() == [0, 0, 7]
    assert notes == [
        "read the animation jump, not animation_2; choose with animation",
        "left out: malformed animations: walk (animation 0, sampler 0: 'interpolation' must be "
        "one of LINEAR, STEP, CUBICSPLINE; got 'SMOOTH')",
        BYSTANDER,
    ]


def test_load_plays_each_animation_of_a_skinned_mesh(read):
    file = rich_gltf()
    tip, root, body = 0, 1, 2
    assert [file.json["nodes"][one]["name"] for one in (tip, root, body)] == ["tip", "root", "body"]
    file.animate(body, "weights", [0, 1], [0, 0, 1, 0], animation=1)
    file.animate(root, "translation", [0, 1], [[0, 0, 0], [0, 5, 0]], animation=2)
    rest = read(file, animation=1)[0].vertices
    np.testing.assert_allclose(rest[1] - rest[0], np.ones_like(rest[0]) * [1, 1, 2], atol=1e-6)
    moved = read(file, animation=2)[0].vertices
    np.testing.assert_allclose(moved[1] - moved[0], np.ones_like(rest[0]) * [0, 5, 0], atol=1e-6)


def test_load_ignores_channels_of_extensions(read):
    file = moving_triangle()
    file.json["animations"][0]["channels"] += [
        {"sampler": 0, "target": {"path": "pointer"}},
        {"sampler": 0, "target": {"path": "pointer", "node": 0}},
    ]
    assert read(file)[0].n_frames == 3


def several_meshes():
    file = moving_triangle()
    file.json["nodes"][0]["name"] = "a/b"
    square = file.mesh(SQUARE, SQUARE_FACES)
    child = file.node(is_root=False, mesh=square, name="tri")
    file.node(children=[child], name="root")
    file.json["meshes"][square]["name"] = "square"
    file.node(mesh=square, translation=[0, 0, 9])
    file.node(mesh=square, name="a_b")
    return file


def test_load_lists_unique_paths_of_several_meshes(read):
    with pytest.raises(
        InvalidInputError, match=r"4 meshes: /a_b, /root/tri, /square, /a_b_1; choose"
    ):
        read(several_meshes())


def test_static_mesh_has_one_frame_among_animated_ones(read):
    result, _ = read(several_meshes(), object="/square")
    np.testing.assert_array_equal(result.vertices, [shifted(SQUARE, [0, 0, 9])])


def test_load_merges_all_meshes(read):
    result, _ = read(several_meshes(), merge=True)
    assert [part.name for part in result.surface.parts] == [
        "/a_b",
        "/root/tri",
        "/square",
        "/a_b_1",
    ]
    assert (result.n_frames, result.n_verts, result.fps) == (3, 15, 2)
    np.testing.assert_array_equal(result.vertices[2, :3], shifted(TRIANGLE, [2, 0, 0]))
    np.testing.assert_array_equal(result.vertices[2, 7:11], shifted(SQUARE, [0, 0, 9]))


def test_load_notes_all_welded_vertices_in_one_sentence(read):
    file = several_meshes()
    file.node(mesh=file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 1, 2]))
    file.node(mesh=file.mesh([*TRIANGLE, *TRIANGLE], range(6)))
    assert read(file, merge=True)[1] == ["welded 10 vertices, split at seams, to 6"]


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, -2, 1], [-1, -1, -1]])
def test_faces_of_a_mirroring_node_are_reversed(read, scale):
    file = Gltf()
    uv = file.accessor([[0, 0], [0.5, 0], [0, 0.25], [1, 1]])
    mesh = file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 2, 1], attributes={"TEXCOORD_0": uv})
    file.node(mesh=mesh, scale=scale)
    result, _ = read(file)
    np.testing.assert_array_equal(result.faces, [[0, 2, 1], [0, 1, 2]])
    [attribute] = result.surface.attributes
    expected = [[0, 1], [0, 0.75], [0.5, 1], [1, 0], [0.5, 1], [0, 0.75]]
    np.testing.assert_array_equal(attribute.per_item(), np.array(expected, np.float32))


def test_faces_of_a_rotating_node_are_not_reversed(read):
    np.testing.assert_array_equal(read(Gltf.of_mesh(scale=[-1, -1, 1]))[0].faces, [[0, 1, 2]])


@pytest.mark.parametrize("make", [moving_triangle, rich_gltf])
def test_open_source_reads_the_same_frames_as_load(tmp_path, make, monkeypatch):
    monkeypatch.setattr("meshreel.formats.gltf.scene.BLOCK_BYTES", 3000)  # a few frames at once
    path = make().save(tmp_path / "a.glb")
    opened, loaded = open_source(path, fps=60, max_loaded_bytes=0), load(path, fps=60)
    assert isinstance(opened, StoredFrames)
    assert (opened.fps, opened.start_s, opened.name) == (60, loaded.start_s, loaded.name)
    for start, stop in [(0, loaded.n_frames), (7, 8), (20, 25), (3, 9), (5, 5)]:
        assert opened.read(start, stop).tobytes() == loaded.vertices[start:stop].tobytes()


def test_load_names_the_frame_of_a_position_that_is_not_finite(read):
    file = Gltf.of_mesh(shifted(TRIANGLE, [3e38, 0, 0]))
    file.animate(0, "scale", [0, 0.5], [[1, 1, 1], [2, 1, 1]], "STEP")
    with pytest.raises(InvalidInputError, match=r"a\.glb: .*vertex 0 of frame 1 has x = inf"):
        read(file)
