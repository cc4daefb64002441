import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from samples.gltf import SQUARE, SQUARE_FACES, TRIANGLE, Gltf, moving_triangle, rich_gltf, shifted
from samples.opening import open_source

HALF = np.sqrt(0.5)
QUARTER_Z = [0, 0, HALF, HALF]


@pytest.fixture
def read(tmp_path):
    """Load a file; gives the sequence and the notes."""

    def loaded(file, **options):
        notes = []
        return load(file.save(tmp_path / "a.glb"), notes=notes, **options), notes

    return loaded


def test_load_gives_one_frame_when_nothing_moves(read):
    file = Gltf()
    file.node(mesh=file.mesh([[0.1, 1 / 3, -7], [1e-20, 2, 3], [4, 1e20, 6]]), name="a")
    found, notes = read(file)
    expected = np.array([[[0.1, 1 / 3, -7], [1e-20, 2, 3], [4, 1e20, 6]]], np.float32)
    assert (found.vertices.tobytes(), found.dtype) == (expected.tobytes(), np.float32)
    assert (found.fps, found.start_s, found.name, notes) == (0, 0, "a", [])
    np.testing.assert_array_equal(found.faces, [[0, 1, 2]])


@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_load_samples_at_the_keys_when_they_are_even(tmp_path, ending):
    found = load(moving_triangle().save(tmp_path / f"a.{ending}"))
    expected = [shifted(TRIANGLE, [step, 0, 0]) for step in range(3)]
    np.testing.assert_array_equal(found.vertices, expected)
    assert (found.fps, found.start_s) == (2, 0)


def test_load_samples_as_often_as_asked_when_fps_is_given(read):
    found, _ = read(moving_triangle(), fps=24)
    assert (found.n_frames, found.fps) == (25, 24)
    expected = np.arange(25) / 12
    np.testing.assert_array_equal(found.vertices[:, 0, 0], expected.astype(np.float32))


def test_load_keeps_the_final_pose_when_it_is_between_two_frames(read):
    file = Gltf()
    node = file.node(mesh=file.mesh())
    file.animate(node, "translation", [0, 0.25], [[0, 0, 0], [1, 0, 0]])
    found, [note] = read(file, fps=30)
    assert (found.n_frames, found.fps) == (9, 30)
    assert found.vertices[-1, 0].tolist() == [1, 0, 0]
    np.testing.assert_allclose(np.diff(found.vertices[:8, 0, 0]), 4 / 30, rtol=1e-5)
    assert note == (
        "the animation takes 0.25 s, which is 7.5 frames at 30 per second; the last frame, "
        "0.266667 s after the first, shows its final pose"
    )


@pytest.mark.parametrize("fps", [-1, float("nan")])
def test_load_is_refused_when_fps_is_no_rate(read, fps):
    with pytest.raises(InvalidInputError, match=r"a\.glb: fps must be finite and at least 0"):
        read(moving_triangle(), fps=fps)


@pytest.mark.parametrize("fps", [24, 25, 30000 / 1001, 60])
@pytest.mark.parametrize("first", [0, 1, 101])
def test_load_keeps_rate_and_start_when_keys_do_not_begin_at_zero(read, fps, first):
    file = Gltf()
    node = file.node(mesh=file.mesh())
    rng = np.random.default_rng(1)
    moves = rng.standard_normal((40, 3)).astype(np.float32)
    file.animate(node, "translation", (first + np.arange(40)) / fps, moves)
    found, _ = read(file)
    assert found.fps == pytest.approx(fps, rel=1e-12)
    assert found.start_s == first / found.fps
    np.testing.assert_array_equal(found.vertices[:, 0], moves)


def test_load_turns_scales_and_moves_in_this_order_when_a_node_has_all(read):
    file = Gltf()
    file.node(mesh=file.mesh(), translation=[1, 2, 3], rotation=QUARTER_Z, scale=[2, 3, 4])
    found, _ = read(file)
    np.testing.assert_allclose(found.vertices[0], [[1, 2, 3], [1, 4, 3], [-2, 2, 3]], atol=1e-7)


def test_load_reads_columns_when_a_node_has_a_matrix(read):
    file = Gltf()
    columns = [0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1]
    file.node(mesh=file.mesh(), matrix=columns)
    found, _ = read(file)
    np.testing.assert_array_equal(found.vertices[0], [[1, 2, 3], [1, 4, 3], [-2, 2, 3]])


def test_load_follows_all_nodes_above_when_they_move(read):
    file = Gltf()
    leaf = file.node(is_root=False, mesh=file.mesh(), translation=[1, 0, 0], name="leaf")
    arm = file.node(is_root=False, children=[leaf], name="arm")
    root = file.node(children=[arm], scale=[2, 2, 2], name="root")
    file.animate(arm, "rotation", [0, 1], [[0, 0, 0, 1], QUARTER_Z], "STEP")
    file.animate(root, "translation", [0, 1], [[0, 0, 0], [0, 0, 5]])
    found, _ = read(file)
    assert found.name == "leaf"
    expected = [[[2, 0, 0], [4, 0, 0], [2, 2, 0]], [[0, 2, 5], [0, 4, 5], [-2, 2, 5]]]
    np.testing.assert_allclose(found.vertices, expected, rtol=0, atol=1e-6)


def test_load_turns_evenly_when_a_rotation_is_linear(read):
    file = Gltf()
    node = file.node(mesh=file.mesh())
    file.animate(node, "rotation", [1, 2], [[0, 0, 0, 1], QUARTER_Z])
    found, [note] = read(file)
    angles = np.radians(90) * np.arange(31) / 30
    assert "the way between is curved" in note
    assert (found.n_frames, found.fps, found.start_s) == (31, 30, 1)
    expected = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    np.testing.assert_allclose(found.vertices[:, 1], expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2"])
def test_load_reads_rotations_when_they_are_normalized_integers(read, dtype):
    file = Gltf()
    node = file.node(mesh=file.mesh())
    most = np.iinfo(dtype).max
    file.animate(node, "rotation", [0, 1], [[0, 0, 0, most], [0, 0, most, 0]], "STEP", dtype=dtype)
    found, _ = read(file)
    np.testing.assert_array_equal(found.vertices[1], [[0, 0, 0], [-1, 0, 0], [0, -1, 0]])


def test_load_follows_a_cubic_when_a_translation_is_a_spline(read):
    file = Gltf()
    node = file.node(mesh=file.mesh())
    keys = np.array([0, 0.5, 1.5])
    flat = np.zeros_like(keys)
    place = np.stack([keys**3, flat, flat], axis=1)
    slope = np.stack([3 * keys**2, flat, flat], axis=1)
    rows = np.stack([slope, place, slope], axis=1).reshape(-1, 3)
    file.animate(node, "translation", keys, rows, "CUBICSPLINE")
    found, _ = read(file, fps=20)
    expected = (np.arange(31) / 20) ** 3
    np.testing.assert_allclose(found.vertices[:, 0, 0], expected, rtol=0, atol=3e-7)


def morphing(**mesh):
    file = Gltf()
    targets = [[[1, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0], [0, 0, 2]]]
    node = file.node(mesh=file.mesh(TRIANGLE, None, targets, **mesh))
    return file, node


@pytest.mark.parametrize(("of_mesh", "of_node"), [([0.5, 2], None), ([1, 1], [0.5, 2])])
def test_load_takes_default_weights_when_nothing_moves_them(read, of_mesh, of_node):
    file, node = morphing(weights=of_mesh)
    if of_node:
        file.json["nodes"][node]["weights"] = of_node
    found, _ = read(file)
    np.testing.assert_array_equal(
        found.vertices[0], np.array([[0.5, 0, 0], [1, 0.2, 0], [0, 1, 4]], np.float32)
    )


def test_load_adds_no_displacement_when_weights_are_not_given(read):
    found, _ = read(morphing()[0])
    np.testing.assert_array_equal(found.vertices[0], TRIANGLE)


def test_load_moves_by_morph_targets_when_weights_are_animated(read):
    file, node = morphing(weights=[9, 9])
    file.animate(node, "weights", [0, 0.5, 1], [0, 0, 1, 0, 0.5, 2])
    found, _ = read(file, fps=4)
    assert found.vertices[:, 0, 0].tolist() == [0, 0.5, 1, 0.75, 0.5]
    assert found.vertices[:, 2, 2].tolist() == [0, 0, 0, 2, 4]


def test_load_moves_by_morph_targets_when_weights_are_a_spline(read):
    file, node = morphing()
    rows = [[0, 0], [0, 0], [1, 0], [1, 0], [1, 0], [0, 0]]  # a straight line of the first
    file.animate(node, "weights", [0, 1], np.ravel(rows), "CUBICSPLINE")
    found, _ = read(file, fps=8)
    np.testing.assert_allclose(found.vertices[:, 0, 0], np.arange(9) / 8, rtol=0, atol=1e-7)


def test_load_gives_no_displacement_when_a_target_has_only_normals(read):
    file, _ = morphing(weights=[1, 1])
    file.json["meshes"][0]["primitives"][0]["targets"][0] = {"NORMAL": file.accessor(TRIANGLE)}
    found, _ = read(file)
    np.testing.assert_array_equal(found.vertices[0, 0], [0, 0, 0])
    assert found.vertices[0, 2, 2] == 2


def two_animations():
    file = moving_triangle()
    bystander = file.node(name="bystander")
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [0, 0, 7]], animation=1)
    file.animate(bystander, "translation", [0, 1], [[0, 0, 0], [0, 0, 7]], animation=2)
    for number, name in enumerate(["walk", "jump", None]):
        if name:
            file.json["animations"][number]["name"] = name
    return file


def test_load_takes_the_first_animation_and_names_the_others_when_there_are_several(read):
    found, notes = read(two_animations())
    assert found.vertices[-1, 0].tolist() == [2, 0, 0]
    assert notes == [
        "took the animation walk, not jump, animation_2; choose with --animation (animation=)"
    ]


def test_load_takes_the_first_that_moves_a_mesh_when_others_come_before(read):
    file = two_animations()
    file.json["animations"].reverse()
    found, notes = read(file)
    assert found.vertices[-1, 0].tolist() == [0, 0, 7]
    assert notes == [
        "took the animation jump, not animation_0, walk; choose with --animation (animation=)"
    ]


def test_load_gives_one_frame_and_notes_it_when_no_animation_moves_a_mesh(read):
    file = two_animations()
    del file.json["animations"][:2]
    found, notes = read(file)
    assert (found.n_frames, found.start_s) == (1, 0)
    assert notes == ["no mesh is moved by the animation animation_0; took one frame"]


@pytest.mark.parametrize("wanted", ["jump", 1, "1"])
def test_load_takes_the_animation_that_is_named_or_numbered(read, wanted):
    found, notes = read(two_animations(), animation=wanted)
    assert (found.vertices[-1, 0].tolist(), notes) == ([0, 0, 7], [])


def test_load_takes_a_name_before_a_number_when_an_animation_is_called_like_a_number(read):
    file = two_animations()
    file.json["animations"][1]["name"] = "0"
    assert read(file, animation="0")[0].vertices[-1, 0].tolist() == [0, 0, 7]
    assert read(file, animation=0)[0].vertices[-1, 0].tolist() == [2, 0, 0]


def test_load_tells_animations_of_one_name_apart_by_a_number(read):
    file = two_animations()
    file.json["animations"][1]["name"] = "walk"
    assert read(file, animation="walk_1")[0].vertices[-1, 0].tolist() == [0, 0, 7]


@pytest.mark.parametrize("wanted", ["run", "3", 3, -1])
def test_load_lists_what_exists_when_an_animation_is_unknown(read, wanted):
    message = (
        rf"a\.glb: has no animation {wanted!r}; it holds walk, jump, animation_2; "
        "give one of these names, or a number from 0 to 2"
    )
    with pytest.raises(InvalidInputError, match=message):
        read(two_animations(), animation=wanted)


@pytest.mark.parametrize("wanted", ["run", 0])
def test_load_says_so_when_an_animation_is_asked_for_and_there_is_none(read, wanted):
    file = Gltf()
    file.node(mesh=file.mesh())
    with pytest.raises(InvalidInputError, match=r"has no animation .*, for it holds none; leave"):
        read(file, animation=wanted)


@pytest.mark.parametrize("wanted", ["walk", 0])
def test_animation_is_refused_when_a_format_holds_one_motion(tmp_path, wanted):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    message = r"--animation \(animation=\) has no effect on a \.obj file; it is for \.glb, \.gltf"
    with pytest.raises(InvalidInputError, match=message):
        load(tmp_path / "a.obj", animation=wanted)


def test_load_gives_one_frame_when_the_animation_that_is_named_moves_no_mesh(read):
    found, notes = read(two_animations(), animation="animation_2")
    assert found.n_frames == 1
    assert notes == ["the animation animation_2 moves no mesh; took one frame"]


def test_load_takes_the_next_animation_when_the_first_is_malformed(read):
    file = two_animations()
    file.json["animations"][0]["samplers"][0]["interpolation"] = "SMOOTH"
    found, notes = read(file)
    assert found.vertices[-1, 0].tolist() == [0, 0, 7]
    assert notes == [
        "took the animation jump, not animation_2; choose with --animation (animation=)",
        "left out: malformed animations: walk (animation 0, sampler 0: 'interpolation' must be "
        "one of LINEAR, STEP, CUBICSPLINE; got 'SMOOTH')",
    ]


def test_load_plays_each_animation_of_a_skin_and_of_morph_targets(read):
    file = rich_gltf()
    tip, root, body = 0, 1, 2
    assert [file.json["nodes"][one]["name"] for one in (tip, root, body)] == ["tip", "root", "body"]
    file.animate(body, "weights", [0, 1], [0, 0, 1, 0], animation=1)
    file.animate(root, "translation", [0, 1], [[0, 0, 0], [0, 5, 0]], animation=2)
    rest = read(file, animation=1)[0].vertices
    np.testing.assert_allclose(rest[1] - rest[0], np.ones_like(rest[0]) * [1, 1, 2], atol=1e-6)
    moved = read(file, animation=2)[0].vertices
    np.testing.assert_allclose(moved[1] - moved[0], np.ones_like(rest[0]) * [0, 5, 0], atol=1e-6)


def test_load_passes_over_channels_when_they_move_no_node(read):
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


def test_load_lists_unique_paths_when_a_file_holds_several_meshes(read):
    with pytest.raises(
        InvalidInputError, match=r"4 meshes: /a_b, /root/tri, /square, /a_b_1; choose"
    ):
        read(several_meshes())


def test_load_gives_one_frame_of_a_mesh_when_only_others_move(read):
    found, _ = read(several_meshes(), object="/square")
    np.testing.assert_array_equal(found.vertices, [shifted(SQUARE, [0, 0, 9])])


def test_load_gives_all_meshes_when_they_are_merged(read):
    found, _ = read(several_meshes(), merge=True)
    assert [part.name for part in found.surface.parts] == ["/a_b", "/root/tri", "/square", "/a_b_1"]
    assert (found.n_frames, found.n_verts, found.fps) == (3, 15, 2)
    np.testing.assert_array_equal(found.vertices[2, :3], shifted(TRIANGLE, [2, 0, 0]))
    np.testing.assert_array_equal(found.vertices[2, 7:11], shifted(SQUARE, [0, 0, 9]))


def test_load_notes_all_that_was_welded_in_one_sentence_when_meshes_are_merged(read):
    file = several_meshes()
    file.node(mesh=file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 1, 2]))
    file.node(mesh=file.mesh([*TRIANGLE, *TRIANGLE], range(6)))
    assert read(file, merge=True)[1] == ["welded 10 vertices, split at seams, to 6"]


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, -2, 1], [-1, -1, -1]])
def test_faces_are_turned_when_a_node_mirrors(read, scale):
    file = Gltf()
    uv = file.accessor([[0, 0], [0.5, 0], [0, 0.25], [1, 1]])
    mesh = file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 2, 1], attributes={"TEXCOORD_0": uv})
    file.node(mesh=mesh, scale=scale)
    found, _ = read(file)
    np.testing.assert_array_equal(found.faces, [[0, 2, 1], [0, 1, 2]])
    [attribute] = found.surface.attributes
    expected = [[0, 1], [0, 0.75], [0.5, 1], [1, 0], [0.5, 1], [0, 0.75]]
    np.testing.assert_array_equal(attribute.per_item(), np.array(expected, np.float32))


def test_faces_stay_when_a_node_turns_by_a_half_circle(read):
    file = Gltf()
    file.node(mesh=file.mesh(), scale=[-1, -1, 1])
    np.testing.assert_array_equal(read(file)[0].faces, [[0, 1, 2]])


@pytest.mark.parametrize("make", [moving_triangle, rich_gltf])
def test_open_source_reads_the_bits_of_load_when_nothing_is_loaded(tmp_path, make, monkeypatch):
    monkeypatch.setattr("meshreel.formats.gltf.read.POSE_BYTES", 3000)  # some frames at a time
    path = make().save(tmp_path / "a.glb")
    opened, loaded = open_source(path, fps=60, max_loaded_bytes=0), load(path, fps=60)
    assert isinstance(opened, StoredFrames)
    assert (opened.fps, opened.start_s, opened.name) == (60, loaded.start_s, loaded.name)
    for start, stop in [(0, loaded.n_frames), (7, 8), (20, 25), (3, 9), (5, 5)]:
        assert opened.read(start, stop).tobytes() == loaded.vertices[start:stop].tobytes()


def test_load_names_the_frame_when_a_position_is_not_finite(read):
    file = Gltf()
    node = file.node(mesh=file.mesh(shifted(TRIANGLE, [3e38, 0, 0])))
    file.animate(node, "scale", [0, 0.5], [[1, 1, 1], [2, 1, 1]], "STEP")
    with pytest.raises(InvalidInputError, match=r"a\.glb: .*vertex 0 of frame 1 has x = inf"):
        read(file)
