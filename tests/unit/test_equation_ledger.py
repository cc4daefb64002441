"""docs/equations.md has a row for each statement of the paper; the code must agree."""

import ast
import re
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import meshreel
from meshreel.paper import METHODS
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
    assert len(names) >= 55
    assert len(set(names)) == len(names)
    assert [claim.text for claim in CLAIMS if f"| {claim.text} |" not in LEDGER] == []


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


@pytest.fixture(scope="module")
def executed():
    """Modules of the package that run when streams of all methods are encoded and decoded."""
    sequence, files = meshreel.simulate_flag(8, n_rows=8, n_columns=9), set()
    sys.setprofile(lambda frame, *_: files.add(frame.f_code.co_filename))
    try:
        for method in METHODS:
            options = {"block_frames": 4} if method == "blocks" else {}
            meshreel.decode(meshreel.encode(sequence, method, n_modes=3, **options))
    finally:
        sys.setprofile(None)
    paths = [Path(file) for file in files]
    return {path.relative_to(SOURCE).as_posix() for path in paths if SOURCE in path.parents}


@cache
def imported_modules(path):
    """Modules that a test imports, and modules that define what it imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = import_module(node.module)
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            names |= {
                getattr(getattr(module, alias.name, None), "__module__", None)
                for alias in node.names
            }
    return names


def exercises(name, home, test, executed):
    """Whether a test names its row, or imports the home of it, or encodes streams that run it."""
    path, module = TESTS / test, home.removesuffix(".py").replace("/", ".")
    text = path.read_text(encoding="utf-8")
    if home.startswith(("bench/", "docs/")):
        return path.name == f"test_{Path(home).stem}.py" and Path(home).stem in text
    return (
        f"meshreel.{module}" in imported_modules(path)
        or f'"{name}"' in text
        or (home in executed and "encode(" in text)
    )


def test_test_of_every_row_exercises_its_home(executed):
    rows = [(name, home, test) for name, _, home, test, _ in ROWS]
    assert [row for row in rows if not exercises(*row, executed=executed)] == []


def test_other_tests_do_not_exercise_a_home(executed):
    assert not exercises("Eq. 3", "paper/laplacian.py", "unit/metrics/test_sted.py", executed)
    assert not exercises("STED", "metrics/sted.py", "unit/paper/test_variants.py", executed)
    assert not exercises("Fig. 1", "docs/paper_pipeline.py", "unit/test_api.py", executed)


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "home", "test"), EQUATIONS)
def test_ledger_names_the_module_of_an_equation(equation, home, test):
    assert homes(equation) == {home}


@pytest.mark.parametrize(("equation", "home", "test"), EQUATIONS)
def test_ledger_names_the_test_of_an_equation(equation, home, test):
    assert re.search(rf"{re.escape(equation)}\b", (TESTS / test).read_text(encoding="utf-8"))
