"""The folder of a report: claimed for one command, its files named and written whole."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from meshreel import __version__
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.outputs.atomic import replace_when_done


def claim_folder(folder: Path, program: str, command: str) -> None:
    """Make the folder of a report, or take one that an earlier run made.

    Parameters
    ----------
    program : str
        The command that the folder belongs to, such as "meshreel paper".
    command : str
        The command line, for who finds the folder.

    Raises
    ------
    InvalidInputError
        If it holds files and none of them says that this program made it.
    """
    if folder.exists() and not folder.is_dir():
        raise InvalidInputError(f"{folder} is a file; name a folder")
    marker = folder / f"{program.replace(' ', '-')}.json"
    if folder.is_dir() and any(folder.iterdir()) and not _is_marker(marker, program):
        raise InvalidInputError(
            f"the folder {folder} holds files and no {marker.name} of an earlier run; "
            "name an empty or a new folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    facts = {"made_by": program, "version": __version__, "command": command}
    write_text(marker, json.dumps(facts, indent=1))


def _is_marker(path: Path, program: str) -> bool:
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(facts, dict) and facts.get("made_by") == program


def file_name(name: str) -> str:
    """A name as a part of file names: letters, digits, dots and dashes."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or "sequence"


def unique_names(sequences: Sequence[MeshSequence]) -> list[str]:
    """Names for files, each once."""
    names: list[str] = []
    for sequence in sequences:
        name, number = file_name(sequence.name), 1
        while name in names:
            number += 1
            name = f"{file_name(sequence.name)}-{number}"
        names.append(name)
    return names


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all, over what was there."""
    with replace_when_done(path, overwrite=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
