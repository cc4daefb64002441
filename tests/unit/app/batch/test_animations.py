"""Inputs of a batch and their names; each animation of a file is a separate input."""

import json
import os

import pytest

from meshreel import decode
from meshreel.app.batch.discovery import find_inputs
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError
from meshreel.formats.save import save
from samples.engines import InlineExecutor
from samples.gltf import moving_triangle
from samples.meshes import waving_grid

OPTIONS = EncodeOptions(config_of("lossless"))
UP = [[0, 0, 0], [0, 7, 0]]


@pytest.fixture
def inputs(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    return folder


def clips(path, *names):
    """Save a file with these animations; number N moves up to 7 N."""
    file = moving_triangle()
    for number in range(1, len(names)):
        file.animate(0, "translation", [0, 1], [[0, 0, 0], [0, 7 * number, 0]], animation=number)
    for one, name in zip(file.json["animations"], names, strict=True):
        one["name"] = name
    file.save(path)


def run(inputs, **arguments):
    plan = plan_batch(inputs, inputs.parent / "out", OPTIONS, all_animations=True, **arguments)
    report = run_batch(plan, InlineExecutor())
    return plan, report


def outputs(inputs):
    out = inputs.parent / "out"
    return {path.name: decode(path.read_bytes()) for path in out.glob("*.reel")}


def test_each_animation_is_a_separate_stream(inputs):
    clips(inputs / "man.glb", "walk", "jump")
    plan, report = run(inputs)
    assert (list(report.encoded), plan.notes) == (["man.glb#walk", "man.glb#jump"], [])
    result = outputs(inputs)
    assert sorted(result) == ["man.jump.reel", "man.walk.reel"]
    assert result["man.walk.reel"].vertices[-1, 0].tolist() == [2, 0, 0]
    assert result["man.jump.reel"].vertices[-1, 0].tolist() == [0, 7, 0]
    assert all(record.notes == [] for record in report.encoded.values())


def test_animations_are_up_to_date_in_a_second_run(inputs):
    clips(inputs / "man.glb", "walk", "jump")
    run(inputs)
    _, report = run(inputs)
    assert report.up_to_date.keys() == {"man.glb#walk", "man.glb#jump"}
    manifest = json.loads((inputs.parent / "out" / "manifest.json").read_text())
    assert manifest["inputs"]["man.glb#jump"]["options"]["animation"] == "jump"


def test_output_names_are_sanitized_and_numbered_when_they_clash(inputs):
    clips(inputs / "man.glb", "a/b", "A:b", "../up", "walk")
    plan, report = run(inputs)
    assert [one.output for one in report.encoded.values()] == [
        "man.a_b.reel", "man.A_b_1.reel", "man.up.reel", "man.walk.reel",
    ]  # fmt: skip
    assert plan.notes == [
        "man.glb: the animation 'a/b' is called a_b in its output",
        "man.glb: the animation 'A:b' is called A_b_1 in its output",
        "man.glb: the animation '../up' is called up in its output",
    ]


def test_shared_output_of_two_inputs_is_rejected(inputs):
    clips(inputs / "man.glb", "walk", "jump")
    clips(inputs / "man.walk.glb", "only")
    _, report = run(inputs)
    assert report.failed.keys() == {"man.glb#walk", "man.walk.glb"}
    assert "would both become man.walk.reel" in report.failed["man.walk.glb"].error


def test_file_of_one_animation_keeps_its_name(inputs):
    clips(inputs / "man.glb", "walk")
    _, report = run(inputs)
    assert [one.output for one in report.encoded.values()] == ["man.reel"]


def test_animations_that_cannot_be_encoded_are_skipped_with_a_note(inputs):
    file = moving_triangle()
    camera = file.node()
    for number, node in enumerate([0, camera, 0], 1):
        file.animate(node, "translation", [0, 1], UP, animation=number)
    file.json["animations"][3]["samplers"][0]["interpolation"] = "SMOOTH"
    file.save(inputs / "man.glb")
    plan, report = run(inputs)
    assert list(report.encoded) == ["man.glb#animation_0", "man.glb#animation_1"]
    assert plan.notes == [
        "man.glb: left out the animation 'animation_2': it moves no mesh",
        "man.glb: left out the animation 'animation_3': malformed: animation 3, sampler 0: "
        "'interpolation' must be one of LINEAR, STEP, CUBICSPLINE; got 'SMOOTH'",
    ]


def test_unreadable_file_does_not_affect_the_others(inputs):
    clips(inputs / "man.glb", "walk", "jump")
    (inputs / "bad.glb").write_bytes(b"x")
    _, report = run(inputs)
    assert (len(report.encoded), list(report.failed)) == (2, ["bad.glb"])


def test_error_names_the_animation_without_the_path_of_its_file(inputs):
    file = moving_triangle()
    file.animate(0, "rotation", [0, 1, 1e9], [[0, 0, 0, 1]] * 3, animation=1)
    file.save(inputs / "man.glb")
    _, report = run(inputs)
    assert report.failed["man.glb#animation_1"].error.startswith("its animation takes 1e+09 s")


def test_all_animations_is_rejected_when_no_input_can_have_several(inputs):
    (inputs / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InvalidInputError, match=r"there is no \.glb or \.gltf file among"):
        run(inputs)


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "inputs"
    made.mkdir()
    return made


def put(folder, *paths):
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"x")


def outputs_of_folder(folder, **options):
    return {source.name: source.output for source in find_inputs(folder, **options)}


def test_npz_files_and_frame_folders_at_any_depth_are_inputs(folder):
    put(folder, "walk.npz", "a/b/run.NPZ", "a/cloth/f_1.obj", "a/cloth/f_2.obj", "c/x.stl")
    assert outputs_of_folder(folder) == {
        "walk.npz": "walk.reel",
        "a/b/run.NPZ": "a/b/run.reel",
        "a/cloth": "a/cloth.reel",
        "c": "c.reel",
    }


def test_input_folder_with_frames_is_an_input(folder):
    put(folder, "f_1.ply", "f_2.ply")
    assert outputs_of_folder(folder) == {".": "inputs.reel"}


def test_dots_in_names_are_kept_except_before_the_extension(folder):
    put(folder, "walk.v2.npz", "run.v3/f_1.off")
    assert outputs_of_folder(folder) == {"walk.v2.npz": "walk.v2.reel", "run.v3": "run.v3.reel"}


def test_other_files_are_ignored(folder):
    put(folder, "old.reel", "notes.txt", ".hidden.npz", ".cache/a.npz", "walk.npz", "empty/readme")
    assert outputs_of_folder(folder) == {"walk.npz": "walk.reel"}


def test_output_folder_within_the_input_folder_is_ignored(folder):
    put(folder, "walk.npz", "out/walk.npz")
    assert outputs_of_folder(folder, but_not=folder / "out") == {"walk.npz": "walk.reel"}
    assert set(outputs_of_folder(folder, but_not=folder)) == {"walk.npz", "out/walk.npz"}


def test_inputs_are_in_natural_order(folder):
    put(folder, "walk10.npz", "walk9.npz", "b/f.obj", "a/f.obj")
    assert list(outputs_of_folder(folder)) == ["walk9.npz", "walk10.npz", "a", "b"]


def test_links_are_followed_but_cycles_are_not(folder, tmp_path):
    put(tmp_path / "elsewhere", "run.npz")
    put(folder, "walk.npz")
    (folder / "linked").symlink_to(tmp_path / "elsewhere")
    (folder / "circle").symlink_to(folder)
    assert set(outputs_of_folder(folder)) == {"walk.npz", "linked/run.npz"}


def test_sources_in_a_relative_folder_are_absolute(folder, monkeypatch):
    put(folder, "walk.npz")
    monkeypatch.chdir(folder.parent)
    [one] = find_inputs(folder.relative_to(folder.parent))
    assert one.source == folder / "walk.npz"
    assert one.name == "walk.npz"


def test_error_without_inputs_lists_the_searched_formats(folder):
    put(folder, "notes.txt")
    with pytest.raises(InvalidInputError, match=r"no sequence under .*\.npz.*\.obj"):
        find_inputs(folder)


@pytest.mark.parametrize("name", ["missing", "file.npz"])
def test_file_as_input_folder_is_rejected(folder, name):
    put(folder, "file.npz")
    with pytest.raises(InvalidInputError, match="there is no folder"):
        find_inputs(folder / name)


@pytest.mark.parametrize("change", ["size", "time", "more", "fewer", "name"])
def test_fingerprint_changes_with_a_file(folder, change):
    put(folder, "cloth/f_1.obj", "cloth/f_2.obj")
    path = folder / "cloth" / "f_2.obj"
    os.utime(path, ns=(0, 10**18))
    [before] = find_inputs(folder)
    old = before.fingerprint()
    if change == "size":
        path.write_bytes(b"xy")
        os.utime(path, ns=(0, 10**18))
    elif change == "time":
        os.utime(path, ns=(0, 10**18 + 1000))
    elif change == "more":
        put(folder, "cloth/f_3.obj")
    elif change == "fewer":
        path.unlink()
    else:
        path.rename(path.with_name("f_4.obj"))
    [after] = find_inputs(folder)
    assert after.fingerprint() != old


def test_moving_the_folder_keeps_the_fingerprint(folder):
    put(folder, "cloth/f_1.obj", "cloth/readme.txt")
    [before] = find_inputs(folder)
    old = before.fingerprint()
    folder.rename(folder.with_name("moved"))
    put(folder.with_name("moved"), "cloth/readme.txt")
    [after] = find_inputs(folder.with_name("moved"))
    assert after.fingerprint() == old


@pytest.mark.parametrize("extension", [".pvd", ".xdmf"])
def test_files_that_a_written_sequence_references_belong_to_the_input(tmp_path, extension):
    if extension == ".xdmf":
        pytest.importorskip("h5py")
    written = save(waving_grid(3), tmp_path / f"walk{extension}")
    [result] = find_inputs(tmp_path)
    assert result.name == f"walk{extension}"
    assert set(result.files) == set(written)
    written[0].unlink()
    assert [source.name for source in find_inputs(tmp_path)] == [
        "walk_frames" if extension == ".pvd" else "walk.xdmf.h5"
    ]
