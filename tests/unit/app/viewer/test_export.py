"""The player page, served and exported as one file or several."""

import base64
import json
import os
import re
import subprocess
import sys
import tomllib
import zlib
from base64 import b64decode
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from meshreel.app.viewer import export
from meshreel.app.viewer.export import export_page
from meshreel.app.viewer.page import Page, built_page
from meshreel.app.viewer.player_data import PlayerData
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import InvalidInputError
from meshreel.formats import reel
from meshreel.kernel.mp4 import reel_box
from meshreel.model.notes import Notes
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid
from samples.mp4 import mp4
from samples.players import PAGE, carried, opened_api, write_page
from samples.web_package import built_package


def exported(path, sequence, original=None, **options):
    """Return the sizes, the data of the page, and the facts that the server would send."""
    with opened_api(sequence, original, **options) as api:
        sizes = export_page(api, path, page=PAGE)
        facts = json.loads(json.dumps(api.facts()))
    return sizes, carried(path.read_text()), facts


def test_page_contains_the_stream_and_its_facts(tmp_path):
    grid = waving_grid(9)
    stream = encode(grid, block_frames=4)
    sizes, data, facts = exported(tmp_path / "p.html", grid, data=stream)
    assert data == {"facts": facts, "stream": stream}
    assert list(sizes) == ["player", "animation"]
    assert sum(sizes.values()) == (tmp_path / "p.html").stat().st_size


def test_page_contains_the_original_when_there_is_one(tmp_path):
    grid = waving_grid(5)
    options = {"encoding": {"quality": 40}, "measured_rows": lambda _: {"KG": "1 %"}}
    sizes, data, facts = exported(tmp_path / "p.html", grid, grid, **options)
    comparison = data["facts"]["original"]
    assert comparison["rows"] == [["KG", "1 %"]]
    assert len(comparison["plots"][0]["values"]) == 5
    assert sizes["original"] > 0
    original = decode(data["original"])
    np.testing.assert_array_equal(original.faces, grid.faces)
    (distance,) = (heat for heat in comparison["heats"] if heat["kind"] == "distance")
    error = np.linalg.norm(original.vertices - grid.vertices, axis=2).max()
    diagonal = np.linalg.norm(np.ptp(grid.vertices, axis=(0, 1)))
    assert error <= 1.001 * distance["range"] / 20 / 100 * diagonal
    assert facts["original"] == comparison


def test_existing_page_is_replaced_only_with_overwrite(tmp_path):
    (tmp_path / "p.html").write_text("mine")
    with opened_api(waving_grid(2)) as api:
        with pytest.raises(InvalidInputError, match="already exists"):
            export_page(api, tmp_path / "p.html", page=PAGE)
        assert (tmp_path / "p.html").read_text() == "mine"
        export_page(api, tmp_path / "p.html", page=PAGE, overwrite=True)
    assert "MESHREEL" in (tmp_path / "p.html").read_text()


def test_original_is_rejected_when_it_is_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "MAX_ORIGINAL_BYTES", 1000)
    grid = waving_grid(5)
    message = r"0\.0 GB of positions, too many for a page; omit original"
    with opened_api(grid, grid) as api, pytest.raises(InvalidInputError, match=message):
        export_page(api, tmp_path / "p.html", page=PAGE)
    assert list(tmp_path.iterdir()) == []


def with_tracks(grid, sign=1):
    """Return the grid with tracks of heights, normals, exact face values and integers."""
    height = grid.vertices[:, :, 2].astype(np.float32)
    heat = grid.vertices[:, grid.faces, 0].mean(axis=2).astype(np.float32)
    normals = np.stack([np.cos(height), np.sin(height), 0 * height], axis=-1)
    tracks = {
        "height": Track(height, unit="m"),
        "normals": Track(normals, kind="normal"),
        "heat": Track(sign * heat, domain="face"),
        "part": Track(sign * (9 * height).astype(np.int32)),
    }
    return grid.replace(tracks=tracks)


ENCODING = {"tracks": {"height": "5%", "heat": "exact"}}


def test_page_contains_original_tracks_as_precise_as_their_error_maps_need(tmp_path):
    grid = with_tracks(waving_grid(5))
    sizes, data, facts = exported(tmp_path / "p.html", grid, grid, encoding=ENCODING)
    original = decode(data["original"])
    assert list(original.tracks) == ["height", "normals"]  # the others are equal in the file
    assert data["facts"]["original"]["tracks"] == ["height", "normals", "heat", "part"]
    assert data["facts"]["original"] == facts["original"]
    ranges = [heat["range"] for heat in facts["original"]["track_heats"]]
    error = np.abs(original.tracks["height"].values - grid.tracks["height"].values).max()
    assert 0 < error <= ranges[0] / 20
    chords = original.tracks["normals"].values - grid.tracks["normals"].values
    assert np.linalg.norm(chords, axis=2).max() <= 1.01 * np.radians(ranges[1] / 20)
    assert sizes["tracks of the original"] > 0
    assert sum(sizes.values()) == (tmp_path / "p.html").stat().st_size


def test_page_contains_exact_tracks_of_the_original_when_they_differ(tmp_path):
    grid, other = (with_tracks(waving_grid(5), sign) for sign in (1, -1))
    _, data, _ = exported(tmp_path / "p.html", grid, other, encoding=ENCODING)
    original = decode(data["original"])
    for name in ("heat", "part"):
        np.testing.assert_array_equal(original.tracks[name].values, other.tracks[name].values)


def test_page_contains_polygon_tracks_of_the_original(tmp_path):
    sheet = quad_sheet(3)
    heat = np.random.default_rng(0).random((3, sheet.surface.n_faces(sheet.n_faces)))
    sheet = sheet.replace(tracks={"heat": Track(heat.astype(np.float32), domain="face")})
    _, data, _ = exported(tmp_path / "p.html", sheet, sheet)
    assert decode(data["original"]).tracks["heat"].shape == (3, heat.shape[1], 1)


def test_tracks_are_left_out_with_a_note_when_they_exceed_the_limit(tmp_path, monkeypatch):
    grid = with_tracks(waving_grid(5))
    limit_bytes = 24 * 5 * grid.n_verts + 4 * 5 * grid.n_verts
    monkeypatch.setattr(export, "MAX_ORIGINAL_BYTES", limit_bytes)
    notes = Notes()
    with opened_api(grid, grid, encoding=ENCODING) as api:
        export_page(api, tmp_path / "p.html", page=PAGE, notes=notes)
    comparison = carried((tmp_path / "p.html").read_text())["facts"]["original"]
    assert comparison["tracks"] == ["height", "heat", "part"]
    assert [heat["track"] for heat in comparison["track_heats"]] == ["height"]
    assert notes == ["left out: tracks of the original, too large for a page: normals"]


@pytest.mark.parametrize("is_split", [False, True])
def test_exported_player_includes_the_texture(tmp_path, is_split):
    picture = tmp_path / "in" / "skin.webm"
    picture.parent.mkdir()
    picture.write_bytes(b"moving picture")
    out = tmp_path / "out"
    out.mkdir()
    with opened_api(quad_sheet(3), texture=picture) as api:
        sizes = export_page(api, out / "p.html", page=PAGE, split=is_split)
    data = carried((out / "p.html").read_text())
    texture = data["facts"]["texture"]
    if is_split:
        assert texture == {"url": "skin.webm", "mediaType": "video/webm"}
        assert data["stream"] == {"url": "p.reel"}
        assert (out / "skin.webm").read_bytes() == b"moving picture"
        assert (out / "player.js").read_text() == PAGE.script
    else:
        assert b64decode(texture["base64"]) == b"moving picture"
        assert [path.name for path in out.iterdir()] == ["p.html"]
    assert sum(sizes.values()) == sum(path.stat().st_size for path in out.iterdir())


@pytest.mark.parametrize("is_split", [False, True])
def test_exported_player_contains_an_mp4_with_both_once(tmp_path, is_split):
    film, out = tmp_path / "scan.mp4", tmp_path / "out"
    film.write_bytes(mp4(reel_box(encode(quad_sheet(3)))))
    out.mkdir()
    with reel.open(film) as opened:
        shown = PlayerData(opened, "scan", lambda _: {}, texture=film)
        sizes = export_page(shown, out / "p.html", page=PAGE, split=is_split)
    data = carried((out / "p.html").read_text())
    assert data["facts"]["texture"] is None
    stored = (out / "p.mp4").read_bytes() if is_split else data["stream"]
    assert stored == film.read_bytes()
    assert list(sizes) == ["player", "animation"]
    assert sum(sizes.values()) == sum(path.stat().st_size for path in out.iterdir())


ROOT = Path(__file__).parents[4]
PAGE_FOLDER = "src/meshreel/app/viewer/page"


@pytest.mark.slow
def test_page_in_the_repository_equals_a_new_build(tmp_path):
    built_package()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    if f"ziglang=={version('ziglang')}" not in project["optional-dependencies"]["core"]:
        pytest.skip("needs the version of ziglang that the extra `core` names")
    command = ["npm", "run", "build:page", "--", str(tmp_path)]
    environment = {**os.environ, "PYTHON": sys.executable}
    subprocess.run(
        command, cwd=ROOT / "npm", env=environment, check=True, capture_output=True, timeout=300
    )
    built = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    stored = {file.name: file.read_bytes() for file in (ROOT / PAGE_FOLDER).iterdir()}
    assert set(built) == set(stored), "the page is older than its sources: rebuild it"
    for name, data in built.items():
        assert data == stored[name], f"{name} is older than its sources: rebuild it"


def test_page_and_script_contain_the_license_of_three_js():
    page = built_page()
    pages = [page.served, page.split({}), page.whole({}), page.script]
    notices = ["three.js authors", "Permission is hereby granted, free of charge"]
    assert all(notice in text for text in pages for notice in notices)


def test_built_page_reads_page_and_script(tmp_path):
    assert built_page(write_page(tmp_path / "page")) == PAGE


@pytest.mark.parametrize("missing", ["index.html", "player.js"])
def test_error_says_how_to_get_the_page_when_a_file_is_missing(tmp_path, missing):
    folder = write_page(tmp_path / "page")
    (folder / missing).unlink()
    with pytest.raises(InvalidInputError, match=r"is missing.*reinstall.*CONTRIBUTING"):
        built_page(folder)


@pytest.mark.parametrize("html", ["<html></html>", "<!--meshreel-data-->", "<!--script-->"])
def test_page_is_rejected_when_it_lacks_a_placeholder(html):
    with pytest.raises(InvalidInputError, match="has no placeholder for data; rebuild it"):
        Page(html, PAGE.script)


def test_served_page_references_the_script():
    assert PAGE.served == (
        "<!doctype html><html><head><title>p</title></head>"
        '<body><script type="module" src="player.js"></script></body></html>'
    )


def test_whole_page_contains_data_and_the_script():
    html = PAGE.whole({"a": {"b": [1.5, float("nan")]}})
    (packed,) = re.findall(r'<script id="packed-script" type="text/plain">([^<]*)</script>', html)
    assert zlib.decompress(base64.b64decode(packed), -15).decode() == PAGE.script
    assert carried(html) == {"a": {"b": [1.5, None]}}


@pytest.mark.parametrize("form", ["whole", "split"])
def test_data_cannot_close_their_script_element(form):
    name = "</script><script>alert(1)</script>\u2028<!--"
    html = getattr(PAGE, form)({"facts": {"name": name}})
    assert "alert(1)</script>" not in html
    assert carried(html) == {"facts": {"name": name}}
