"""Measured figures on the pages of the paper come from stored results, or name their commit."""

import re
import runpy
import subprocess
from pathlib import Path

import pytest

from samples.pages import FENCED, ROOT

REGION: re.Pattern[str] = runpy.run_path(str(ROOT / "docs" / "result_tables.py"))["REGION"]
LEDGER, PAPER = (ROOT / "docs" / f"{name}.md" for name in ("equations", "paper"))
COMMIT = re.compile(r"\b(?=\w*\d)(?=\w*[a-f])[0-9a-f]{7,12}\b")
NAMED = re.compile(r"`[^`]*`|\]\([^)]*\)|\b(?:Eqs?|Figs?|Alg|Sec)\. [\dIVX]+|\bframe 0")
"""Code, links and names, whose digits are no figures."""
MEASURED = re.compile(r"\b(?:[Mm]easured|KG|STED)\b.*", re.DOTALL)
FIGURE = re.compile(r"\d\.\d|\d\s+%|\d times\b")
"""A figure in prose: a fraction, a percentage or a factor. Whole numbers are often settings."""


def without_sourced(text: str) -> str:
    """Remove results, code, links and names from a text."""
    return NAMED.sub("", REGION.sub("", text))


def unsourced_rows(page: str) -> list[str]:
    """Names of rows with a measured figure that is no stored result and has no commit."""
    rows = [line for line in REGION.sub("", page).splitlines() if line.startswith("|")]
    verdicts = [without_sourced(row.strip(" |").split(" | ")[-1]) for row in rows]
    measured = [MEASURED.search(verdict) for verdict in verdicts]
    return [
        row.split(" | ")[0].strip("| ")
        for row, found in zip(rows, measured, strict=True)
        if found and re.search(r"\d", found[0]) and not COMMIT.search(found[0])
    ]


def unsourced_paragraphs(page: str) -> list[str]:
    """Paragraphs with a figure that is no stored result and without a commit.

    A list belongs to the paragraph before it.
    """
    text = re.sub(r":\n\n- ", ":\n- ", without_sourced(FENCED.sub("", page)))
    paragraphs = [one for one in text.split("\n\n") if not one.startswith("|")]
    return [one for one in paragraphs if FIGURE.search(one) and not COMMIT.search(one)]


def test_measured_figures_of_the_ledger_have_a_source() -> None:
    assert unsourced_rows(LEDGER.read_text(encoding="utf-8")) == []


def test_figures_in_the_prose_of_the_paper_have_a_source() -> None:
    assert unsourced_paragraphs(PAPER.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("page", [LEDGER, PAPER], ids=lambda page: page.name)
def test_commits_of_a_page_exist(page: Path) -> None:
    git = ["git", "-C", str(ROOT)]
    shallow = subprocess.run([*git, "rev-parse", "--is-shallow-repository"], capture_output=True)
    if shallow.stdout.strip() != b"false":
        pytest.skip("needs the whole history of the repository")
    commits = COMMIT.findall(page.read_text(encoding="utf-8"))
    kinds = [
        subprocess.run([*git, "cat-file", "-t", commit], capture_output=True).stdout.strip()
        for commit in commits
    ]
    assert commits
    assert [one for one, kind in zip(commits, kinds, strict=True) if kind != b"commit"] == []


ROW = "| Eq. 7 | R = A A^T | `a.py` | `b.py` | deviates because of 2 blocks; {} |\n"


@pytest.mark.parametrize(
    "verdict",
    [
        "measured: the same frames",
        "measured: Eq. 4 needs `bits=8`, see [Fig. 3](paper.md#fig-3)",
        "measured at 51c51bbe: KG 1.75 % with 20 rows",
        "measured: <!-- results: rotation -->KG -0.1 %<!-- end of results -->",
    ],
)
def test_rows_with_a_source_pass(verdict: str) -> None:
    assert unsourced_rows(ROW.format(verdict)) == []


@pytest.mark.parametrize(
    "verdict",
    [
        "measured: KG 1.75 % with 20 rows",
        "measured: 13 of <!-- results: rotation -->KG -0.1 %<!-- end of results -->",
        "measured: KG 1234567 %",
        "with 8 bits KG is 0.2 % higher",
        "Measured with 8 bits (facade)",
    ],
)
def test_rows_without_a_source_are_found(verdict: str) -> None:
    assert unsourced_rows(ROW.format(verdict)) == ["Eq. 7"]


def test_figures_of_prose_need_a_source() -> None:
    table = "<!-- results: seconds -->\n| 0.5 |\n<!-- end of results -->\n"
    sourced = f"At fbb5bab9:\n\n- 5 % more\n- 3 times\n\n{table}"
    assert unsourced_paragraphs(sourced + "\n20 rows of 8 bits, `q=0.5`\n") == []
    for figure in ("0.04 bits", "80 to 264\n%", "7 times"):
        assert unsourced_paragraphs(f"{sourced}\nIt takes {figure}.") == [f"It takes {figure}."]
