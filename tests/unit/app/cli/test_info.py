from types import SimpleNamespace

import pytest

from meshreel.app.cli.info import MAX_MESHES, mesh_columns


@pytest.mark.parametrize(("n_more", "last"), [(0, "mesh"), (1, "and 1 more"), (7, "and 7 more")])
def test_table_counts_meshes_beyond_the_maximum(n_more, last):
    mesh = SimpleNamespace(
        name="mesh", n_frames=2, n_verts=3, n_polygons=1, fps=0.0, attributes=(), problem=None,
        parts=(), low=(0, 0, 0), high=(1, 1, 1), tracks=(), materials=(), images=(),
    )  # fmt: skip
    rows = mesh_columns(SimpleNamespace(meshes=[mesh] * (MAX_MESHES + n_more)))
    assert len(rows) == MAX_MESHES + (n_more > 0)
    assert rows[-1][0].startswith(last)
