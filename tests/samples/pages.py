"""The pages that users read, and the snippets in them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = [
    README,
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "integrations").glob("*/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INSTALLS = re.compile(r"^pip install [^&]*(&&)?")
OF_OTHERS = re.compile(r"(#|//) with (?P<what>[^:\n]+)")
"""How a snippet begins that needs a program or a file that is not here, and says which."""


@dataclass(frozen=True)
class Snippet:
    """A block of code on a page.

    Attributes
    ----------
    language : str
        "bash" and "python" are run; "text" and "toml" are not code; all else is of other programs.
    text : str
    """

    language: str
    text: str

    @property
    def needs(self):
        """What must be there to run it, as its first line says; None if this package does."""
        found = OF_OTHERS.match(self.text)
        return found["what"] if found else None

    @property
    def command_lines(self):
        """The lines of a shell, without what installs things or runs the tests."""
        lines = [INSTALLS.sub("", line).strip() for line in self.text.splitlines()]
        return [line for line in lines if line and not line.startswith(("#", "pytest"))]


def snippets(page):
    """The snippets of a page, from top to bottom."""
    text = page.read_text(encoding="utf-8")
    return [Snippet(language, block) for language, block in FENCED.findall(text)]


def prose(page):
    """A page without its snippets."""
    return FENCED.sub("", page.read_text(encoding="utf-8"))


def parts_of(line):
    """The commands of a line that are joined by &&, as words."""
    parts = (shlex.split(part, comments=True) for part in line.split("&&"))
    return [words for words in parts if words]


def name_of(page):
    """The page, to tell tests apart."""
    return page.relative_to(ROOT).as_posix()
