"""Results on disk: one JSON for each sequence, method and setting, with its stream beside it."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.evaluation.folder import file_name, write_text
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.outputs.atomic import replace_when_done

LAYOUT = 1
"""Of the JSON; results of another layout are computed again."""

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

    def path(self, key: str, extension: str) -> Path:
        """Where a file of a result is kept."""
        return self.folder / f"{key}.{extension}"

    def identity(self, setting: Any) -> dict[str, Any]:
        """Everything that a result depends on."""
        return {
            "layout": LAYOUT,
            "version": __version__,
            "sequence": self.sequence,
            "setting": setting,
        }

    def find(self, key: str, setting: Any, needs: Sequence[str] = ()) -> Result | None:
        """The stored result of this key, None where it has to be computed.

        That is where it is missing, damaged or of something else, or where a file is missing
        beside it that is needed; a refusal has no files.
        """
        try:
            result = json.loads(self.path(key, "json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(result, dict) or result.get("identity") != self.identity(setting):
            return None
        whole = all(self.path(key, extension).is_file() for extension in needs)
        return result if whole or "refused" in result else None

    def write(
        self, key: str, setting: Any, figures: Result, files: Mapping[str, bytes] | None = None
    ) -> Result:
        """Store figures under their identity, files by extension before them; the stored result."""
        for extension, data in (files or {}).items():
            with replace_when_done(self.path(key, extension), overwrite=True) as temporary:
                temporary.write_bytes(data)
        text = json.dumps({"identity": self.identity(setting), **figures}, indent=1)
        write_text(self.path(key, "json"), text)
        found: Result = json.loads(text)
        return found


def done(results: Iterable[Result]) -> list[Result]:
    """The results that are not refusals."""
    return [result for result in results if "refused" not in result]


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


def finite(value: Any) -> Any:
    """The value with None in place of numbers that JSON has no word for."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
