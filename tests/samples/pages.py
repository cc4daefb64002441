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
    ROOT / "SECURITY.md",
    *sorted((ROOT / "integrations").glob("*/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHARED = "<!-- snippets share variables -->"
"""Marks a page whose Python snippets use variables of earlier ones."""
INSTALLS = re.compile(r"^pip install [^&]*(&&)?")
REQUIREMENT = re.compile(r"(#|//) with (?P<what>[^:\n]+)")
"""First line of a snippet that needs another program or file, and its name."""


@dataclass(frozen=True)
class Snippet:
    """A block of code on a page.

    Attributes
    ----------
    language : str
        "bash" and "python" are run; "text" and "toml" are not code; others are not run.
    text : str
    """

    language: str
    text: str

    @property
    def needs(self):
        """Return the requirement stated in its first line, or None."""
        match = REQUIREMENT.match(self.text)
        return match["what"] if match else None

    @property
    def command_lines(self):
        """Return the shell commands, without installations and test runs."""
        lines = [INSTALLS.sub("", line).strip() for line in self.text.splitlines()]
        return [line for line in lines if line and not line.startswith(("#", "pytest"))]


def snippets(page):
    """Return the snippets of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [Snippet(language, block) for language, block in FENCED.findall(text)]


def shares_variables(page):
    """Return whether the Python snippets of a page use variables of earlier ones."""
    return SHARED in page.read_text(encoding="utf-8")


def prose(page):
    """Return a page without its snippets."""
    return FENCED.sub("", page.read_text(encoding="utf-8"))


def parts_of(line):
    """Return the words of each command of a line, separated by &&."""
    parts = (shlex.split(part, comments=True) for part in line.split("&&"))
    return [words for words in parts if words]


def name_of(page):
    """Return the id of a page in test names."""
    return page.relative_to(ROOT).as_posix()
