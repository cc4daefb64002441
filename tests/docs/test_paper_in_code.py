"""The page with the paper in code is complete and as short as its title says."""

import re

import pytest

from samples.pages import FENCED, ROOT

PAGE = (ROOT / "docs" / "guides" / "paper_in_code.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^### ([^:\n]+): .+\n((?:(?!^##).*\n)*)", PAGE, re.MULTILINE))


def test_page_has_every_equation_and_figure_of_the_paper_up_to_fig_6() -> None:
    assert set(SECTIONS) == {
        *(f"Eq. {number}" for number in range(1, 14)),
        "Algorithm 1",
        *(f"Fig. {number}" for number in range(2, 7)),
    }


@pytest.mark.parametrize("name", SECTIONS)
def test_section_has_at_most_five_lines_of_code_and_a_result(name: str) -> None:
    [(language, code)] = FENCED.findall(SECTIONS[name])
    lines = [line for line in code.splitlines() if line.strip()]
    assert language == "python"
    assert len(lines) <= 5
    assert re.search(r"print\(|savefig\(", lines[-1])
