"""The track whose colors the player shows initially."""

from dataclasses import asdict, dataclass

from meshreel.model.tracks import TrackSource
from meshreel.rendering.track_colors import TrackColors, TrackLook


@dataclass(frozen=True)
class Coloring:
    """Color settings of a track; None selects the default.

    Parameters
    ----------
    track : str
        Its name.
    component, range, colormap : str, optional
        As of `TrackLook`.
    """

    track: str
    component: str | None = None
    range: str | None = None
    colormap: str | None = None

    def described(self) -> dict[str, str | None]:
        """The settings for the page."""
        return asdict(self)

    def check(self, track: TrackSource) -> None:
        """Nothing if the track can be shown so.

        Raises
        ------
        InvalidInputError
            If it has no such component, the range is none, or there is no such map; if it has
            colours, which are shown as they are, and a range or a map is given.
        """
        TrackColors(TrackLook(self.track, self.component, self.range, self.colormap), track)
