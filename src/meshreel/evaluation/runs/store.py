"""Results on disk: one JSON for each sequence, method and setting, with its stream beside it."""

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.errors import InvalidInputError
from meshreel.evaluation.paper.settings import Setting
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.sequence import MeshSequence

LAYOUT = 1
"""Of the JSON; results of another layout are computed again."""

MARKER = "meshreel-paper.json"
"""In the folders that `meshreel paper` makes; other commands put their name in its place."""

Result = dict[str, Any]


@dataclass(frozen=True)
class Store:
    """The folder that holds the results of one sequence."""

    folder: Path
    sequence: dict[str, Any]

    @classmethod
    def for_sequence(cls, results: Path, sequence: MeshSequence) -> "Store":
        """The store within a folder of results; made if it is missing."""
        identity = sequence_identity(sequence)
        folder = results / f"{file_name(sequence.name)}-{identity['sha256'][:12]}"
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder, identity)

    def path(self, key: str, ending: str) -> Path:
        """Where a file of a result is kept."""
        return self.folder / f"{key}.{ending}"

    def identity(self, setting: Any) -> dict[str, Any]:
        """Everything that a result depends on."""
        return {
            "layout": LAYOUT,
            "version": __version__,
            "sequence": self.sequence,
            "setting": setting,
        }

    def find(self, setting: Setting) -> Result | None:
        """The result of a setting, None where it has to be computed."""
        result = self.find_any(setting.key, asdict(setting))
        if result is None or "refused" in result or self.path(setting.key, "reel").is_file():
            return result
        return None

    def find_any(self, key: str, setting: Any) -> Result | None:
        """The stored result of this key, None if it is missing, damaged or of something else."""
        try:
            result = json.loads(self.path(key, "json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(result, dict) or result.get("identity") != self.identity(setting):
            return None
        return result

    def write(self, key: str, setting: Any, figures: Result) -> Result:
        """Store figures under their identity; gives back what a later `find` will."""
        text = json.dumps({"identity": self.identity(setting), **figures}, indent=1)
        write_text(self.path(key, "json"), text)
        found: Result = json.loads(text)
        return found


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all, over what was there."""
    with replace_when_done(path, overwrite=True) as temporary:
        temporary.write_text(text, encoding="utf-8")


def sequence_identity(sequence: MeshSequence) -> dict[str, Any]:
    """Name, shape and a hash of the content."""
    digest = hashlib.sha256()
    for array in (sequence.vertices, sequence.faces):
        digest.update(f"{array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return {
        "name": sequence.name,
        "n_frames": sequence.n_frames,
        "n_verts": sequence.n_verts,
        "n_faces": sequence.n_faces,
        "fps": sequence.fps,
        "sha256": digest.hexdigest(),
    }


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


def claim_folder(folder: Path, command: str, *, program: str = "meshreel paper") -> None:
    """Make the folder of a report, or take one that an earlier run made.

    Parameters
    ----------
    folder : Path
    command : str
        The command line, for who finds the folder.
    program : str
        The command that the folder belongs to.

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
