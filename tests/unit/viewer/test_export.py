"""A player as one file."""

import json

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS
from meshreel.viewer import export
from meshreel.viewer.export import ALLOWED_ERROR, export_page
from samples.meshes import waving_grid
from samples.packets import inlined, played, read_packet
from samples.players import PAGE, opened_api

COARSE = {"allowed_error": ALLOWED_ERROR}


def exported(path, sequence, original=None, **options):
    """Sizes, HTML, and what is in it."""
    with opened_api(sequence, original, **COARSE, **options) as api:
        sizes = export_page(api, path, page=PAGE)
        described = api.described()
    html = path.read_bytes().decode()
    return sizes, html, inlined(html), json.loads(json.dumps(described))


def test_page_carries_what_the_server_would_tell_when_it_is_exported(tmp_path):
    grid = waving_grid(9)
    encoding = {"block_frames": 4}
    sizes, html, data, described = exported(tmp_path / "p.html", grid, encoding=encoding)
    assert list(data) == ["api/reel", "api/faces", *(f"api/block/{n}" for n in range(3))]
    assert data["api/reel"] == described
    np.testing.assert_array_equal(read_packet(data["api/faces"])[1]["faces"], grid.faces)
    found = np.concatenate([played(data[f"api/block/{number}"]) for number in range(3)])
    with opened_api(grid, encoding=encoding) as api:
        expected = api.reel[:] - np.array(described["origin"])
    assert np.linalg.norm(found - expected, axis=2).max() < 1e-4 * described["diagonal"]
    before, behind = PAGE.split("<!--meshreel-data-->")
    assert html.startswith(before + "<script>window.MESHREEL=")
    assert html.endswith("</script>" + behind)
    assert sizes["player"] == len(before + behind)
    assert list(sizes) == ["player", "animation"]
    assert abs(len(html) - sum(sizes.values())) < 50


def test_page_carries_the_original_when_there_is_one(tmp_path):
    grid = waving_grid(5)
    options = {"encoding": {"quality": 40}, "measured_rows": lambda _: {"KG": "1 %"}}
    sizes, _, data, described = exported(tmp_path / "p.html", grid, grid, **options)
    with opened_api(grid, grid, encoding=options["encoding"]) as api:
        pairs = [api.comparison.pair(number) for number in range(5)]
        heats = [api.comparison.heats(pair) for pair in pairs]
    assert sizes["original"] > 0
    assert data["api/plots"]["ready"] is True
    assert data["api/reel"]["original"]["rows"] == [["KG", "1 %"]]
    assert len(data["api/reel"]["original"]["plots"][0]["values"]) == 5
    for number in range(5):
        positions = read_packet(data[f"api/original/{number}"])[1]["positions"]
        expected = grid.vertices[number] - np.array(described["origin"])
        assert np.linalg.norm(positions - expected, axis=1).max() < 1e-4 * described["diagonal"]
        for kind in HEATS:
            values = read_packet(data[f"api/heat/{kind}/{number}"])[1]["values"]
            np.testing.assert_allclose(values, heats[number][kind], rtol=0.004, atol=1e-12)


def test_names_cannot_end_the_script_when_they_try(tmp_path):
    sequence = waving_grid(2)
    object.__setattr__(sequence, "name", "</script><script>alert(1)</script>\u2028<!--")
    _, html, data, _ = exported(tmp_path / "p.html", sequence)
    assert "alert(1)</script>" not in html
    assert data["api/reel"]["name"] == sequence.name


def test_nothing_is_written_when_the_page_has_no_place_for_data(tmp_path):
    told = "has no place for data; build it anew"
    with opened_api(waving_grid(2)) as api, pytest.raises(InvalidInputError, match=told):
        export_page(api, tmp_path / "p.html", page="<html></html>")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_kept_when_it_is_there_already(tmp_path):
    (tmp_path / "p.html").write_text("mine")
    with opened_api(waving_grid(2)) as api:
        with pytest.raises(InvalidInputError, match="exists and is kept"):
            export_page(api, tmp_path / "p.html", page=PAGE)
        assert (tmp_path / "p.html").read_text() == "mine"
        export_page(api, tmp_path / "p.html", page=PAGE, overwrite=True)
    assert "MESHREEL" in (tmp_path / "p.html").read_text()


def test_original_is_refused_when_it_would_be_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "MOST_ORIGINAL_BYTES", 1000)
    grid = waving_grid(5)
    told = r"would add 0\.0 GB .* leave --original out"
    with opened_api(grid, grid) as api, pytest.raises(InvalidInputError, match=told):
        export_page(api, tmp_path / "p.html", page=PAGE)
    assert list(tmp_path.iterdir()) == []
