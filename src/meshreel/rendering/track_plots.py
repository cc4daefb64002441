"""A track over time at one place."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import require_comparable
from meshreel.model.sequence import FrameSource
from meshreel.model.tracks import named_track
from meshreel.rendering.plots import plot_over_time
from meshreel.rendering.track_colors import TrackColors, TrackLook
from meshreel.runtime.progress import Count, Progress, silent


def plot_track(
    path: Path,
    look: TrackLook,
    place: int,
    shown: FrameSource,
    original: FrameSource | None = None,
    frames: Sequence[int] | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = silent,
) -> None:
    """Write a PNG with the numbers of a track at one place over time.

    Parameters
    ----------
    look : TrackLook
        Its component is plotted; the range is that of the numbers.
    place : int
        Number of the vertex, face or corner, where the values of the track are.
    original : FrameSource, optional
        Of the same mesh and frames; a line beside.
    frames : sequence of int, optional
        Numbers of frames, ascending. Default: all.

    Raises
    ------
    InvalidInputError
        If there is no such track, component or place, the track has colours and no component is
        named, the original is another mesh, matplotlib is missing or the path cannot be written.
    """
    colors = TrackColors(look, named_track(shown.tracks, look.name))
    if colors.shows_colors:
        raise InvalidInputError(
            f"track {look.name!r} has colours; name one of their numbers to plot: --component 0"
        )
    n_items = shown.tracks[look.name].shape[1]
    if not 0 <= place < n_items:
        raise InvalidInputError(
            f"track {look.name!r} has values of {colors.domain} 0 to {n_items - 1}; got {place}"
        )
    if original is not None:
        require_comparable(original, shown)
    sources = {"decoded": shown} if original is None else {"original": original, "decoded": shown}
    tracks = {name: named_track(source.tracks, look.name) for name, source in sources.items()}
    numbers = range(shown.n_frames) if frames is None else frames
    lines = {name: np.empty(len(numbers)) for name in tracks}
    for at, number in enumerate(numbers):
        for name, track in tracks.items():
            values = track.read(number, number + 1)[0, place : place + 1]
            lines[name][at] = colors.numbers(values)[0]
        progress("reading", Count(at + 1, len(numbers), "frames"))
    unit = f", {colors.unit}" if colors.unit else ""
    title = f"{colors.title} at {colors.domain} {place}"
    plot_over_time(
        path, f"{title} of {shown.name}" if shown.name else title, f"{colors.title}{unit}",
        numbers, lines, fps=shown.fps, start_s=shown.start_s, overwrite=overwrite,
    )  # fmt: skip
