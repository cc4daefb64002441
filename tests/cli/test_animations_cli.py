"""Commands on a glTF file with several animations."""

import numpy as np
import pytest

import meshreel
from samples.commands import assert_fails, run, run_json
from samples.gltf import moving_triangle


@pytest.fixture
def man(tmp_path):
    """A file whose mesh walks along x by 2 within a second, or jumps along y by 7 within two."""
    file = moving_triangle()
    file.animate(0, "translation", [0, 1, 2], [[0, 0, 0], [0, 7, 0], [0, 7, 0]], animation=1)
    for one, name in zip(file.json["animations"], ["walk", "jump"], strict=True):
        one["name"] = name
    (tmp_path / "in").mkdir()
    return file.save(tmp_path / "in" / "man.glb")


def last(path):
    return np.round(meshreel.load(path).vertices[-1, 0], 2).tolist()


@pytest.mark.parametrize("command", ["encode", "convert"])
def test_command_reads_the_named_animation(man, tmp_path, command):
    out = tmp_path / ("out.reel" if command == "encode" else "out.npz")
    figures = run_json(command, man, "-o", out)
    [note] = [one for one in figures["notes"] if "animation" in one]
    assert note == "read the animation walk, not jump; choose with --animation"
    assert last(out)[:2] == pytest.approx([2, 0], abs=0.02)
    figures = run_json(command, man, "-o", out, "--force", "--animation", "jump")
    assert not any("animation" in one for one in figures["notes"])
    assert last(out)[:2] == pytest.approx([0, 7], abs=0.02)
    assert_fails(run(command, man, "-o", out, "--force", "--animation", "run"), "walk, jump")


def test_info_lists_the_animations(man):
    shown = run("info", man).stdout
    assert "walk: 1 s" in shown
    assert "jump: 2 s" in shown
    printed = run_json("info", man, "--animation", "1")
    assert [(one["name"], one["duration_s"]) for one in printed["animations"]] == [
        ("walk", 1.0), ("jump", 2.0),
    ]  # fmt: skip
    assert printed["meshes"][0]["n_frames"] == 3


@pytest.mark.slow
def test_compare_render_and_export_read_the_named_animation_of_the_original(man, tmp_path):
    reel, chosen = tmp_path / "jump.reel", ("--animation", "jump")
    run_json("encode", man, "-o", reel, *chosen)
    assert run_json("compare", man, reel, *chosen)["max_error_percent"] <= 1
    assert run_json("compare", man, reel)["max_error_percent"] > 10
    run_json("render", reel, "-o", tmp_path / "a.png", "--original", man, *chosen)
    run_json("export", reel, "-o", tmp_path / "a.html", "--original", man, *chosen)
    assert_fails(run("compare", reel, reel, *chosen), "--animation", "no effect")
    assert_fails(run("export", reel, "-o", tmp_path / "b.html", *chosen), "--original")
