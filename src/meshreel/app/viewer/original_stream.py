"""The original as a stream that goes along in a page, much nearer to it than the file is."""

from dataclasses import dataclass
from io import BytesIO

import numpy as np

from meshreel.app.viewer.api import Api
from meshreel.app.viewer.measuring import Measuring
from meshreel.app.viewer.played import MODES_EFFORT
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track, TrackKind
from meshreel.runtime.progress import Progress, silent

SHARE_OF_RANGE = 1 / 20
"""How far the original in a page may be off, as a share of the range of the map of its errors."""

DISTANCE = "distance"
"""The heat map of distances of vertices, in percent of the diagonal."""

LEAST_PERCENT = 1e-5
"""Of the diagonal: the original is never nearer than this."""

MOST_ORIGINAL_BYTES = 1 << 30
"""Of positions and tracks of the original, which are encoded in memory."""


@dataclass(frozen=True)
class OriginalStream:
    """The original, encoded anew.

    Attributes
    ----------
    tracks_bytes : int
        Of `data`, those of its tracks.
    names : list of str
        Tracks of the original that the page can show. Those that `data` has not are the same in
        the file.
    left_out : list of str
        Tracks for which there was no room in memory.
    """

    data: bytes
    tracks_bytes: int
    names: list[str]
    left_out: list[str]


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
