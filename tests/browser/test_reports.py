"""Reports of `evaluate` and `paper` on a phone and on a desktop."""

import pytest

import meshreel
from meshreel.evaluation import surfaces
from samples.commands import run
from samples.figures import coarse_figures
from samples.meshes import waving_grid

NAME = "capture_of_a_performance_whose_name_exceeds_the_width_of_a_phone"
EVALUATE = ("evaluate", "--quick", "--peers", "npz", "--out")
COMMANDS = {
    "codecs": (*EVALUATE, "codecs", "--methods", "v2v,reel", f"{NAME}.npz"),
    "surfaces": (*EVALUATE, "surfaces", "--methods", "reel", "frames"),
    "paper": ("paper", "--quick", "--out", "paper", "--methods", "v2v", f"{NAME}.npz"),
}

MEASURE = """() => {
  const right = (element) => element.getBoundingClientRect().right;
  const boxes = [...document.querySelectorAll(".scroll")];
  boxes.forEach((box) => { box.scrollLeft = 120; });
  const isBeyond = (element) => right(element) > innerWidth;
  return {
    pageWidth: document.documentElement.scrollWidth,
    cut: [...document.querySelectorAll("body :not(.scroll *), caption span")]
      .filter(isBeyond).map((element) => element.textContent),
    nScrolling: boxes.filter((box) => box.scrollLeft > 0).length,
    firstColumn: [...document.querySelectorAll("td:first-child")].map((cell) =>
      cell.getBoundingClientRect().left - cell.closest(".scroll").getBoundingClientRect().left),
  };
}"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with the inputs of all commands, some with long names."""
    folder = tmp_path_factory.mktemp("inputs")
    grid = waving_grid(6)
    meshreel.save(grid, folder / f"{NAME}.npz")
    for number, sheet in enumerate((waving_grid(2), waving_grid(2, 5, 6))):
        meshreel.save(sheet, folder / "frames" / f"{number}_%d.ply")
    return folder


@pytest.mark.parametrize("kind", COMMANDS)
def test_reports_fit_a_phone(kind, inputs, new_page, monkeypatch, few_grid_lines):
    monkeypatch.setattr(surfaces, "N_SAMPLES", 300)
    with coarse_figures():
        done = run(*COMMANDS[kind], cwd=inputs)
    assert done.returncode == 0, done.stderr
    address = (inputs / kind / "report.html").as_uri()
    phone = new_page(address, width=390, height=844, is_shown=False).evaluate(MEASURE)
    assert phone["pageWidth"] == 390
    assert phone["cut"] == []
    assert phone["nScrolling"] > 0
    assert phone["firstColumn"] == pytest.approx([0] * len(phone["firstColumn"]), abs=1)
    desktop = new_page(address, width=1280, height=844, is_shown=False).evaluate(MEASURE)
    assert (desktop["pageWidth"], desktop["cut"], desktop["nScrolling"]) == (1280, [], 0)
