"""The output folder of a report: ownership, file names, atomic writes."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from meshreel import __version__
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.outputs.atomic import replace_when_done


def claim_folder(folder: Path, program: str, command: str) -> None:
    """Create the folder of a report, or reuse one of an earlier run.

    Parameters
    ----------
    program : str
        The command that owns the folder, such as "meshreel paper".
    command : str
        The command line, recorded in the folder.

    Raises
    ------
    InvalidInputError
        If the folder contains files but no marker of this program.
    """
    if folder.exists() and not folder.is_dir():
        raise InvalidInputError(f"{folder} is a file; name a folder")
    marker = folder / f"{program.replace(' ', '-')}.json"
    if folder.is_dir() and any(folder.iterdir()) and not _is_marker(marker, program):
        raise InvalidInputError(
            f"the folder {folder} contains files but no {marker.name} of an earlier run; "
            "name an empty or new folder"
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
    """Replace everything but letters, digits and dots by dashes, for use in file names."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or "sequence"


def unique_names(sequences: Sequence[MeshSequence]) -> list[str]:
    """Distinct file names of sequences."""
    names: list[str] = []
    for sequence in sequences:
        name, number = file_name(sequence.name), 1
        while name in names:
            number += 1
            name = f"{file_name(sequence.name)}-{number}"
        names.append(name)
    return names


def write_text(path: Path, text: str) -> None:
    """Write or replace a text file atomically."""
    with replace_when_done(path, overwrite=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
