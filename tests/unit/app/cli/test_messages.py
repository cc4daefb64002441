"""Keywords in messages of the library become options on the command line."""

import ast
import re
from pathlib import Path

import pytest

import meshreel
from meshreel.app.cli.commands import COMMANDS, command_named
from meshreel.app.cli.messages import all_with_option_names, with_option_names

ROOT = Path(meshreel.__file__).parent
OPTIONS = {
    option
    for command in COMMANDS
    for param in command_named(command).params
    for option in param.opts
}
KEYWORD_LEFT = re.compile(r"(?<![\w./'\"-])[a-z]\w*=(?:True|False|\"\w+\")?(?=[\s),;:.]|$)")


def sentences(path):
    """Yield the strings of a module except docstrings; "fps" replaces formatted values."""
    nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    pieces = {id(part) for node in nodes if isinstance(node, ast.JoinedStr)
              for part in ast.walk(node)}  # fmt: skip
    documents = {
        id(node.value) for node in nodes
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }  # fmt: skip
    left_out = pieces | documents
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else "fps" for part in node.values
            )
        elif isinstance(value := getattr(node, "value", 0), str) and id(node) not in left_out:
            yield value


@pytest.fixture(scope="module")
def messages():
    """Messages of the library with keywords."""
    return {
        text
        for path in ROOT.rglob("*.py")
        if "cli" not in path.relative_to(ROOT).parts
        for text in sentences(path)
        if " " in text and text[0] != "<" and with_option_names(text) != text
    }


def test_library_has_messages_with_keywords(messages):
    assert len(messages) > 15
    assert any("overwrite=True" in text for text in messages)


def test_messages_name_existing_options_on_the_command_line(messages):
    converted = [with_option_names(text) for text in sorted(messages)]
    assert [text for text in converted if KEYWORD_LEFT.search(text)] == []
    named = [(text, set(re.findall(r"--[a-z][a-z-]*", text))) for text in converted]
    assert [(text, names - OPTIONS) for text, names in named if names - OPTIONS] == []


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("exists; use --force (overwrite=True)", "exists; use --force"),
        ("name it with --topology a.obj (topology=), or", "name it with --topology a.obj, or"),
        ("exists; use overwrite=True", "exists; use --force"),
        ("choose one with object=, or merge=True.", "choose one with --object, or --merge."),
        ("kg= and n_modes= exclude each other", "--kg and --modes exclude each other"),
        ('leave the order out (order="drop")', "leave the order out (--order drop)"),
        ("allow a larger error (max_error)", "allow a larger error (--max-error)"),
        ("dir/max_error.npz: no faces", "dir/max_error.npz: no faces"),
        ("there is no file 'fps='; check it", "there is no file 'fps='; check it"),
        ("x=3 is too much", "x=3 is too much"),
    ],
)
def test_keywords_are_replaced_by_options(message, expected):
    assert with_option_names(message) == expected


def test_notes_that_become_equal_are_merged():
    assert all_with_option_names(["give fps=", "give --fps (fps=)"]) == ["give --fps"]
