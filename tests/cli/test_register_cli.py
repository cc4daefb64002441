"""`meshreel register`, and `--register` of other commands, on a raw capture in frame files."""

import json
import wave
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import meshreel
from meshreel.runtime.workers import executors
from samples.captures import as_frames, capsule, capture, textured_capture
from samples.commands import assert_fails, run, run_json, run_ok

pytestmark = pytest.mark.usefixtures("few_grid_lines")

ADVICE = "`meshreel register` can follow the surface"


@pytest.fixture(autouse=True)
def batch_here(monkeypatch):
    """Let `batch` encode in this process, which has few grid lines."""
    monkeypatch.setattr(executors, "ProcessExecutor", ThreadPoolExecutor)


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    folder = tmp_path_factory.mktemp("raw") / "raw"
    meshreel.save(capture(4), folder / "frame_%03d.obj")
    return folder


def test_register_writes_one_segment_and_prints_both_distances(raw, tmp_path):
    output = tmp_path / "walk.reel"
    figures = run_json("register", raw, "-o", output, "--tolerance", "0.5%")
    assert figures["n_segments"] == len(meshreel.info(output).segments) == 1
    registered, decoded = figures["registered"], figures["decoded"]
    assert 0 < registered["mean_percent"] < decoded["mean_percent"] < 0.1
    assert decoded["d2_psnr_db"] > decoded["d1_psnr_db"] > 50
    assert (len(decoded["frames"]), len(decoded["d1_d2_frames"])) == (3, 1)
    assert (registered["n_folded"], figures["cuts"]) == (0, [])
    assert figures["tolerance_percent"] == pytest.approx(0.5)
    assert [path.name for path in tmp_path.iterdir()] == ["walk.reel"]


@pytest.mark.slow
def test_register_continues_after_a_failure(raw, tmp_path):
    output = tmp_path / "walk.reel"
    failing = ("register", raw, "-o", output, "--tolerance", "0.5%", "--size", "10B")
    assert_fails(run(*failing), "10")
    assert (tmp_path / "walk.registration").is_dir()
    done = run("register", raw, "-o", output, "--tolerance", "0.5%")
    assert "continued an earlier run" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["walk.reel"]


@pytest.mark.slow
def test_register_prints_a_table_and_no_advice(raw, tmp_path):
    done = run("register", raw, "-o", tmp_path / "walk.reel", "--tolerance", "0.5%")
    measured = "D1 and D2 PSNR", "of 1 of 4 frames"
    met = "met in every frame by 99 % of the area"
    for text in ("relative to the raw capture", met, "surface PSNR", *measured):
        assert text in done.stdout
    assert ADVICE not in done.stderr


@pytest.mark.slow
def test_register_without_measuring_prints_the_registered_distance(raw, tmp_path):
    given = ("register", raw, "-o", tmp_path / "walk.reel", "--tolerance", "0.5%", "--no-measure")
    figures = run_json(*given)
    assert "decoded" not in figures
    assert any("1 segment; distance from the raw surface" in note for note in figures["notes"])


@pytest.mark.slow
def test_encode_and_convert_register_while_reading(raw, tmp_path):
    encode = "encode", raw, "-o", tmp_path / "walk.reel", "--register", "0.5%"
    figures = run_json(*encode)
    assert figures["decoded"]["mean_percent"] > figures["registered"]["mean_percent"] > 0
    assert "D1 and D2 PSNR" in run(*encode, "--force").stdout
    converted = run("convert", raw, "-o", tmp_path / "walk.npz", "--register", "0.5%")
    assert meshreel.info(tmp_path / "walk.reel").n_frames == 4
    assert meshreel.load(tmp_path / "walk.npz").n_frames == 4
    assert "registered 4 frames in 1 segment" in converted.stderr


@pytest.mark.slow
def test_keys_have_more_vertices_for_a_higher_quality(tmp_path):
    raw = tmp_path / "raw"
    meshreel.save(as_frames([capsule(30, 26), capsule(30, 27)]), raw / "frame_%d.obj")

    def n_verts(command, option, quality):
        output = tmp_path / f"{command}{quality}" / "raw.reel"
        output.parent.mkdir()
        given = [output.parent] if command == "batch" else ["-o", output]
        run_ok(command, raw, *given, option, "2%", "--quality", quality)
        return meshreel.load(output).n_verts

    for command in ("register", "encode", "batch"):
        option = "--tolerance" if command == "register" else "--register"
        assert n_verts(command, option, 50) < n_verts(command, option, 95)
    assert_fails(run("register", raw, "-o", tmp_path / "x.reel", "--quality", 101), "1..100")


@pytest.mark.slow
def test_holes_are_kept_on_request(raw, tmp_path):
    folder, output = tmp_path / "holes", tmp_path / "walk.reel"
    (vertices, faces), *others = meshreel.load(raw)
    is_low = vertices[faces].mean(axis=1)[:, 2] < 0.6
    meshreel.save(as_frames([(vertices, faces[is_low]), *others]), folder / "frame_%03d.obj")
    options = "-o", output, "--keep-holes"
    run_json("register", folder, *options, "--tolerance", "0.5%")
    of_register = meshreel.load(output).tracks["scanned"].values
    run_json("encode", folder, *options, "--register", "0.5%", "--force")
    assert (meshreel.load(output).tracks["scanned"].values == of_register).all()
    assert (of_register.mean(axis=1)[:, 0] < 1).tolist() == [True, False, False, False]
    done = run("register", raw, *options, "--tolerance", "0.5%", "--force")
    assert "the raw frames have all faces, so there is no track 'scanned'" in done.stderr
    for option in ("--keep-holes", "--keep-debris"):
        assert_fails(run("encode", raw, "-o", output, option, "--force"), "add --register")


def test_encode_of_a_raw_capture_advises_registration(raw, tmp_path):
    assert ADVICE in run("encode", raw, "-o", tmp_path / "walk.reel").stderr


@pytest.mark.slow
def test_batch_registers_captures_and_leaves_others_alone(raw, tmp_path):
    meshreel.save(meshreel.simulate_flag(3), raw.parent / "flag.npz")
    done = run("batch", raw.parent, tmp_path / "out", "--register", "0.5%", "--workers", "1")
    records = json.loads((tmp_path / "out/manifest.json").read_text())["inputs"]
    notes = {name: " ".join(record["notes"]) for name, record in records.items()}
    assert "registered 4 frames" in notes["raw"], done.stderr
    assert "decoded; distance from the raw surface" in notes["raw"]
    assert "; of 1 of 4 frames" in notes["raw"]
    assert "not registered: all frames have the same faces" in notes["flag.npz"]


@pytest.mark.slow
def test_register_bakes_textures(tmp_path):
    frames, images = textured_capture(3)
    meshreel.save(frames, tmp_path / "raw" / "frame_%03d.obj")
    for number, image in enumerate(images):
        image.save(tmp_path / "raw" / f"frame_{number:03d}.png")
    given = ["register", "raw", "--tolerance", "0.5%", "--texture", "raw/*.png"]
    figures = run_json(*given, "-o", "walk.reel", "--texture-output", "out/%d.png", cwd=tmp_path)
    assert figures["texture"] == {"output": "out/%d.png", "size_px": [128, 128]}
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"0.png", "1.png", "2.png"}
    assert [
        attribute.kind for attribute in meshreel.load(tmp_path / "walk.reel").surface.attributes
    ] == ["uv"]
    pytest.importorskip("imageio_ffmpeg")
    with wave.open(str(tmp_path / "take.wav"), "wb") as take:
        take.setparams((1, 2, 48000, 0, "NONE", ""))
        take.writeframes(bytes(2 * 5760))
    done = run(*given, "-o", "film.mp4", "--sound", "take.wav", cwd=tmp_path)
    assert "film.mp4, 128 x 128 texels" in done.stdout
    assert "Mbit/s, mp4a" in done.stdout
    assert not (tmp_path / "film.registration").exists()
    film, walk = (meshreel.decode(tmp_path / name) for name in ("film.mp4", "walk.reel"))
    assert np.array_equal(film.vertices, walk.vertices)
    media = meshreel.info(tmp_path / "film.mp4").media
    assert [part.kind for part in media] == ["video", "sound"]
    before = (tmp_path / "film.mp4").read_bytes()
    assert_fails(run(*given, "-o", "film.mp4", cwd=tmp_path), "film.mp4 already exists")
    replaced = run("register", "film.mp4", *given[2:], "-o", "film.mp4", "--force", cwd=tmp_path)
    assert_fails(replaced, "film.mp4 is the input")
    assert (tmp_path / "film.mp4").read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["register", "RAW", "--tolerance", "5mm"], "tolerance 5mm is a length"),
        (["register", "RAW", "--tolerance", "0"], "tolerance must be above 0"),
        (["encode", "RAW", "--register", "0.5%", "--split"], "cannot be combined"),
        (["register", "RAW", "--texture-output", "a.mp4"], "give both"),
        (["register", "RAW", "--texture", "*.png"], "no texture images"),
        (["register", "RAW", "--texture", "*.png", "-o", "a.reel"], "name the video with"),
        (["register", "RAW", "--sound", "a.wav"], "give --texture too"),
        (["register", "flag.npz"], "all 3 frames have the same faces"),
    ],
)
def test_what_cannot_be_registered_is_refused(arguments, message, raw, tmp_path):
    meshreel.save(meshreel.simulate_flag(3), tmp_path / "flag.npz")
    given = [str(raw) if argument == "RAW" else argument for argument in arguments]
    assert_fails(run(*given, cwd=tmp_path), message)
    assert not list(tmp_path.glob("*.reel"))
