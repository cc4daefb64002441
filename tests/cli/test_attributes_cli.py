"""Options that select attributes and the precision of UVs."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.model.surface import Kind
from samples.commands import assert_fails, run, run_json, run_ok
from samples.meshes import two_sheets, waving_grid


@pytest.fixture
def sheets(tmp_path):
    meshreel.save(two_sheets(), tmp_path / "sheets.npz")
    return tmp_path / "sheets.npz"


def carried(path):
    surface = meshreel.load(path).surface
    return [
        *(attribute.name for attribute in surface.attributes),
        *(group.name for group in surface.groups),
    ]


@pytest.mark.parametrize(
    ("names", "kept"), [("none", []), ("uv,material", ["st", "material"]), ("color", ["color"])]
)
@pytest.mark.parametrize("command", ["encode", "convert"])
def test_only_named_attributes_are_written(sheets, tmp_path, command, names, kept):
    target = tmp_path / ("out.reel" if command == "encode" else "out.h5")
    run_ok(command, sheets, "-o", target, "--attributes", names)
    assert carried(target) == kept


def test_each_split_stream_has_only_named_attributes(sheets, tmp_path):
    run("encode", sheets, "-o", tmp_path / "out.reel", "--split", "--attributes", "color")
    assert carried(tmp_path / "out.reel") == ["color"]


@pytest.mark.parametrize("command", ["encode", "convert"])
def test_error_lists_attributes_when_one_does_not_exist(sheets, tmp_path, command):
    target = tmp_path / "out.reel"
    done = run(command, sheets, "-o", target, "--attributes", "normals")
    assert_fails(done, "sheets.npz", "'normals'; it has 'st', 'color', 'material'")


def test_encode_reports_the_error_of_quantized_uvs(sheets, tmp_path):
    options = ("encode", sheets, "-o", tmp_path / "out.reel", "--uv-bits", "10")
    assert "texels at width 4096" in " ".join(run_ok(*options).stdout.split())
    figures = run_json(*options, "--force")
    given, result = (
        meshreel.load(path).surface.of_kind(Kind.UV)[0].values.astype(float)
        for path in (sheets, tmp_path / "out.reel")
    )
    assert figures["uv_error"] == np.abs(result - given).max()
    assert figures["uv_error_texels_4096"] == 4096 * figures["uv_error"]


def test_encode_rejects_uv_bits_when_there_are_no_uvs(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "grid.npz")
    done = run("encode", tmp_path / "grid.npz", "-o", tmp_path / "out.reel", "--uv-bits", "10")
    assert_fails(done, "no texture coordinates to quantize; omit --uv-bits")


@pytest.mark.slow
def test_batch_notes_inputs_to_which_options_do_not_apply(sheets, tmp_path):
    meshreel.save(waving_grid(), tmp_path / "grid.npz")
    out = tmp_path / "out"
    done = run_ok("batch", tmp_path, out, "--uv-bits", "10", "--attributes", "uv", "--workers", "1")
    records = json.loads((out / "manifest.json").read_text())["inputs"]
    assert records["grid.npz"]["notes"] == [
        "has no attribute or group 'uv'; it has none",
        "has no texture coordinates for uv_bits to quantize",
    ]
    assert records["sheets.npz"]["notes"] == []
    assert 0 < records["sheets.npz"]["uv_error"] <= 2**-11
    assert carried(out / "sheets.reel") == ["st"]
    assert "note: grid.npz: has no attribute" in done.stderr
