"""Compare all copies of the version and of the address of the repository.

    python release/version.py               # prints the version; lists copies that differ
    python release/version.py --tag v1.0.0  # also checks the tag and the heading of CHANGELOG.md
    python release/version.py --set 1.0.0   # writes all copies
    python release/version.py --notes       # prints the changes of this version

The version is that of `src/meshreel/runtime/version.py`; the address is `Repository` in
`[project.urls]` of `pyproject.toml`. A test compares them.
"""

import argparse
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = "src/meshreel/runtime/version.py"
VERSION = r"\d+\.\d+\.\d+"
COPIES = {
    SOURCE: rf'^__version__ = "({VERSION})"$',
    "CITATION.cff": rf"^version: ({VERSION})$",
    "core/include/meshreel.h": rf'^#define MESHREEL_VERSION "({VERSION})"$',
    "npm/package.json": rf'^  "version": "({VERSION})",$',
    "npm/package-lock.json": rf'^(?:  |      )"name": "meshreel",\n +"version": "({VERSION})",$',
    "npm/examples/react/package.json": rf'^    "meshreel": "\^({VERSION})"',
    "npm/examples/babylon/package.json": rf'^    "meshreel": "\^({VERSION})"',
    "integrations/blender/meshreel_blender/blender_manifest.toml": rf'^version = "({VERSION})"$',
    "CHANGELOG.md": rf"\A# Changelog\n\n## ({VERSION}) ",
}
"""Files that state the version, and how; all occurrences are copies."""

ADDRESSES = {
    "pyproject.toml": r'^Repository = "(\S+)"$',
    "CITATION.cff": r"^repository-code: (\S+)$",
    "npm/package.json": r'"url": "git\+(\S+)\.git"',
    "mkdocs.yml": r"^repo_url: (\S+)$",
}
"""Files that state the address of the repository."""


def text_of(path: str) -> str:
    """Return the text of a file of the repository."""
    return (ROOT / path).read_text(encoding="utf-8")


def version() -> str:
    """Return the version of the package."""
    [found] = re.findall(COPIES[SOURCE], text_of(SOURCE), re.MULTILINE)
    return str(found)


def repository() -> str:
    """Return the address of the repository."""
    return str(tomllib.loads(text_of("pyproject.toml"))["project"]["urls"]["Repository"])


def differences(copies: dict[str, str], expected: str) -> list[str]:
    """Return a message for each file that does not state the expected text everywhere."""
    messages = []
    for path, pattern in copies.items():
        found = re.findall(pattern, text_of(path), re.MULTILINE)
        if set(found) != {expected}:
            messages.append(f"{path} states {', '.join(found) or 'nothing'}, not {expected}")
    return messages


def faults_of_tag(tag: str) -> list[str]:
    """Return why a release cannot have this tag, as messages."""
    messages = []
    if tag != f"v{version()}":
        messages.append(f"the tag is {tag}, but the version is {version()}")
    heading = text_of("CHANGELOG.md").split("\n")[2]
    if not re.fullmatch(rf"## {re.escape(version())} \(\d{{4}}-\d\d-\d\d\)", heading):
        messages.append(f"CHANGELOG.md begins with {heading!r}; set the date of the release")
    return messages


def notes() -> str:
    """Return the section of the version in CHANGELOG.md, without its heading."""
    [_, section, *_] = re.split(r"^## .*\n", text_of("CHANGELOG.md"), flags=re.MULTILINE)
    return section.strip()


def set_version(new: str) -> None:
    """Write a version to all copies."""
    for path, pattern in COPIES.items():
        changed = re.sub(
            pattern,
            lambda match: match[0].replace(match[1], new),
            text_of(path),
            flags=re.MULTILINE,
        )
        (ROOT / path).write_text(changed, encoding="utf-8")


def main() -> None:
    """Print the version; exit with status 1 if copies differ."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--tag", help="of the release")
    parser.add_argument("--set", metavar="VERSION", help="write this version to all copies")
    parser.add_argument("--notes", action="store_true", help="print the changes of this version")
    options = parser.parse_args()
    if options.notes:
        print(notes())
        return
    if options.set:
        if not re.fullmatch(VERSION, options.set):
            parser.error(f"a version has three numbers, such as 1.0.0; got {options.set}")
        set_version(options.set)
    print(version())
    messages = differences(COPIES, version()) + differences(ADDRESSES, repository())
    messages += faults_of_tag(options.tag) if options.tag else []
    sys.exit("\n".join(messages) or 0)


if __name__ == "__main__":
    main()
