"""Commands, options, links and files in the documentation exist."""

import re
import tomllib
from itertools import pairwise

import click
import pytest

import meshreel
from meshreel.app.batch.discovery import WHOLE_SEQUENCES
from meshreel.app.cli.batch import FRAME_EXTENSIONS, SEQUENCE_EXTENSIONS
from meshreel.app.cli.commands import COMMANDS as NAMES
from meshreel.app.cli.commands import command_named
from meshreel.errors import InvalidInputError
from meshreel.formats.registry import FRAME_FORMATS
from samples.pages import PAGES, README, ROOT, name_of, parts_of, prose, snippets

COMMANDS = {name: command_named(name) for name in NAMES}
LANGUAGES = {"bash", "c", "cpp", "csharp", "html", "css", "js", "python", "text", "tsx"}
RUNNER = r"(?:uvx|pipx run)(?: --\w+ \S+)?\s+"
OPEN = {"component"}
"""Parameters that also accept values that shell completion does not list."""
DEVELOPMENT = {"core", "docs", "lint", "test", "test-all", "verify"}
"""Extras for work on meshreel."""
every_page = pytest.mark.parametrize("page", PAGES, ids=name_of)


def commands_of(page):
    """Yield the words of all `meshreel` commands in snippets and prose, also with uvx or pipx."""
    lines = [
        line
        for snippet in snippets(page)
        if snippet.language == "bash"
        for line in snippet.command_lines
    ]
    inline = re.findall(rf"`((?:{RUNNER})?meshreel [^`]+)`", prose(page))
    for line in [re.sub(f"^{RUNNER}", "", line) for line in [*lines, *inline]]:
        for words in parts_of(line):
            if words[0] == "meshreel":
                yield words[1:]


def slug(heading):
    """Return the anchor of a heading."""
    words = re.sub(r"`|\[|\]\([^)]*\)", "", heading).lower()
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", words).strip())


def anchors_of(page):
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)}


@every_page
def test_options_of_commands_exist(page):
    for name, *words in commands_of(page):
        assert name.startswith("--") or name in COMMANDS, name
        if name not in COMMANDS:
            continue
        options = {flag for param in COMMANDS[name].params for flag in flags_of(param)}
        used = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert used <= options | {"--help"}, (name, used - options)


def flags_of(param):
    return (*param.opts, *param.secondary_opts)


def param_named(command, flag):
    """Return the parameter of a command with this flag, or None."""
    return next((param for param in COMMANDS[command].params if flag in flags_of(param)), None)


def is_allowed(param, value):
    """Whether a value is valid for an option."""
    context = click.Context(click.Command("any"))
    choices = param.shell_complete(context, "")
    if choices and {choice.type for choice in choices} == {"plain"} and param.name not in OPEN:
        return value in {choice.value for choice in choices}
    try:
        param.type.convert(value, param, context)
    except (click.UsageError, InvalidInputError):
        return False
    return True


def option_values(words):
    """Return candidate pairs of an option and its value."""
    joined = [word.partition("=")[::2] for word in words if re.match("--[a-z-]+=", word)]
    return [*joined, *pairwise(words)]


@every_page
def test_option_values_of_commands_are_valid(page):
    for name, *words in commands_of(page):
        for flag, value in option_values(words) if name in COMMANDS else ():
            param = param_named(name, flag)
            if param is not None and not param.is_flag and not is_placeholder(value):
                assert is_allowed(param, value), (name, flag, value)


@every_page
def test_option_values_in_prose_are_valid(page):
    for flag, value in re.findall(r"`(--[a-z][a-z-]*)[ =]([^`\s]+)[^`]*`", prose(page)):
        params = [param for name in COMMANDS if (param := param_named(name, flag))]
        if params and not params[0].is_flag and not is_placeholder(value):
            assert any(is_allowed(param, value) for param in params), (flag, value)


def is_placeholder(value):
    """Whether a word is a placeholder such as N, PATH or "..."."""
    return value.isupper() or set(value) == {"."}


@pytest.mark.parametrize(
    ("command", "flag", "value", "expected"),
    [
        ("encode", "--effort", "9", True),
        ("encode", "--effort", "high", False),
        ("encode", "--effort", "10", False),
        ("encode", "--method", "reel", True),
        ("encode", "--method", "zip", False),
        ("decode", "--layout", "openvat", True),
        ("render", "--up", "w", False),
        ("render", "--component", "3", True),
        ("encode", "--max-error", "0.5mm", True),
    ],
)
def test_valid_values_are_recognized(command, flag, value, expected):
    assert is_allowed(param_named(command, flag), value) is expected


def options_of_programs():
    """Return the options of all commands and of the scripts of the repository."""
    params = [param for command in COMMANDS.values() for param in command.params]
    known = {flag for param in params for flag in flags_of(param)}
    for folder in ("bench", "conformance", "core", "docs"):
        for path in (ROOT / folder).rglob("*.py"):
            known |= set(re.findall(r'"(--[a-z][a-z-]*)"', path.read_text(encoding="utf-8")))
    return known | {"--help", "--version"}


@every_page
def test_only_the_last_command_of_a_snippet_may_wait(page):
    for snippet in snippets(page):
        if snippet.language == "bash":
            commands = [words[:2] for line in snippet.command_lines for words in parts_of(line)]
            assert ["meshreel", "view"] not in commands[:-1], snippet.text


@every_page
def test_options_in_prose_exist(page):
    named = set(re.findall(r"`(--[a-z][a-z-]*)", prose(page)))
    assert named - options_of_programs() - {"--all", "--platform"} == set()  # of pytest and pip


@every_page
def test_snippets_state_their_language(page):
    assert {snippet.language for snippet in snippets(page)} <= LANGUAGES


@every_page
def test_links_lead_to_existing_files_and_headings(page):
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(#[^)\s]*)?\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        linked = (page.parent / target).resolve() if target else page
        assert linked.exists(), target
        assert linked.is_relative_to(ROOT)
        assert not anchor or anchor[1:] in anchors_of(linked), f"{target}{anchor}"


@every_page
def test_mentioned_files_of_the_repository_exist(page):
    folders = "bench|docs|examples|tests|src|release|\\.ci|\\.github|integrations"
    named = rf"`(?:python )?((?:{folders})/[\w./-]*)[^`]*`(\s+of\s+[0-9a-f]{{8}})?"
    for path, is_of_commit in re.findall(named, prose(page)):
        assert is_of_commit or (ROOT / path).exists(), path


@every_page
def test_headings_are_no_rows_of_tables(page):
    assert re.findall(r"^\|.*\n(?=[^|\n])(?!<!-- end)", prose(page), re.MULTILINE) == []


def test_the_reference_lists_every_public_name():
    listed = re.findall(r"^::: meshreel\.(\w+)$", (ROOT / "docs/api.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(meshreel.__all__)


def test_the_reference_lists_every_name_of_the_paper_package():
    text = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^::: meshreel\.paper\.(\w+)$", text, re.MULTILINE)
    assert sorted([*listed, "METHODS"]) == sorted(meshreel.paper.__all__)


def test_every_command_has_a_table_of_options():
    text = (ROOT / "docs/options.md").read_text(encoding="utf-8")
    tables = re.findall(r"^<!-- options: (\w+) -->$", text, re.MULTILINE)
    assert {*tables, "formats"} == set(COMMANDS)


def test_installation_lists_every_extra_for_users():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    rows = re.findall(r"^\| (`.*?) \|", (ROOT / "docs/install.md").read_text("utf-8"), re.MULTILINE)
    listed = re.findall(r"`(\w+)`", " ".join(rows))
    assert sorted(listed) == sorted(project["optional-dependencies"].keys() - DEVELOPMENT)


def test_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.parametrize("listed", [SEQUENCE_EXTENSIONS, FRAME_EXTENSIONS])
def test_guide_and_help_list_the_formats_of_batch(listed):
    expected = WHOLE_SEQUENCES if listed is SEQUENCE_EXTENSIONS else FRAME_FORMATS
    assert set(listed.split()) == set(expected)
    guide = (ROOT / "docs/guides/batch.md").read_text(encoding="utf-8")
    assert listed in " ".join(guide.split())
