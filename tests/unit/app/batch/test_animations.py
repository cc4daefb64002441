"""Each animation of a file with several is a separate input."""

import json

import pytest

from meshreel import decode
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError
from samples.engines import InlineExecutor
from samples.gltf import moving_triangle

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
