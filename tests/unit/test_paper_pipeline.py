"""The picture of the paper's method shows modules that exist, and all equations."""

import re
import runpy
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "meshreel"
LEDGER = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
SCRIPT = runpy.run_path(str(ROOT / "docs" / "paper_pipeline.py"))
STEPS, draw_pipeline, equations_text = (
    SCRIPT[name] for name in ("STEPS", "draw_pipeline", "equations_text")
)


def test_every_module_of_fig_1_exists() -> None:
    missing = {
        module
        for step in STEPS.values()
        for module in step.modules
        if not (SOURCE / module).is_file()
    }
    assert missing == set()


def test_fig_1_shows_every_equation_of_the_method_in_its_module() -> None:
    homes = dict(re.findall(r"^\| (Eq\. \d+|Alg\. 1) \|[^|]*\| `([^`]+)` \|", LEDGER, re.MULTILINE))
    del homes["Eq. 13"]  # counts bits
    shown = {(name, step.modules) for step in STEPS.values() for name in step.equations}
    assert {name for name, _ in shown} == set(homes)
    assert [name for name, modules in shown if homes[name] not in modules] == []


@pytest.mark.parametrize(
    ("equations", "text"),
    [
        ((), ""),
        (("Alg. 1",), "Alg. 1"),
        (("Eq. 11", "Eq. 12"), "Eqs. 11, 12"),
        (("Eq. 1", "Eq. 2", "Eq. 3"), "Eqs. 1\N{EN DASH}3"),
        (("Eq. 4", "Eq. 6", "Eq. 8"), "Eqs. 4, 6, 8"),
    ],
)
def test_equations_of_a_step_are_abbreviated(equations: tuple[str, ...], text: str) -> None:
    assert equations_text(equations) == text


@pytest.mark.slow
def test_picture_is_drawn_in_the_stored_size(tmp_path: Path) -> None:
    draw_pipeline(tmp_path / "pipeline.png")
    sizes = []
    for path in (tmp_path / "pipeline.png", ROOT / "docs" / "images" / "paper-pipeline.png"):
        with Image.open(path) as image:
            sizes.append(image.size)
            assert len(image.convert("RGB").getcolors(maxcolors=1 << 24) or ()) > 50
    assert sizes[0] == sizes[1]
