"""What pages say of the program is so: commands, options, links, files."""

import re

import pytest

import meshreel
from meshreel.batch.discovery import WHOLE_SEQUENCES
from meshreel.cli.batch import FRAMES, WHOLE
from meshreel.cli.commands import COMMANDS as NAMES
from meshreel.cli.commands import command_named
from meshreel.formats.registry import FRAME_FORMATS
from samples.pages import PAGES, README, ROOT, name_of, parts_of, prose, snippets

COMMANDS = {name: command_named(name) for name in NAMES}
LANGUAGES = {"bash", "c", "html", "js", "python", "text"}
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
