"""Export of the player as a single page or as separate files, with an image or video."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.app.viewer.page import SCRIPT_NAME, Page, base64_of, built_page
from meshreel.app.viewer.playable import MODES_EFFORT
from meshreel.app.viewer.player_data import PlayerData
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track, error_unit, track_like
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.outputs.checks import check_output_paths
from meshreel.runtime.progress import Progress, silent

SHARE_OF_RANGE = 1 / 20
"""Error bound of the original in a page, as a fraction of the range of the error map."""

DISTANCE = "distance"
"""The heat map of vertex errors, in percent of the diagonal."""

MIN_PERCENT = 1e-5
"""Minimum error bound of the original, in percent of the diagonal."""

MAX_ORIGINAL_BYTES = 1 << 30
"""Limit of positions and tracks of the original, which is encoded in memory."""


@dataclass(frozen=True)
class OriginalStream:
    """The original, encoded for the page."""

    data: bytes
    tracks_bytes: int
    """Size of the tracks in `data`."""
    names: list[str]
    """Tracks of the original that the page can show. Those missing in `data` are equal in the file.
    """
    omitted_names: list[str]
    """Tracks that exceeded the memory limit."""


@dataclass(frozen=True)
class Part:
    """Data of a page: its role, such as "animation", its file name, and the bytes."""

    role: str
    file_name: str
    data: bytes
    media_type: str = ""


def export_page(
    shown: PlayerData,
    path: Path,
    *,
    page: Page | None = None,
    split: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
    notes: Notes | None = None,
) -> dict[str, int]:
    """Write the player of a file as one HTML file, or with separate files.

    Parameters
    ----------
    shown : PlayerData
        If it has an original, its frames and tracks are re-encoded and included; so is its texture.
    path : Path
        The page. All files appear together, when all are written.
    page : Page, optional
        Default: the player of the package.
    split : bool, default False
        Whether script, stream, original and texture are separate files. Existing files with
        identical contents are not rewritten.
    notes : Notes, optional
        Receives notes, such as omitted tracks.

    Returns
    -------
    dict of str to int
        Bytes of the "player", of the "animation", and of "original", "tracks of the original" and
        "texture" if present, as stored.

    Raises
    ------
    InvalidInputError
        If the page is not built or has no place for data, a file exists, or the original is too
        large for a page.
    """
    player = built_page() if page is None else page
    original = original_stream(shown, progress) if shown.measuring is not None else None
    parts = _parts(shown, path.stem, original)
    facts = shown.facts()  # includes the errors that `original_stream` measures
    if original is not None:
        facts["original"]["tracks"] = original.names
        facts["original"]["track_heats"] = [
            heat for heat in facts["original"]["track_heats"] if heat["track"] in original.names
        ]
        if notes is not None and original.omitted_names:
            names = ", ".join(original.omitted_names)
            notes.left_out(f"tracks of the original, too large for a page: {names}")
    if not split:
        texts = {part.role: base64_of(part.data) for part in parts}
        data = {_key(part): _reference(part, base64=texts[part.role]) for part in parts}
        facts["texture"] = data.pop("texture", None)
        files = {path: player.whole({"facts": facts, **data}).encode()}
        sizes = {role: len(text) for role, text in texts.items()}
    else:
        data = {_key(part): _reference(part, url=part.file_name) for part in parts}
        facts["texture"] = data.pop("texture", None)
        html = player.split({"facts": facts, **data})
        files = {path: html.encode()}
        files[path.parent / SCRIPT_NAME] = player.script.encode()
        files |= {path.parent / part.file_name: part.data for part in parts}
        sizes = {part.role: len(part.data) for part in parts}
    total = sum(map(len, files.values()))
    # Files other than the page are kept if they exist with the same contents.
    stale = {
        file: contents
        for file, contents in files.items()
        if file == path or not _has_contents(file, contents)
    }
    check_output_paths(list(stale), overwrite=overwrite)
    with replace_all_when_done(list(stale), overwrite=overwrite) as temporaries:
        for temporary, contents in zip(temporaries, stale.values(), strict=True):
            temporary.write_bytes(contents)
    player_bytes = total - sum(sizes.values())
    if original is not None and original.tracks_bytes:
        tracks_bytes = round(sizes["original"] * original.tracks_bytes / len(original.data))
        sizes["original"] -= tracks_bytes
        sizes["tracks of the original"] = tracks_bytes
    return {"player": player_bytes, **sizes}


def _parts(shown: PlayerData, stem: str, original: OriginalStream | None) -> list[Part]:
    texture = shown.texture
    if texture is not None and texture.path in shown.file.files:  # an .mp4 that contains both
        parts, texture = [Part("animation", f"{stem}.mp4", texture.path.read_bytes())], None
    else:
        parts = [Part("animation", f"{stem}.reel", shown.file.stored(0, shown.file.size_bytes))]
    if original is not None:
        parts.append(Part("original", f"{stem}-original.reel", original.data))
    if texture is not None:
        data = texture.path.read_bytes()
        parts.append(Part("texture", texture.path.name, data, texture.media_type))
    return parts


def _key(part: Part) -> str:
    """The key of a part in the data of the page."""
    return "stream" if part.role == "animation" else part.role


def _reference(part: Part, **location: str) -> dict[str, Any]:
    return {**location, **({"mediaType": part.media_type} if part.media_type else {})}


def _has_contents(path: Path, data: bytes) -> bool:
    return path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data


def original_stream(shown: PlayerData, progress: Progress = silent) -> OriginalStream:
    """Measure the errors of the file, and encode its original for a page.

    Raises
    ------
    InvalidInputError
        If it is too large for a page.
    """
    assert shown.comparison is not None  # callers check for an original
    assert shown.tracks is not None
    assert shown.measuring is not None
    original, reel = shown.comparison.original, shown.reel
    size_bytes = 24 * reel.n_frames * reel.n_verts
    if size_bytes > MAX_ORIGINAL_BYTES:
        raise InvalidInputError(
            f"the original has {size_bytes / 1e9:.1f} GB of positions, too many for a page; omit ",
            Keyword("original"),
            ", or use meshreel view",
        )
    free_bytes = MAX_ORIGINAL_BYTES - size_bytes
    shown.measuring.run(progress)
    ranges = {heat["kind"]: heat["range"] for heat in shown.measuring.figures.heat_maps()}
    # Error bounds of the original tracks that differ from those of the file.
    targets = {}
    for heat in shown.tracks.heat_maps():
        bound = SHARE_OF_RANGE * heat["range"]
        unit = error_unit(shown.tracks.kind(heat["track"]), "")
        targets[heat["track"]] = f"{bound!r}{unit}" if bound else "exact"
    exact = [name for name in shown.tracks.names if name not in targets]
    targets |= {name: "exact" for name in exact if shown.tracks.differs(name)}
    tracks: dict[str, Track] = {}
    for name in targets:
        track = original.tracks[name]
        size_bytes = reel.n_frames * int(np.prod(track.shape[1:])) * track.dtype.itemsize
        if size_bytes <= free_bytes:
            free_bytes -= size_bytes
            tracks[name] = track_like(track, shown.tracks.all_original_values(name))
    frames = [original.frame(number) for number in range(reel.n_frames)]
    sequence = MeshSequence(
        np.array(frames, np.float64), reel.faces,
        surface=Surface(
            face_sizes=reel.surface.face_sizes, hard_edges=reel.surface.hard_edges
        ), tracks=tracks,
    ).replace(timing=reel.timing)  # fmt: skip
    data = encode(
        sequence,
        max_error=max(MIN_PERCENT, SHARE_OF_RANGE * float(ranges[DISTANCE])),
        effort=MODES_EFFORT,
        tracks={name: targets[name] for name in tracks},
        progress=progress,
    )
    omitted_names = [name for name in targets if name not in tracks]
    names = [name for name in shown.tracks.names if name not in omitted_names]
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as encoded:
        tracks_bytes = sum(info.size_bytes for info in encoded.info().tracks)
    return OriginalStream(data, tracks_bytes, names, omitted_names)
