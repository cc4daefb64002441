"""Manifests of Universal Volumetric (UVOL), which name the frame files of a capture.

Two layouts are in use: ``DRCURLPattern`` with ``#####`` for the number of a frame, and count and
rate at the top level; and version ``v2`` with ``geometry.targets`` and ``geometry.path``.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.file_errors import errors_naming, read_bytes
from meshreel.formats.file_references import download_sibling, is_within
from meshreel.formats.notes import listed
from meshreel.formats.scenes.timing import MAX_FRAMES
from meshreel.runtime.stores.address import is_remote

FILE_EXTENSIONS = {"draco": ".drc", "obj": ".obj"}
"""Extension of the frame files of each geometry format."""

NUMBER = re.compile(r"\[(#+)\]|(#+)")
"""Place of the number of a frame in a path, with as many digits as there are signs."""


@dataclass(frozen=True)
class Manifest:
    """The frame files of a capture."""

    paths: tuple[Path, ...]
    """In frame order, at least one."""
    fps: float
    """0 = unknown."""
    left_out: tuple[str, ...]
    """What else the manifest names: "textures", "sound"."""


def read_manifest(path: Path) -> Manifest:
    """Read the paths of the frames, and check that they exist; textures and sound are not read.

    Raises
    ------
    FormatError
        If the file is not a manifest of separate frame files, has several versions of the geometry,
        or names files that are missing or outside of its folder.
    """
    data = read_bytes(path)
    with errors_naming(path):
        try:
            document = json.loads(data.decode("utf-8-sig"))
        except ValueError as error:
            raise FormatError(f"is not JSON ({error}), so it is no UVOL manifest") from None
        if not isinstance(document, dict):
            raise FormatError("is no UVOL manifest: it is not a JSON object")
        pattern, count, fps = _geometry(document)
        others = {"textures": ("KTX2URLPattern", "texture"), "sound": ("AudioURL", "audio")}
        left_out = [what for what, names in others.items() if any(map(document.get, names))]
        return Manifest(_frame_paths(path, pattern, count), fps, tuple(left_out))


def _geometry(document: dict[str, Any]) -> tuple[str, int, float]:
    """Return the pattern of the frame files, their number, and the frame rate."""
    if "DRCURLPattern" in document:
        count = document.get("GeometryFrameCount", document.get("TotalFrames"))
        rate = document.get("GeometryFrameRate", document.get("FrameRate"))
        return _text(document, "DRCURLPattern"), _count(count), _rate(rate)
    if isinstance(document.get("geometry"), dict):
        return _v2_geometry(document["geometry"])
    if "frameData" in document:
        raise FormatError(
            "is a manifest of UVOL 1, whose meshes are in one binary file compressed by Corto; "
            "only manifests of separate Draco or OBJ files can be read"
        )
    raise FormatError("is no UVOL manifest: it has neither DRCURLPattern nor geometry")


def _v2_geometry(geometry: dict[str, Any]) -> tuple[str, int, float]:
    targets = geometry.get("targets")
    if not isinstance(targets, dict) or not targets:
        raise FormatError("its geometry has no targets")
    pattern = _text(geometry, "path")
    if len(targets) > 1:
        folders = [pattern.replace("[target]", name) for name in targets]
        patterns = [NUMBER.sub("*", folder).replace("[ext]", "") for folder in folders]
        raise FormatError(
            f"its geometry has several targets, {listed(targets)}; name the files of one instead, "
            f"as a pattern: {listed(patterns)}"
        )
    [(name, target)] = targets.items()
    if not isinstance(target, dict) or target.get("format") not in FILE_EXTENSIONS:
        raise FormatError(f"the format of its geometry must be one of {listed(FILE_EXTENSIONS)}")
    whole = pattern.replace("[target]", name).replace("[ext]", FILE_EXTENSIONS[target["format"]])
    return whole, _count(target.get("frameCount")), _rate(target.get("frameRate"))


def _frame_paths(path: Path, pattern: str, count: int) -> tuple[Path, ...]:
    """Return the paths of all frames, whose numbers begin with 0 or 1."""
    if is_remote(pattern):
        raise FormatError(f"names frames by the address {pattern[:80]!r}; download them first")
    numbers = list(NUMBER.finditer(pattern))
    if len(numbers) != 1:
        raise FormatError(f"the path of its frames, {pattern[:80]!r}, needs one number: #####")
    folder, place = path.resolve().parent, numbers[0]
    width = len(place[1] or place[2])

    def file(number: int) -> Path:
        name = f"{pattern[: place.start()]}{number:0{width}}{pattern[place.end() :]}"
        found = (folder / name).resolve()
        if not is_within(found, folder):
            raise FormatError(
                f"names frames outside of its folder, {name[:200]!r}; move the manifest above them"
            )
        return found

    first = next((one for one in (0, 1) if _exists(file(one))), None)
    if first is None:
        raise FormatError(f"its first frame, {file(0).name} or {file(1).name}, does not exist")
    paths = tuple(map(file, range(first, first + count)))
    if missing := [one.name for one in paths if not _exists(one)]:
        raise FormatError(f"{len(missing)} of its {count} frames do not exist: {listed(missing)}")
    return paths


def _exists(path: Path) -> bool:
    return path.is_file() or download_sibling(path)


def _text(json_object: dict[str, Any], name: str) -> str:
    text = json_object.get(name)
    if not isinstance(text, str):
        raise FormatError(f"{name} must be text")
    return text


def _count(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= MAX_FRAMES:
        raise FormatError(f"the number of its frames must be 1 to {MAX_FRAMES}; it is {value!r}")
    return value


def _rate(value: Any) -> float:
    """Return the frame rate; 0 if the manifest has none."""
    if value is None:
        return 0.0
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 <= value < 1e6:
        raise FormatError(f"its frame rate must be a number from 0 to a million; it is {value!r}")
    return float(value)
