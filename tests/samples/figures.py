"""Low-resolution figures of reports, for tests of their surroundings."""

from contextlib import contextmanager

import pytest

COARSE_DPI = 60
COARSE_PANEL_PX = 100


@contextmanager
def coarse_figures():
    """Draw figures at low resolution; at print resolution they dominate a report's time."""
    matplotlib = pytest.importorskip("matplotlib.figure", reason="needs matplotlib")
    from meshreel.paper.study.figures import meshes

    save = matplotlib.Figure.savefig
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            matplotlib.Figure,
            "savefig",
            lambda figure, *args, **options: save(figure, *args, **{**options, "dpi": COARSE_DPI}),
        )
        patch.setattr(meshes, "PANEL_PX", COARSE_PANEL_PX)
        yield
