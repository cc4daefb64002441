"""Faults that `mutation.run` inserts into sources, and the tests of each package."""

import ast
from pathlib import Path

import pytest

from mutation.edits import c_edits, python_edits
from mutation.mutants import mutant_of, own_prefixes, sources

ROOT = Path(__file__).parents[2]

PYTHON = '''"""A docstring with 1 < 2."""

def found(given: int | None = 3, *, limit: float = 0.5) -> int:
    """Return 1 + 1."""
    if given is not None and given <= limit:
        given += 1
    elif given:
        raise ValueError(f"{given + 1} is not in 0..{limit}")
    record(given)
    return given * 2
'''
C = """/* 1 < 2 */
#define MOST 3
int found(int *given, int n) {
    if (n >= 2 && given[0] != '4') {
        return -n << 1U; // 5 + 5
    }
    return n - *given;
}
"""


def changes(source, edits):
    """Old and new text of each edit, by kind."""
    data = source.encode()
    return {(edit.kind, data[edit.start : edit.end].decode(), edit.new) for edit in edits}


def test_python_decisions_are_edited():
    edits = python_edits(PYTHON.encode())
    assert changes(PYTHON, edits) == {
        ("constant", "3", "4"), ("constant", "3", "2"), ("constant", "0.5", "1.0"),
        ("condition", "given is not None and given <= limit",
         "(not (given is not None and given <= limit))"),
        ("condition", "given", "(not (given))"),
        ("comparison", "is not", "is"), ("comparison", "<=", "<"), ("comparison", "<=", ">"),
        ("logic", "and", "or"), ("arithmetic", "+=", "-="), ("arithmetic", "*", "//"),
        ("constant", "1", "2"), ("constant", "1", "0"),
        ("constant", "2", "3"), ("constant", "2", "1"),
        ("deleted", "given += 1", "pass"), ("deleted", "record(given)", "pass"),
        ("deleted", 'raise ValueError(f"{given + 1} is not in 0..{limit}")', "pass"),
        ("returned", "given * 2", "0"),
    }  # fmt: skip
    for edit in edits:
        ast.parse(mutant_of(edit, "modules", "a.py", PYTHON.encode()).applied(PYTHON))


def test_c_decisions_are_edited():
    assert changes(C, c_edits(C.encode())) == {
        ("condition", "(n >= 2 && given[0] != '4')", "(!(n >= 2 && given[0] != '4'))"),
        ("comparison", ">=", ">"), ("constant", "2", "3"), ("constant", "2", "1"),
        ("logic", "&&", "||"), ("constant", "0", "1"), ("comparison", "!=", "=="),
        ("shift", "<<", ">>"), ("constant", "1U", "2U"), ("constant", "1U", "0U"),
        ("arithmetic", "-", "+"),
    }  # fmt: skip


def test_mutant_is_found_after_its_lines_have_moved():
    edit = next(one for one in python_edits(PYTHON.encode()) if one.kind == "returned")
    mutant = mutant_of(edit, "modules", "a.py", PYTHON.encode())
    assert mutant.applied("x = 1\n" + PYTHON).endswith("    record(given)\n    return 0\n")
    with pytest.raises(ValueError, match="no longer contains 'return given"):
        mutant.applied(PYTHON.replace("* 2", "* 3"))


@pytest.mark.parametrize("package", sources(ROOT))
def test_every_package_has_tests(package):
    paths = [path.relative_to(ROOT).as_posix() for path in ROOT.glob("tests/**/test_*.py")]
    for prefix in own_prefixes(package):
        assert any(path.startswith(prefix) for path in paths), prefix
