"""`--images` and `--max-image` on the command line."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Pillow

import meshreel
from meshreel.model.materials import Image
from samples.commands import assert_fails, run, run_ok
from samples.materials import dressed_sheet


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    noise = np.random.default_rng(1).integers(90, 160, (128, 96, 4), np.uint8)
    buffer = io.BytesIO()
    Pillow.fromarray(noise).save(buffer, "png")
    sheet = dressed_sheet()
    images = (Image("skin", "image/png", buffer.getvalue()), sheet.surface.images[1])
    sheet = sheet.replace(surface=replace(sheet.surface, images=images))
    meshreel.save(sheet, "sheet.glb")
    meshreel.save(sheet, "sheet.reel")


def skin_of(path):
    image = meshreel.load(path).surface.images[0]
    return image.mime_type, Pillow.open(io.BytesIO(image.data)).size


@pytest.mark.parametrize(
    ("command", "output"),
    [
        ("encode sheet.glb", "a.reel"),
        ("convert sheet.glb", "a.reel"),
        ("convert sheet.glb", "b.glb"),
        ("decode sheet.reel", "c.glb"),
    ],
)
def test_commands_reencode_and_scale_images(command, output):
    options = "--images", "webp:60", "--max-image", "64"
    notes = run_ok(*command.split(), "-o", output, *options).stderr
    assert skin_of(output) == ("image/webp", (48, 64))
    assert re.search("1 image re-encoded as image/webp: .* kB to .* kB", notes)
    assert "images kept as they are: photo" in notes


def test_a_note_names_the_options_where_images_are_large():
    result = run_ok("encode", "sheet.glb", "-o", "a.reel")
    assert re.search(
        r"images are 9\d % of the file, .* kB: --images webp compresses", result.stderr
    )
    assert "--max-image scales them down" in result.stderr
    assert re.search(r"size +.* kB: geometry .* k?B, images .* kB \(9\d %\)", result.stdout)
    assert "bits per vertex and frame, without images" in result.stdout


def test_options_without_effect_are_errors():
    other = run("decode", "sheet.reel", "-o", "a.npz", "--images", "png")
    assert_fails(other, "--images has no effect on a .npz file; it is for .reel")
    assert_fails(run("encode", "sheet.glb", "--images", "webp:200"), "got 'webp:200'")
