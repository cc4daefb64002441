"""The extension exports evaluated meshes; skipped without Blender."""

import numpy as np
import pytest

import meshreel
from integration.blender_session import why_not
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Domain, Kind

if why_not():
    pytest.skip(why_not(), allow_module_level=True)

MAX_ERROR_PERCENT = 0.01


def error_percent(found, expected):
    """Return the largest vertex distance in percent of the diagonal."""
    diagonal = np.linalg.norm(np.ptp(expected.reshape(-1, 3), axis=0))
    return 100 * np.linalg.norm(found - expected, axis=-1).max() / diagonal


def test_exported_frames_include_shape_keys_modifiers_and_transforms(blender, tmp_path):
    path = tmp_path / "grid.reel"
    options = {"target": "MAX_ERROR", "max_error": MAX_ERROR_PERCENT}
    result = blender("export_shape_key", path=path, last_frame=8, **options)
    assert str(result["error"]) == ""
    assert result["frame_after"] == 3
    reel = meshreel.decode(path.read_bytes())
    assert reel.vertices.shape == result["world"].shape == (8, 32, 3)
    assert error_percent(reel.vertices, result["world"]) <= MAX_ERROR_PERCENT
    assert (reel.fps, reel.start_s, reel.name) == (24.0, 1 / 24, "grid")
    assert reel.surface.face_sizes.tolist() == [4] * 18


def test_lower_quality_exports_a_smaller_file(blender, tmp_path):
    low, high = tmp_path / "low.reel", tmp_path / "high.reel"
    blender("export_shape_key", path=low, last_frame=8, quality=30.0)
    blender("export_shape_key", path=high, last_frame=8, quality=95.0)
    assert low.stat().st_size < high.stat().st_size


def test_parts_and_surfaces_round_trip_exactly(blender, tmp_path):
    result = blender("export_parts", path=tmp_path / "two.reel")
    assert str(result["error"]) == ""
    names = [key.removeprefix("before ") for key in result if key.startswith("before ")]
    assert len(names) == 12
    for name in names:
        np.testing.assert_array_equal(result[f"after {name}"], result[f"before {name}"], name)


def test_surfaces_of_objects_are_exported(blender, tmp_path):
    blender("export_parts", path=tmp_path / "two.reel")
    surface = meshreel.decode((tmp_path / "two.reel").read_bytes()).surface
    assert [(part.name, part.n_verts, part.n_faces) for part in surface.parts] == [
        ("arm", 16, 9),
        ("body", 9, 4),
    ]
    assert surface.groups[0].name == "material"
    assert set(surface.groups[0].labels) == {"skin", "cloth 0", "cloth 1"}
    assert {
        (attribute.name, attribute.kind, attribute.domain, str(attribute.values.dtype))
        for attribute in surface.attributes
    } == {
        ("map", Kind.UV, Domain.CORNER, "float32"),
        ("tint", Kind.COLOR, Domain.VERTEX, "float32"),
        ("paint", Kind.COLOR, Domain.CORNER, "uint8"),
    }


def test_all_kinds_of_objects_with_a_surface_are_exported(blender, tmp_path):
    path = tmp_path / "kinds.reel"
    result = blender("export_kinds", path=path)
    assert str(result["error"]) == ""
    parts = meshreel.decode(path.read_bytes()).surface.parts
    assert [part.name for part in parts] == ["nothing", "tube", "words"]
    assert sorted(part.n_verts for part in parts) == sorted(result["n_verts"].tolist())
    assert [part.n_faces > 0 for part in parts] == [False, True, True]


def test_export_reports_the_frame_in_which_faces_change(blender, tmp_path):
    path = tmp_path / "grid.reel"
    path.write_bytes(b"what was there")
    result = blender("export_changing", path=path)
    assert "the faces of grid" in str(result["error"])
    assert "at frame 4 differ from those at frame 1" in str(result["error"])
    assert result["frame_after"] == 2
    assert path.read_bytes() == b"what was there"


def test_mirrored_objects_keep_their_face_orientation(blender, tmp_path):
    path = tmp_path / "grid.reel"
    result = blender("export_mirrored", path=path)
    reel = meshreel.decode(path.read_bytes())
    sides = reel.vertices[0][reel.faces]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    assert (normals[:, 2] > 0).all()
    corners = join_triangles(reel.surface.face_sizes, reel.faces)
    uv = reel.surface.of_kind(Kind.UV)[0].per_item()
    have = np.concatenate([reel.vertices[0][corners], uv], axis=1).reshape(-1, 4, 5)
    # The same corners in the other direction, from the same first.
    np.testing.assert_allclose(have, result["corners"][:, [0, 3, 2, 1]], atol=1e-4)


@pytest.mark.parametrize(
    ("fps", "fps_base", "rate"),
    [(24, 1.0, 24.0), (25, 1.0, 25.0), (30, 1.001, 30000 / 1001), (60, 1.0, 60.0)],
)
def test_export_keeps_rate_and_start(blender, tmp_path, fps, fps_base, rate):
    path = tmp_path / "grid.reel"
    result = blender(
        "export_timed", path=path, fps=fps, fps_base=fps_base, start=11, end=20, step=3
    )
    reel = meshreel.decode(path.read_bytes())
    assert (reel.fps, reel.start_s, reel.n_frames) == (rate / 3, 11 / rate, 4)
    assert result["start"] == 11.0


def test_export_without_frames_reports_why(blender, tmp_path):
    path = tmp_path / "grid.reel"
    result = blender("export_without_frames", path=path, start=5, end=4)
    assert "no frames in 5 to 4" in str(result["error"])
    assert not path.exists()


def test_export_without_faces_reports_why(blender, tmp_path):
    path = tmp_path / "grid.reel"
    result = blender("export_without_faces", path=path)
    assert "points: missing faces" in str(result["error"])
    assert not path.exists()


@pytest.mark.parametrize("n_steps", [3, 10, 11])
def test_a_stopped_export_leaves_no_file(blender, tmp_path, n_steps):
    (tmp_path / "out").mkdir()
    result = blender("stop_export", path=tmp_path / "out" / "grid.reel", n_steps=n_steps)
    assert result["files"].tolist() == []
    assert result["frame_after"] == 7
    assert (np.diff(result["progress"]) >= 0).all()
    assert result["progress"].max() <= 1


def test_modal_export_writes_the_file(blender, tmp_path):
    path = tmp_path / "grid.reel"
    result = blender("export_from_window", path=path, stop_after=-1)
    assert result["status"].tolist() == ["FINISHED"]
    assert meshreel.decode(path.read_bytes()).n_frames == 10
    assert result["progress"][:10] == pytest.approx(np.arange(1, 11) * 8)
    ended = ["progress_end", "event_timer_remove", "status_text_set"]
    assert result["calls"].tolist() == [
        "progress_begin", "modal_handler_add", "status_text_set", *ended
    ]  # fmt: skip


@pytest.mark.parametrize("stop_after", [0, 4, 10])
def test_esc_cancels_the_export(blender, tmp_path, stop_after):
    path = tmp_path / "grid.reel"
    result = blender("export_from_window", path=path, stop_after=stop_after)
    assert result["status"].tolist() == ["CANCELLED"]
    assert not path.exists()
    assert result["calls"].tolist()[-2:] == ["event_timer_remove", "status_text_set"]


@pytest.mark.parametrize(
    ("kind", "n_hard"), [("flat", 12), ("smooth", 0), ("sharp", 4), ("custom", 4)]
)
def test_hard_edges_are_those_that_blender_splits_normals_at(blender, tmp_path, kind, n_hard):
    path = tmp_path / "cube.reel"
    result = blender("export_hard_edges", path=path, kind=kind)
    assert str(result["error"]) == ""
    reel = meshreel.decode(path.read_bytes())
    edges = reel.surface.hard_edges
    assert (0 if edges is None else len(edges)) == n_hard
    if n_hard == 4:
        heights = reel.vertices[0, edges, 1]  # y is up in the file
        assert (heights > 0).all()
