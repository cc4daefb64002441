"""Hooks of mkdocs: pages that live outside of docs/, tables of options, and where the API is.

`mkdocs build --strict` runs them (see mkdocs.yml).

- CHANGELOG.md, CONTRIBUTING.md and the READMEs of integrations are pages of the site, too.
- A line ``<!-- options: encode -->`` becomes a table of the options of that command, and
  ``<!-- options of encoding -->`` those of `meshreel.encode` with the methods that take them.
- A line ``<!-- player: flag -->`` becomes a player of that stream (gallery_streams.py): the element
  of the package for pages, or one that draws with three.js; ``<!-- figures: flag -->`` becomes its
  sizes and errors.
- A line ``::: meshreel.encode`` names what users import; it is documented where it is defined.
"""

import inspect
import re
from operator import attrgetter
from pathlib import Path
from typing import Any

from gallery_streams import gallery
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from mkdocs.utils import get_relative_url
from option_texts import options_tables

import meshreel
from meshreel.app.cli.commands import command_named, default_text
from meshreel.app.cli.parameters import ClickOption

ROOT = Path(__file__).parents[1]
OUTSIDE = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "integrations/blender/README.md": "blender-add-on.md",
}
"""Pages of the site that lie elsewhere in the repository, and their place on the site."""

OPTIONS = re.compile(r"^<!-- options: (\w+) -->$", re.MULTILINE)
OPTIONS_OF_ENCODING = "<!-- options of encoding -->"
PLAYER = re.compile(r"<!-- player: (\w+) -->")
FIGURES = re.compile(r"<!-- figures: (\w+) -->")
SCRIPTS = {
    "reel-player": ROOT / "npm/dist/player.js",
    "three-figure": ROOT / "npm/site/three_figure.js",
}
"""Scripts of the elements that play animations, which `npm run build` makes."""

MODULES = (ROOT / "npm/dist/reel.wasm", ROOT / "npm/dist/reel_full.wasm")
"""The decoder, which the script of the package loads from its own folder."""

COMMITTED_PAGE = ROOT / "src/meshreel/app/viewer/page/player.js"
"""The page of `meshreel view`, which defines <reel-player> too."""

PLAYER_FOLDER = "player"
"""Place on the site of the scripts, and of the animations."""

PUBLIC = re.compile(r"^::: meshreel\.([\w.]+)$", re.MULTILINE)
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")


def on_startup(command: str, dirty: bool) -> None:
    """Let `mkdocs serve` play with the committed page if the package is not built."""
    if command == "serve" and not all(script.is_file() for script in SCRIPTS.values()):
        SCRIPTS.clear()
        SCRIPTS["reel-player"] = COMMITTED_PAGE  # contains the decoder


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The files of the site, with those that lie outside of docs/."""
    for source, place in OUTSIDE.items():
        files.append(File.generated(config, place, abs_src_path=str(ROOT / source)))
    contents = {f"{name}{shown.extension}": shown.data for name, shown in gallery().items()}
    modules = () if COMMITTED_PAGE in SCRIPTS.values() else MODULES
    for path in (*SCRIPTS.values(), *modules):
        if not path.is_file():
            raise PluginError(f"{path} is not built: npm ci && npm run build in npm/")
        contents[path.name] = path.read_bytes()
    for name, content in contents.items():
        files.append(File.generated(config, f"{PLAYER_FOLDER}/{name}", content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The text of a page with its links, tables of options and public names replaced."""
    markdown = LINK.sub(lambda found: _site_link(found, page.file.src_uri), markdown)
    markdown = OPTIONS.sub(lambda found: options_table(found[1]), markdown)
    markdown = markdown.replace(OPTIONS_OF_ENCODING, options_tables())
    markdown = PLAYER.sub(lambda found: player(found[1], page), markdown)
    markdown = FIGURES.sub(lambda found: gallery()[found[1]].figures, markdown)
    return PUBLIC.sub(lambda found: _definition(found[1]), markdown)


def player(name: str, page: Page) -> str:
    """HTML of a player of a stream, for a page of the site."""
    folder = get_relative_url(f"{PLAYER_FOLDER}/", page.url)
    shown = gallery()[name]
    if shown.element not in SCRIPTS:
        return "*Drawn by three.js after `npm ci && npm run build` in `npm/`.*"
    attributes = shown.attributes
    if shown.element == "reel-player":
        attributes += ' loading="lazy" autoplay loop camera-controls controls'
    return (
        f'<script type="module" src="{folder}{SCRIPTS[shown.element].name}"></script>\n'
        f'<{shown.element} src="{folder}{name}{shown.extension}" {attributes}></{shown.element}>'
    )


def _site_link(found: re.Match[str], page: str) -> str:
    """A link between files of the repository as one between pages of the site."""
    target, anchor = found[1], found[2] or ""
    if re.match(r"[a-z]+:", target):
        return found[0]
    homes = {place: source for source, place in OUTSIDE.items()}
    here = ROOT / homes.get(page, f"docs/{page}")
    wanted = (here.parent / target).resolve()
    if not wanted.is_relative_to(ROOT):
        return found[0]
    source = wanted.relative_to(ROOT).as_posix()
    place = OUTSIDE.get(source, source.removeprefix("docs/"))
    up = "../" * page.count("/")
    return f"]({up}{place}{anchor})"


def options_table(command: str) -> str:
    """A Markdown table of the options of a command of `meshreel`, a section for each panel.

    Parameters
    ----------
    command : str
        Its name, such as "encode".

    Raises
    ------
    KeyError
        If there is no such command.
    """
    found = command_named(command)
    panels: dict[str, list[str]] = {}
    for option in found.params:
        if not isinstance(option, ClickOption) or option.hidden:
            continue
        panel = option.panel
        panels.setdefault(panel, []).append(_row(option))
    return "\n\n".join(_panel(name, rows) for name, rows in sorted(panels.items()))


def _panel(name: str, rows: list[str]) -> str:
    head = [f"**{name}**", ""] if name else []
    return "\n".join([*head, "| option | meaning |", "|---|---|", *rows])


def _row(option: ClickOption) -> str:
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    default = default_text(option)
    shown = f" Default: `{default}`." if default else ""
    meaning = " ".join((option.help or "").split()).replace("|", "\\|")
    return f"| {names} | {meaning}{shown} |"


def _definition(name: str) -> str:
    """What mkdocstrings is to document for a public name, under the name that users import."""
    defined = f"meshreel.{name}"
    if not name.startswith("torch."):  # whose names are defined there; PyTorch may be missing
        found: Any = inspect.unwrap(attrgetter(name)(meshreel))
        defined = f"{found.__module__}.{found.__qualname__}"
    label = name.rpartition(".")[2]
    options = f"    options:\n      heading: meshreel.{name}\n      toc_label: {label}"
    return f"::: {defined}\n{options}"
