"""Keywords in messages of the library become options on the command line."""

import ast
import copy
import pickle
from pathlib import Path

import pytest

import meshreel
from meshreel.app.cli.commands import COMMANDS, command_named
from meshreel.app.cli.messages import flag_of, with_options
from meshreel.errors import InvalidInputError, Keyword, Message

ROOT = Path(meshreel.__file__).parent
OPTIONS = {
    option
    for command in COMMANDS
    for param in command_named(command).params
    for option in param.opts
}
PYTHON_ONLY = {"texture_output", "energy"}
"""Keywords that the command line checks itself, or does not have."""


def keywords(path):
    """Names of the keywords in the messages of a module, as far as they are literals."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Call(func=ast.Name("Keyword"), args=[ast.Constant(name), *_]):
                yield name


def test_keywords_of_messages_are_options_of_the_command_line():
    names = {name for path in ROOT.rglob("*.py") for name in keywords(path)}
    assert len(names) > 15
    assert {name for name in names - PYTHON_ONLY if flag_of(name) not in OPTIONS} == set()


@pytest.mark.parametrize(
    ("parts", "python", "command_line"),
    [
        (("use ", Keyword("overwrite", True)), "use overwrite=True", "use --force"),
        ((Keyword("n_modes"), " must be 1"), "n_modes must be 1", "--modes must be 1"),
        (("a (", Keyword("order", "drop"), ")"), 'a (order="drop")', "a (--order drop)"),
        (("max_error.npz: damaged",), "max_error.npz: damaged", "max_error.npz: damaged"),
    ],
)  # fmt: skip
def test_message_names_keywords_in_python_and_options_on_the_command_line(
    parts, python, command_line
):
    error = InvalidInputError(*parts)
    for message in (Message(*parts), error.message, pickle.loads(pickle.dumps(error)).message,
                    copy.deepcopy(error.message)):  # fmt: skip
        assert message == python
        assert with_options(message) == command_line
    assert str(error) == python
    assert with_options(Message.prefixed("x: ", error.message)) == f"x: {command_line}"


def test_plain_text_is_unchanged():
    assert with_options("use overwrite=True") == "use overwrite=True"
    assert Message.prefixed("x: ", "fps=") == "x: fps="
