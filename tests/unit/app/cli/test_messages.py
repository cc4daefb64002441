"""Every message of the library that names a keyword names an option on the command line."""

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
    """The strings of a module that are no docstrings; "fps" stands for what is filled in."""
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
    """Those of the library that name keywords."""
    return {
        text
        for path in ROOT.rglob("*.py")
        if "cli" not in path.relative_to(ROOT).parts
        for text in sentences(path)
        if " " in text and text[0] != "<" and with_option_names(text) != text
    }


def test_messages_that_name_keywords_are_found_in_the_library(messages):
    assert len(messages) > 15
    assert any("overwrite=True" in text for text in messages)


def test_messages_name_options_that_exist_when_the_command_line_says_them(messages):
    said = [with_option_names(text) for text in sorted(messages)]
    assert [text for text in said if KEYWORD_LEFT.search(text)] == []
    named = [(text, set(re.findall(r"--[a-z][a-z-]*", text))) for text in said]
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
def test_keywords_become_options_when_they_are_said_as_keywords(message, expected):
    assert with_option_names(message) == expected


def test_notes_come_once_when_they_say_the_same_in_option_names():
    assert all_with_option_names(["give fps=", "give --fps (fps=)"]) == ["give --fps"]
