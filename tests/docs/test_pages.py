"""What pages say of the program is so: commands, options, links, files."""

import re
from itertools import pairwise

import click
import pytest

import meshreel
from meshreel.app.batch.discovery import WHOLE_SEQUENCES
from meshreel.app.cli.batch import FRAMES, WHOLE
from meshreel.app.cli.commands import COMMANDS as NAMES
from meshreel.app.cli.commands import command_named
from meshreel.errors import InvalidInputError
from meshreel.formats.registry import FRAME_FORMATS
from samples.pages import PAGES, README, ROOT, name_of, parts_of, prose, snippets

COMMANDS = {name: command_named(name) for name in NAMES}
LANGUAGES = {"bash", "c", "cpp", "csharp", "html", "css", "js", "python", "text", "tsx"}
OPEN = {"component"}
"""Parameters that take other values than those that the shell completes."""
every_page = pytest.mark.parametrize("page", PAGES, ids=name_of)


def commands_of(page):
    """Words of all commands of this program, in snippets and within sentences."""
    lines = [
        line
        for snippet in snippets(page)
        if snippet.language == "bash"
        for line in snippet.command_lines
    ]
    inline = re.findall(r"`(meshreel [^`]+)`", prose(page))
    for line in [*lines, *inline]:
        for words in parts_of(line):
            if words[0] == "meshreel":
                yield words[1:]


def slug(heading):
    """The anchor of a heading."""
    words = re.sub(r"`|\[|\]\([^)]*\)", "", heading).lower()
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", words).strip())


def anchors_of(page):
    """Anchors of all headings of a page."""
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)}


@every_page
def test_options_exist_when_a_command_names_them(page):
    for name, *words in commands_of(page):
        assert name.startswith("--") or name in COMMANDS, name
        if name not in COMMANDS:
            continue
        options = {one for param in COMMANDS[name].params for one in param.opts} | {"--help"}
        options |= {one for param in COMMANDS[name].params for one in param.secondary_opts}
        given = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert given <= options, (name, given - options)


def param_named(command, flag):
    """The option of a command that has this name, or None."""
    found = (one for one in COMMANDS[command].params if flag in (*one.opts, *one.secondary_opts))
    return next(found, None)


def is_allowed(param, value):
    """Whether a value is one of the choices of an option, or a number of its range, if it has."""
    context = click.Context(click.Command("any"))
    choices = param.shell_complete(context, "")
    if choices and {one.type for one in choices} == {"plain"} and param.name not in OPEN:
        return value in {one.value for one in choices}
    try:
        param.type.convert(value, param, context)
    except (click.UsageError, InvalidInputError):
        return False
    return True


def given_values(words):
    """Pairs of an option and the word that is its value, if a command is given these words."""
    joined = [word.partition("=")[::2] for word in words if re.match("--[a-z-]+=", word)]
    return [*joined, *pairwise(words)]


@every_page
def test_values_of_options_are_allowed_when_a_command_names_them(page):
    for name, *words in commands_of(page):
        for flag, value in given_values(words) if name in COMMANDS else ():
            param = param_named(name, flag)
            if param is not None and not param.is_flag and not is_placeholder(value):
                assert is_allowed(param, value), (name, flag, value)


@every_page
def test_values_of_options_are_allowed_when_a_sentence_names_them(page):
    for flag, value in re.findall(r"`(--[a-z][a-z-]*)[ =]([^`\s]+)[^`]*`", prose(page)):
        params = [param for name in COMMANDS if (param := param_named(name, flag))]
        if params and not params[0].is_flag and not is_placeholder(value):
            assert any(is_allowed(param, value) for param in params), (flag, value)


def is_placeholder(value):
    """Whether a word is a placeholder of a value: N, PATH, "..."."""
    return value.isupper() or set(value) == {"."}


@pytest.mark.parametrize(
    ("command", "flag", "value", "expected"),
    [
        ("encode", "--effort", "9", True),
        ("encode", "--effort", "high", False),
        ("encode", "--effort", "10", False),
        ("encode", "--method", "reel", True),
        ("encode", "--method", "zip", False),
        ("decode", "--layout", "labs", True),
        ("render", "--up", "w", False),
        ("render", "--component", "3", True),
        ("encode", "--max-error", "0.5mm", True),
    ],
)
def test_values_are_told_apart(command, flag, value, expected):
    assert is_allowed(param_named(command, flag), value) is expected


def options_of_programs():
    """Options of all commands, and of the scripts of the repository."""
    params = [param for command in COMMANDS.values() for param in command.params]
    known = {one for param in params for one in (*param.opts, *param.secondary_opts)}
    for folder in ("bench", "conformance", "core", "docs"):
        for path in (ROOT / folder).rglob("*.py"):
            known |= set(re.findall(r'"(--[a-z][a-z-]*)"', path.read_text(encoding="utf-8")))
    return known | {"--help", "--version"}


@every_page
def test_snippets_end_with_the_command_that_waits_when_they_have_one(page):
    for snippet in snippets(page):
        if snippet.language == "bash":
            commands = [words[:2] for line in snippet.command_lines for words in parts_of(line)]
            assert ["meshreel", "view"] not in commands[:-1], snippet.text


@every_page
def test_options_exist_when_a_sentence_names_them(page):
    named = set(re.findall(r"`(--[a-z][a-z-]*)", prose(page)))
    assert named - options_of_programs() - {"--all", "--platform"} == set()  # of pytest and pip


@every_page
def test_snippets_say_their_language(page):
    assert {snippet.language for snippet in snippets(page)} <= LANGUAGES


@every_page
def test_links_lead_to_files_and_headings_that_are_there(page):
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(#[^)\s]*)?\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        aim = (page.parent / target).resolve() if target else page
        assert aim.exists(), target
        assert aim.is_relative_to(ROOT)
        assert not anchor or anchor[1:] in anchors_of(aim), f"{target}{anchor}"


@every_page
def test_files_of_the_repository_are_there_when_they_are_named(page):
    named = r"`((?:bench|docs|examples|tests|src|\.ci|\.github|integrations)/[\w./-]*)`"
    for path in re.findall(named, prose(page)):
        assert (ROOT / path).exists(), path


def test_every_public_name_has_its_place_in_the_reference():
    listed = re.findall(r"^::: meshreel\.(\w+)$", (ROOT / "docs/api.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(meshreel.__all__)


def test_every_name_of_the_paper_package_has_its_place_in_the_reference():
    text = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^::: meshreel\.paper\.(\w+)$", text, re.MULTILINE)
    assert sorted([*listed, "METHODS"]) == sorted(meshreel.paper.__all__)


def test_every_command_has_its_table_of_options():
    text = (ROOT / "docs/options.md").read_text(encoding="utf-8")
    tables = re.findall(r"^<!-- options: (\w+) -->$", text, re.MULTILINE)
    assert {*tables, "formats"} == set(COMMANDS)


def test_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.parametrize("told", [WHOLE, FRAMES])
def test_guide_and_help_tell_what_batch_takes(told):
    expected = WHOLE_SEQUENCES if told is WHOLE else FRAME_FORMATS
    assert set(told.split()) == set(expected)
    guide = (ROOT / "docs/guides/batch.md").read_text(encoding="utf-8")
    assert told in " ".join(guide.split())
