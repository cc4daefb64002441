"""docs/equations.md has a row for each statement of the paper; the code must agree."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import meshreel
from meshreel.paper.study.findings import CLAIMS

SOURCE = Path(meshreel.__file__).parent
TESTS = Path(__file__).parents[1]
LEDGER = (TESTS.parent / "docs" / "equations.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (.+?) \| (.+?) \| `([^`]+)` \| `([^`]+)` \| (.+) \|$", LEDGER, re.MULTILINE)
EQUATIONS = [
    (name, home, test) for name, _, home, test, _ in ROWS if re.fullmatch(r"Eq\. \d+|Alg\. 1", name)
]
VERDICT = re.compile(r"faithful(;.+)?|deviates because .+; measured:? .+")


@cache
def docstrings(path):
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    text = path.read_text(encoding="utf-8")
    if "paper " not in text:  # skip parsing of most modules, which name no equation
        return ""
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    return "\n".join(ast.get_docstring(node) or "" for node in nodes)


def homes(equation):
    """Return files with a docstring that names the equation of the paper."""
    pattern = re.compile(rf"paper {re.escape(equation)}\b")
    return {
        str(path.relative_to(SOURCE))
        for path in SOURCE.rglob("*.py")
        if pattern.search(docstrings(path))
    }


def home_of(path):
    """A file of the package, or of the repository if it is in one of these folders."""
    return (TESTS.parent if path.startswith(("bench/", "docs/")) else SOURCE) / path


def test_ledger_lists_every_equation_of_the_paper():
    assert [equation for equation, _, _ in EQUATIONS] == [
        *(f"Eq. {number}" for number in range(1, 14)),
        "Alg. 1",
    ]


def test_ledger_has_a_row_for_every_statement():
    names = [name for name, *_ in ROWS]
    assert len(names) >= 80
    assert len(set(names)) == len(names)
    assert [claim.text for claim in CLAIMS if claim.text not in names] == []


def test_every_row_is_faithful_or_states_a_measured_deviation():
    assert [name for name, *_, verdict in ROWS if not VERDICT.fullmatch(verdict)] == []


def test_every_row_names_a_home_and_a_test_that_exist():
    missing = [
        (name, path)
        for name, _, home, test, _ in ROWS
        for path in (home_of(home), TESTS / test)
        if not path.is_file()
    ]
    assert missing == []


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "home", "test"), EQUATIONS)
def test_ledger_names_the_module_of_an_equation(equation, home, test):
    assert homes(equation) == {home}


@pytest.mark.parametrize(("equation", "home", "test"), EQUATIONS)
def test_ledger_names_the_test_of_an_equation(equation, home, test):
    assert re.search(rf"{re.escape(equation)}\b", (TESTS / test).read_text(encoding="utf-8"))
