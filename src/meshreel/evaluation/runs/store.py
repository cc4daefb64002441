"""Results on disk: a JSON file for each sequence, method and setting, and its stream."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.evaluation.folder import file_name, write_text
from meshreel.model.segments import AnySequence, segments_of
from meshreel.runtime.outputs.atomic import replace_when_done

LAYOUT = 1
"""Version of the JSON layout; results of other layouts are recomputed."""

Result = dict[str, Any]


@dataclass(frozen=True)
class Store:
    """The folder of the results of one sequence."""

    folder: Path
    sequence: dict[str, Any]

    @classmethod
    def for_sequence(cls, results: Path, sequence: AnySequence) -> "Store":
        """Open or create the store of a sequence within a folder of results."""
        identity = sequence_identity(sequence)
        folder = results / f"{file_name(sequence.name)}-{identity['sha256'][:12]}"
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder, identity)

    def path(self, key: str, extension: str) -> Path:
        """Path of a file of a result."""
        return self.folder / f"{key}.{extension}"

    def identity(self, setting: Any) -> dict[str, Any]:
        """Everything that determines a result."""
        return {
            "layout": LAYOUT,
            "version": __version__,
            "sequence": self.sequence,
            "setting": setting,
        }

    def find(self, key: str, setting: Any, needs: Sequence[str] = ()) -> Result | None:
        """Return the stored result of this key, or None if it must be computed.

        A result is invalid if it is damaged, has another identity or lacks a needed file; refusals
        have no files.
        """
        try:
            result = json.loads(self.path(key, "json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(result, dict) or result.get("identity") != self.identity(setting):
            return None
        is_complete = all(self.path(key, extension).is_file() for extension in needs)
        return result if is_complete or "refused" in result else None

    def write(
        self, key: str, setting: Any, figures: Result, files: Mapping[str, bytes] | None = None
    ) -> Result:
        """Store files, then figures with their identity; return the stored result."""
        for extension, data in (files or {}).items():
            with replace_when_done(self.path(key, extension), overwrite=True) as temporary:
                temporary.write_bytes(data)
        text = json.dumps({"identity": self.identity(setting), **figures}, indent=1)
        write_text(self.path(key, "json"), text)
        result: Result = json.loads(text)
        return result


def done(results: Iterable[Result]) -> list[Result]:
    """The results that are not refusals."""
    return [result for result in results if "refused" not in result]


def sequence_identity(sequence: AnySequence) -> dict[str, Any]:
    """Name, shape and a hash of the content; of several segments the largest counts."""
    digest = hashlib.sha256()
    segments = segments_of(sequence)
    for segment in segments:
        for array in (segment.read(0, segment.n_frames), segment.faces):
            digest.update(f"{array.dtype.str} {array.shape}".encode())
            digest.update(array.tobytes())
    several = {"n_segments": len(segments)} if len(segments) > 1 else {}
    return {
        "name": sequence.name,
        "n_frames": sequence.n_frames,
        **several,
        "n_verts": max(segment.n_verts for segment in segments),
        "n_faces": max(len(segment.faces) for segment in segments),
        "fps": sequence.fps,
        "sha256": digest.hexdigest(),
    }


def finite(value: Any) -> Any:
    """Replace NaN and infinity, which JSON lacks, by None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
