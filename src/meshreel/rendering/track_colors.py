"""A track as the colours of a mesh: which of its numbers, in which range, and what they mean."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Values
from meshreel.errors import InvalidInputError
from meshreel.metrics.track_errors import error_unit, value_errors
from meshreel.model.tracks import TrackKind, TrackSource
from meshreel.rendering.colormap import Image, check_colormap, colorize, short_number
from meshreel.runtime.counting import counted

AXES = ("x", "y", "z")
MAGNITUDE = "magnitude"
MOST_OF_MAGNITUDE = 3
"""Values of more numbers have no magnitude."""

DEFAULT_RANGE, RANGE_OF_NORMALS = "2%:98%", "-1:1"

_END = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]{1,3})?)\s*(%?)\s*", re.I)
_N_QUANTILES = 1000
"""So many values of each frame stand for all of its values."""


@dataclass(frozen=True)
class TrackLook:
    """How a track is to be shown.

    Parameters
    ----------
    name : str
        Of the track.
    component : str, optional
        "x", "y", "z", a number of a column, from 0 on, or "magnitude" of up to three. Default:
        the only one; "x" of normals; colours as they are; else the magnitude.
    range : str, optional
        Where the colours end, "LOW:HIGH", each a number or a percentile such as "2%". Default:
        `DEFAULT_RANGE`, of normals `RANGE_OF_NORMALS`.
    colormap : str, optional
        One of `meshreel.rendering.colormap.COLORMAPS`. Default: "diverging" if 0 is inside the
        range, else "sequential".
    """

    name: str
    component: str | None = None
    range: str | None = None
    colormap: str | None = None


@dataclass(frozen=True)
class TrackScale:
    """Numbers at the ends of the colours, and of all values shown.

    Attributes
    ----------
    low, high : float
        Ends of the colours. Where 0 is between them, and they are percentiles, it is in the middle.
    least, most : float
        Of all values; NaN where there is none.
    has_missing : bool
        Whether some values are no numbers.
    """

    low: float
    high: float
    least: float
    most: float
    has_missing: bool


class TrackColors:
    """Colours of the values of a track.

    Raises
    ------
    InvalidInputError
        If it has no such component, the range is none, or there is no such map; if it has colours,
        which are shown as they are, and a range or a map is given.
    """

    def __init__(self, look: TrackLook, track: TrackSource) -> None:
        self.name, self.kind, self.unit = look.name, track.kind, track.unit
        self.domain, self.error_unit = track.domain, error_unit(track)
        self._columns, self.component = _shown(look, track)
        self.shows_colors = self.component == "color"
        self.colormap = look.colormap
        if look.colormap is not None:
            check_colormap(look.colormap)
        given = {"--range": look.range, "--colormap": look.colormap}
        without = next((option for option, value in given.items() if value is not None), None)
        if self.shows_colors and without:
            raise InvalidInputError(
                f"track {look.name!r} has colours, which are shown as they are; leave {without} "
                "out, or show one of their numbers with --component"
            )
        usual = RANGE_OF_NORMALS if track.kind is TrackKind.NORMAL else DEFAULT_RANGE
        self._range_text = look.range or usual
        self._ends = parse_range(self._range_text)

    @property
    def title(self) -> str:
        """What is shown, such as "velocity, magnitude"."""
        what = "" if self.component in ("", "color") else f", {self.component}"
        return f"{self.name}{what}"

    def numbers(self, values: Values) -> Floats:
        """The number that is shown of each value of a frame, of shape (N,); NaN where none is."""
        chosen = values[:, self._columns].astype(np.float64)
        is_length = self.component == MAGNITUDE
        found = np.linalg.norm(chosen, axis=1) if is_length else chosen[:, 0]
        return np.where(np.isfinite(found), found, np.nan)

    def errors(self, original: Values, decoded: Values) -> Floats:
        """The error of each value of a frame, of shape (N,), NaN where one of two is missing."""
        found = value_errors(original[np.newaxis], decoded[np.newaxis], self.kind)[0]
        return np.where(np.isfinite(found), found, np.nan)

    def colors(self, values: Values, scale: TrackScale | None) -> Image:
        """Colours of each value of a frame, uint8 of shape (N, 3) in sRGB.

        Parameters
        ----------
        values : array of shape (N, C)
        scale : TrackScale or None
            Of numbers; colours that are shown as they are need none.
        """
        if self.shows_colors or scale is None:
            shown = values[:, :3].astype(np.float64)
            if values.dtype != np.uint8:
                shown = 255 * np.nan_to_num(shown)
            return np.rint(np.clip(shown, 0, 255)).astype(np.uint8)
        return colorize(self.numbers(values), scale.low, scale.high, self.colormap)

    def scale(self, frames: "FrameNumbers") -> TrackScale | None:
        """The range of colours that suits frames; None of colours that are shown as they are.

        Raises
        ------
        InvalidInputError
            If a percentile lies beyond the number at the other end.
        """
        if self.shows_colors:
            return None
        least, most = frames.least, frames.most
        if not np.isfinite(least):
            return TrackScale(0.0, 1.0, least, most, has_missing=True)
        low, high = (
            frames.percentile(amount) if is_percent else amount for amount, is_percent in self._ends
        )
        if all(is_percent for _, is_percent in self._ends) and low < 0 < high:
            high = max(-low, high)
            low = -high
        if low > high:
            raise InvalidInputError(
                f"the range {self._range_text} of track {self.name!r} would be {low:.4g} to "
                f"{high:.4g}; give another"
            )
        if low == high:  # such as of a track that is the same everywhere
            half = abs(low) / 2 or 0.5
            low, high = low - half, low + half
        return TrackScale(low, high, least, most, frames.has_missing)

    def caption(self, scale: TrackScale) -> str:
        """What the colours mean, in words, beside their bar."""
        unit = f" ({self.unit})" if self.unit else ""
        ends = [
            f"percentile {end.strip()}" if "%" in end else end.strip()
            for end in self._range_text.split(":")
        ]
        text = f"Colours: {self.title}{unit}, from {' to '.join(ends)}"
        if all(is_percent for _, is_percent in self._ends) and scale.low == -scale.high:
            text += ", as far on both sides of 0"
        if not np.isnan(scale.least):
            span = scale.most - scale.least
            ends = [short_number(end, span) for end in (scale.least, scale.most)]
            text += f"; the values shown are {' to '.join(ends)}"
        return f"{text}." + (" Grey: no value." if scale.has_missing else "")


class FrameNumbers:
    """What is known of the numbers of frames, which are given one after the other."""

    def __init__(self) -> None:
        self.least, self.most, self.has_missing = np.nan, np.nan, False
        self._quantiles: list[Floats] = []

    def add(self, numbers: Floats) -> None:
        """Take those of a frame, of shape (N,)."""
        found = numbers[~np.isnan(numbers)]
        self.has_missing |= len(found) < len(numbers)
        if len(found):
            self._quantiles.append(np.quantile(found, np.linspace(0, 1, _N_QUANTILES)))
            self.least = float(np.fmin(self.least, found.min()))
            self.most = float(np.fmax(self.most, found.max()))

    def percentile(self, percent: float) -> float:
        """The number that so many percent of all are below; 0 where there is none."""
        return float(np.percentile(self._quantiles, percent)) if self._quantiles else 0.0


def parse_range(text: str) -> tuple[tuple[float, bool], tuple[float, bool]]:
    """Both ends of "LOW:HIGH", each a number, and whether it is a percentile.

    Raises
    ------
    InvalidInputError
        If it is no range.
    """
    found = [_END.fullmatch(part) for part in text.split(":")]
    if len(found) == 2 and found[0] and found[1]:
        low, high = ((float(end[1]), end[2] == "%") for end in found if end)
        is_inside = all(0 <= amount <= 100 for amount, is_percent in (low, high) if is_percent)
        is_finite = bool(np.isfinite([low[0], high[0]]).all())
        if is_inside and is_finite and (low[0] < high[0] or low[1] != high[1]):
            return low, high
    raise InvalidInputError(
        "a range is LOW:HIGH, low first, each a number or a percentile of 0% to 100%, such as "
        f"0:500, -1:1 or 2%:98%; got {text!r}"
    )


def _shown(look: TrackLook, track: TrackSource) -> tuple[Sequence[int], str]:
    """Columns that are shown, and what they are called; nothing of the only one."""
    n_columns = track.shape[2]
    wanted = look.component
    if wanted is None:
        if track.kind is TrackKind.COLOR:
            return range(3), "color"
        if n_columns == 1:
            return (0,), ""
        wanted = "x" if track.kind is TrackKind.NORMAL else MAGNITUDE
    words = [*AXES[:n_columns]] if 1 < n_columns <= len(AXES) else []
    if n_columns <= MOST_OF_MAGNITUDE:
        words.append(MAGNITUDE)
    columns = [str(column) for column in range(n_columns)]
    if wanted not in (*columns, *words):
        said = columns[0] if n_columns == 1 else f"{columns[0]} to {columns[-1]}"
        got = f"got {wanted!r}" if look.component else "say which"
        raise InvalidInputError(
            f"track {look.name!r} has {counted(n_columns, 'number')} of each {track.domain}: "
            f"--component is {', '.join([said, *words])}; {got}"
        )
    if wanted == MAGNITUDE:
        return range(n_columns), MAGNITUDE
    column = AXES.index(wanted) if wanted in AXES else int(wanted)
    if n_columns == 1:
        return (0,), ""
    return (column,), AXES[column] if n_columns <= len(AXES) else f"column {column}"
