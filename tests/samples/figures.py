"""Figures of reports with a fourth of their pixels per inch, for tests of what is around them."""

from contextlib import contextmanager

import pytest

COARSE_DPI = 60
COARSE_PANEL_PX = 100


@contextmanager
def coarse_figures():
    """Draw figures coarsely; at the resolution of print they take most of a report's time."""
    matplotlib = pytest.importorskip("matplotlib.figure", reason="needs matplotlib")
    from meshreel.paper.study.figures import panels

    save = matplotlib.Figure.savefig
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            matplotlib.Figure,
            "savefig",
            lambda figure, *given, **options: save(
                figure, *given, **{**options, "dpi": COARSE_DPI}
            ),
        )
        patch.setattr(panels, "MAX_PANEL_PX", COARSE_PANEL_PX)
        yield
