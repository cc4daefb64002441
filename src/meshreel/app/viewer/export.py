"""Export of the player as a single page, or as a page with separate files."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.app.viewer.api import Api
from meshreel.app.viewer.measuring import Measuring
from meshreel.app.viewer.page import SCRIPT_NAME, Page, base64_of, built_page
from meshreel.app.viewer.played import MODES_EFFORT
from meshreel.app.viewer.textures import Texture
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track, TrackKind
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.outputs.checks import check_output_paths
from meshreel.runtime.progress import Progress, silent

SHARE_OF_RANGE = 1 / 20
"""Error bound of the original in a page, as a fraction of the range of the error map."""

DISTANCE = "distance"
"""The heat map of distances of vertices, in percent of the diagonal."""

LEAST_PERCENT = 1e-5
"""Minimum error bound of the original, in percent of the diagonal."""

MOST_ORIGINAL_BYTES = 1 << 30
"""Limit of positions and tracks of the original, which are encoded in memory."""


@dataclass(frozen=True)
class OriginalStream:
    """The original, encoded for the page.

    Attributes
    ----------
    tracks_bytes : int
        Size of the tracks in `data`.
    names : list of str
        Tracks of the original that the page can show. Those that `data` has not are the same in
        the file.
    left_out : list of str
        Tracks that exceeded the memory limit.
    """

    data: bytes
    tracks_bytes: int
    names: list[str]
    left_out: list[str]


@dataclass(frozen=True)
class Part:
    """Something that a page plays: what it is of, a name for a file, and the bytes."""

    what: str
    file_name: str
    data: bytes
    media_type: str = ""


def export_page(
    api: Api,
    path: Path,
    *,
    page: Page | None = None,
    texture: Texture | None = None,
    split: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> dict[str, int]:
    """Write the player of a file as one HTML file, or with separate files.

    Parameters
    ----------
    api : Api
        If it has an original, its frames and tracks are re-encoded and included.
    path : Path
        The page. Files appear only when all are written.
    page : Page, optional
        The player; default that of the package.
    texture : Texture, optional
        Texture of the mesh.
    split : bool, default False
        Whether script, stream, original and texture are separate files. Files with identical
        contents are kept.
    overwrite : bool, default False
    progress : callable, optional
    notes : list of str, optional
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
    original = original_stream(api, progress) if api.measuring is not None else None
    parts = _parts(api, path.stem, original, texture)
    facts = api.facts()  # with errors, which are measured by now
    if original is not None:
        _keep_carried(facts["original"], original.names)
        if notes is not None and original.left_out:
            names = ", ".join(original.left_out)
            notes.append(f"tracks of the original too large for a page, and left out: {names}")
    if not split:
        carried = {part.what: _carried(part, base64=base64_of(part.data)) for part in parts}
        files = {path: player.whole({"facts": facts, **_renamed(carried)}).encode()}
        sizes = {part.what: len(base64_of(part.data)) for part in parts}
    else:
        carried = {part.what: _carried(part, url=part.file_name) for part in parts}
        html = player.split({"facts": facts, **_renamed(carried)})
        files = {path: html.encode(), path.parent / SCRIPT_NAME: player.script.encode()}
        files |= {path.parent / part.file_name: part.data for part in parts}
        sizes = {part.what: len(part.data) for part in parts}
    total = sum(map(len, files.values()))
    _write(files, path, overwrite=overwrite)
    rest = total - sum(sizes.values())
    if original is not None and original.tracks_bytes:
        of_tracks = round(sizes["original"] * original.tracks_bytes / len(original.data))
        sizes["original"] -= of_tracks
        sizes["tracks of the original"] = of_tracks
    return {"player": rest, **sizes}


def _keep_carried(told: dict[str, Any], names: list[str]) -> None:
    """Has the page offer tracks of the original that it carries only."""
    told["tracks"] = names
    told["track_heats"] = [heat for heat in told["track_heats"] if heat["track"] in names]


def _parts(
    api: Api, stem: str, original: OriginalStream | None, texture: Texture | None
) -> list[Part]:
    stream = api.reel.stored(0, api.reel.size_bytes)
    parts = [Part("animation", f"{stem}.reel", stream)]
    if original is not None:
        parts.append(Part("original", f"{stem}-original.reel", original.data))
    if texture is not None:
        data = texture.path.read_bytes()
        parts.append(Part("texture", texture.path.name, data, texture.media_type))
    return parts


def _carried(part: Part, **where: str) -> dict[str, Any]:
    return {**where, **({"mediaType": part.media_type} if part.media_type else {})}


def _renamed(carried: dict[str, Any]) -> dict[str, Any]:
    """By the names that the page has for them."""
    return {"stream" if what == "animation" else what: part for what, part in carried.items()}


def _write(files: dict[Path, bytes], page: Path, *, overwrite: bool) -> None:
    """Write files that do not hold these bytes already; the page itself is always written."""
    new = {path: data for path, data in files.items() if path == page or not _holds(path, data)}
    check_output_paths(list(new), overwrite=overwrite)
    with replace_all_when_done(list(new), overwrite=overwrite) as temporaries:
        for temporary, data in zip(temporaries, new.values(), strict=True):
            temporary.write_bytes(data)


def _holds(path: Path, data: bytes) -> bool:
    return path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data


def original_stream(api: Api, progress: Progress = silent) -> OriginalStream:
    """The original of a player that has one, whose errors are measured first.

    Raises
    ------
    InvalidInputError
        If it is too large for a page.
    """
    assert api.comparison is not None  # is asked for with an original only
    assert api.tracks is not None
    assert api.measuring is not None
    original, reel = api.comparison.original, api.reel
    room = _room_for_tracks(reel)
    api.measuring.run(progress)
    targets = _track_targets(api.tracks)
    tracks: dict[str, Track] = {}
    for name in targets:
        given = original.tracks[name]
        size = reel.n_frames * int(np.prod(given.shape[1:])) * given.dtype.itemsize
        if size <= room:
            room -= size
            values = api.tracks.all_given(name)
            tracks[name] = Track(values, given.domain, given.kind, given.unit)
    frames = [original.frame(number) for number in range(reel.n_frames)]
    sequence = MeshSequence(
        np.array(frames, np.float64), reel.faces, fps=reel.fps,
        surface=Surface(
            face_sizes=reel.surface.face_sizes, hard_edges=reel.surface.hard_edges
        ), tracks=tracks,
    )  # fmt: skip
    data = encode(
        sequence,
        max_error=max(LEAST_PERCENT, SHARE_OF_RANGE * _range_percent(api.measuring)),
        effort=MODES_EFFORT,
        tracks={name: targets[name] for name in tracks},
        progress=progress,
    )
    left_out = [name for name in targets if name not in tracks]
    names = [name for name in api.tracks.names if name not in left_out]
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as made:
        tracks_bytes = sum(track.size_bytes for track in made.info().tracks)
    return OriginalStream(data, tracks_bytes, names, left_out)


def _range_percent(measuring: Measuring) -> float:
    (found,) = (
        float(heat["range"])
        for heat in measuring.figures.described_heats()
        if heat["kind"] == DISTANCE
    )
    return found


def _track_targets(tracks: TrackComparison) -> dict[str, str]:
    """How exact tracks are to be, by their names; those that are the same in the file are none."""
    targets = {}
    for heat in tracks.described():
        near = SHARE_OF_RANGE * heat["range"]
        is_normal = tracks.kind(heat["track"]) is TrackKind.NORMAL
        targets[heat["track"]] = f"{near!r}{'deg' if is_normal else ''}" if near else "exact"
    exact = (name for name in tracks.names if name not in targets)
    return targets | {name: "exact" for name in exact if tracks.differs(name)}


def _room_for_tracks(reel: ReelFile) -> int:
    """Bytes that are left beside positions."""
    size = 24 * reel.n_frames * reel.n_verts
    if size > MOST_ORIGINAL_BYTES:
        raise InvalidInputError(
            f"the original has {size / 1e9:.1f} GB of positions, too many for a page; "
            "leave --original out, or use meshreel view"
        )
    return MOST_ORIGINAL_BYTES - size
