"""Meshes that Alembic and USD files hide: always or in some frames, above or at the mesh."""

import numpy as np
import pytest

import meshreel
from meshreel.formats.inspection import inspect_source
from meshreel.formats.options import Reading
from samples import usd

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TURNS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
FIRST = 3
"""Number of the first frame of a file."""


def write_abc(folder, shown, place):
    """Write squares at z = 0, 1, ... and whether each is shown in each frame; return the path."""
    pytest.importorskip("alembic3d")
    from samples import alembic

    archive, set_visible = (
        alembic.archive(folder / "a.abc"),
        alembic.AbcGeom.CreateVisibilityProperty,
    )
    sampling = archive.addTimeSampling(alembic.uniform(1 / 24, FIRST / 24))
    for z, row in enumerate(shown):
        group = alembic.add_transform(archive.getTop(), f"group_{z}", [])
        parent = alembic.add_transform(group, f"parent_{z}", [])
        points = SQUARE + np.float32([0, 0, z])
        square = alembic.add_mesh(parent, f"m_{z}", [points], faces=np.array([[3, 2, 1, 0]]))
        if place == "mesh in a hidden group":
            set_visible(group, 0).setValue(0)
        visible = set_visible(group if place == "group" else square, sampling)
        for is_shown in row:
            visible.setValue(0 if not is_shown else -1 if place == "group" else 1)
    return folder / "a.abc"


def write_usd(folder, shown, place, more=""):
    """Write the same stage; return the path."""
    pytest.importorskip("pxr")
    body = ""
    for z, row in enumerate(shown):
        states = (
            f'{code}: "{"inherited" if now else "invisible"}"'
            for code, now in enumerate(row, FIRST)
        )
        visible = f"token visibility.timeSamples = {{ {', '.join(states)} }}\n"
        points = f"point3f[] points = [{', '.join(str((x, y, z)) for x, y, _ in SQUARE.tolist())}]"
        own = visible * (place == "mesh") + more.format(z)
        square = usd.mesh(own, points=points, name=f"m_{z}")
        body += f'def Xform "group_{z}" {{ {visible * (place == "group")}\n{square} }}\n'
    return usd.stage(folder, body, "timeCodesPerSecond = 24")


WRITERS = [
    *((write_abc, place) for place in ("mesh", "group", "mesh in a hidden group")),
    *((write_usd, place) for place in ("mesh", "group")),
]


@pytest.mark.parametrize("n_empty", [0, 2])
@pytest.mark.parametrize(("write", "place"), WRITERS)
def test_meshes_shown_in_turn_are_frames_of_one_mesh(write, place, n_empty, tmp_path, notes):
    path = write(tmp_path, [[0] * n_empty + row for row in TURNS], place)
    loaded = meshreel.load(path, notes=notes)
    np.testing.assert_allclose(loaded.times, (FIRST + n_empty + np.arange(3)) / 24, atol=1e-12)
    assert ("left out: 2 frames without a mesh" in notes) == (n_empty == 2)
    assert (loaded.n_segments, loaded.fps, loaded.name) == (1, 24.0, "m_0")
    expected = [SQUARE + np.float32([0, 0, z]) for z in range(3)]
    np.testing.assert_array_equal(loaded.vertices, expected)
    assert [mesh.n_frames for mesh in inspect_source(path, Reading()).meshes] == [3]


@pytest.mark.parametrize(("write", "place"), WRITERS)
def test_hidden_meshes_are_left_out_unless_selected(write, place, tmp_path, notes):
    path = write(tmp_path, [[1, 1, 1], [0, 0, 0]], place)
    assert meshreel.load(path, notes=notes).n_verts == 4
    [name] = next(note.names for note in notes if note.subject == "hidden meshes")
    assert name.endswith("/m_1")
    assert meshreel.load(path, object="m_1").vertices[0, 0, 2] == 1


def test_meshes_with_other_colors_begin_segments(tmp_path):
    color = "color3f[] primvars:displayColor = [({}, 0, 0)]"
    loaded = meshreel.load(write_usd(tmp_path, TURNS, "mesh", color))
    colors = [segment.surface.attributes[0].values[0, 0] for segment in loaded.segments]
    np.testing.assert_allclose(colors, [0, 1, 1.353256], rtol=1e-6)


def test_visibility_is_sampled_at_the_requested_rate(tmp_path):
    moves = "double3 xformOp:translate.timeSamples = {{ 3: (0, 0, 0), 7: (4, 0, 0) }}\n"
    moves += 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    path = write_usd(tmp_path, [[1, 1, 0, 0], [0, 0, 1, 1]], "mesh", moves)
    loaded = meshreel.load(path, fps=12)
    assert (loaded.n_frames, loaded.fps) == (3, 12.0)
    np.testing.assert_array_equal(loaded.vertices[:, 0], [[0, 0, 0], [2, 0, 1], [4, 0, 1]])
