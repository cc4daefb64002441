"""docs/equations.md locates each equation of the paper; the code must agree."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import meshreel

SOURCE = Path(meshreel.__file__).parent
TESTS = Path(__file__).parents[1]
LEDGER = (TESTS.parent / "docs" / "equations.md").read_text(encoding="utf-8")
ROWS = re.findall(
    r"^\| (Eq\. \d+|Alg\. 1) \|[^|]*\| `([^`]+)` \| `([^`]+)` \|", LEDGER, re.MULTILINE
)


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


def test_ledger_lists_every_equation_of_the_paper():
    assert [equation for equation, _, _ in ROWS] == [
        *(f"Eq. {number}" for number in range(1, 14)),
        "Alg. 1",
    ]


@pytest.mark.parametrize(("equation", "home", "test"), ROWS)
def test_ledger_names_the_module_of_an_equation(equation, home, test):
    assert homes(equation) == {home}


@pytest.mark.parametrize(("equation", "home", "test"), ROWS)
def test_ledger_names_the_test_of_an_equation(equation, home, test):
    assert re.search(rf"{re.escape(equation)}\b", (TESTS / test).read_text(encoding="utf-8"))
