"""Plot a track over time at one item."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import require_comparable
from meshreel.model.sequence import FrameSource
from meshreel.model.tracks import track_by_name
from meshreel.rendering.plots import plot_over_time
from meshreel.rendering.track_colors import TrackColors, TrackLook
from meshreel.runtime.progress import Count, Progress, silent


def plot_track(
    path: Path,
    look: TrackLook,
    item: int,
    sequence: FrameSource,
    original: FrameSource | None = None,
    frames: Sequence[int] | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = silent,
) -> None:
    """Write a PNG plot of a track at one item over time.

    Parameters
    ----------
    look : TrackLook
        Its component is plotted; its range is ignored.
    item : int
        Number of the vertex, face or corner, depending on the domain of the track.
    original : FrameSource, optional
        Adds a second curve; must have the same mesh and frames.
    frames : sequence of int, optional
        Frame numbers, ascending. Default: all.

    Raises
    ------
    InvalidInputError
        If the track, component or item does not exist, a color track has no component selected,
        the original has another mesh, matplotlib is missing or the path cannot be written.
    """
    colors = TrackColors(look, track_by_name(sequence.tracks, look.name))
    if colors.shows_colors:
        raise InvalidInputError(
            f"track {look.name!r} contains colors; select a channel to plot, as in --component 0"
        )
    n_items = sequence.tracks[look.name].shape[1]
    if not 0 <= item < n_items:
        raise InvalidInputError(
            f"track {look.name!r} has values of {colors.domain} 0 to {n_items - 1}; got {item}"
        )
    sources = {"decoded": sequence}
    if original is not None:
        require_comparable(original, sequence)
        sources = {"original": original, "decoded": sequence}
    tracks = {name: track_by_name(source.tracks, look.name) for name, source in sources.items()}
    numbers = range(sequence.n_frames) if frames is None else frames
    lines = {name: np.empty(len(numbers)) for name in tracks}
    for step, number in enumerate(numbers):
        for name, track in tracks.items():
            values = track.read(number, number + 1)[0, item : item + 1]
            lines[name][step] = colors.numbers(values)[0]
        progress("reading", Count(step + 1, len(numbers), "frames"))
    unit = f", {colors.unit}" if colors.unit else ""
    title = f"{colors.title} at {colors.domain} {item}"
    plot_over_time(
        path, f"{title} of {sequence.name}" if sequence.name else title, f"{colors.title}{unit}",
        numbers, lines, fps=sequence.fps, start_s=sequence.start_s, overwrite=overwrite,
    )  # fmt: skip
