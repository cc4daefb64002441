"""Color a mesh by a track: component, range and color map."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Values
from meshreel.errors import InvalidInputError, Keyword
from meshreel.metrics.track_errors import value_errors
from meshreel.model.colors import unit_colors
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackKind, TrackSource, error_unit
from meshreel.rendering.colormap import NOT_A_NUMBER, Image, check_colormap, colorize, short_number
from meshreel.rendering.looks import TrackLook, parse_range
from meshreel.runtime.counting import counted

AXES = ("x", "y", "z")
MAGNITUDE = "magnitude"
MAX_MAGNITUDE_COLUMNS = 3
"""Values of more components have no magnitude."""

_N_QUANTILES = 1000
"""Quantiles per frame that represent its values."""


@dataclass(frozen=True)
class TrackScale:
    """Color range, and the extremes of all values."""

    low: float
    high: float
    """Ends of the color range; symmetric about 0 if both are percentiles of opposite sign."""
    smallest: float
    largest: float
    """Extremes of all values; NaN without values."""
    has_missing: bool
    """Whether some values are missing (NaN or infinite)."""


class TrackColors:
    """Colors of the values of a track.

    Raises
    ------
    InvalidInputError
        If the component, range or color map is invalid, or a color track, which is shown directly,
        has a range or color map.
    """

    def __init__(self, look: TrackLook, track: TrackSource) -> None:
        self.name: str = look.name
        self.kind: TrackKind = track.kind
        self.unit: str = track.unit
        self.domain: Domain = track.domain
        self.error_unit: str = error_unit(track.kind, track.unit)
        self.n_columns: int = track.shape[2]
        bound = 0.0 if KIND_ROWS[track.kind].is_direction else getattr(track, "error_bound", 0.0)
        self._error_bound: float = bound or 0.0
        self.component: str
        self._columns, self.component = _select_columns(look, track)
        self.shows_colors: bool = self.component == "color"
        self.colormap: str | None = look.colormap
        if look.colormap is not None:
            check_colormap(look.colormap)
        options = {"range": look.range, "colormap": look.colormap}
        unused = next((option for option, value in options.items() if value is not None), None)
        if self.shows_colors and unused:
            raise InvalidInputError(
                f"track {look.name!r} contains colors, which are shown directly; omit ",
                Keyword(unused),
                ", or select one channel with ",
                Keyword("component"),
            )
        self._range_text = look.range or KIND_ROWS[track.kind].range
        self._ends = parse_range(self._range_text)

    @property
    def title(self) -> str:
        """Name and component, such as "velocity, magnitude"."""
        component = "" if self.component in ("", "color") else f", {self.component}"
        return f"{self.name}{component}"

    def numbers(self, values: Values) -> Floats:
        """The selected component of each value of a frame, of shape (N,); NaN if missing."""
        columns = values[:, self._columns].astype(np.float64)
        is_length = self.component == MAGNITUDE
        numbers = np.linalg.norm(columns, axis=1) if is_length else columns[:, 0]
        return np.where(np.isfinite(numbers), numbers, np.nan)

    def errors(self, original: Values, decoded: Values) -> Floats:
        """The error of each value of a frame, of shape (N,); NaN if only one is missing."""
        errors = value_errors(original[np.newaxis], decoded[np.newaxis], self.kind)[0]
        return np.where(np.isfinite(errors), errors, np.nan)

    def colors(self, values: Values, scale: TrackScale | None) -> Image:
        """The color of each value of a frame, uint8 of shape (N, 3) in sRGB.

        Parameters
        ----------
        values : array of shape (N, C)
        scale : TrackScale or None
            From `scale`; None for colors.
        """
        if self.shows_colors or scale is None:
            colors = unit_colors(values[:, :3]).astype(np.float64)
            is_missing = np.isnan(colors).all(axis=1, keepdims=True)
            colors = np.where(is_missing, NOT_A_NUMBER, 255 * np.nan_to_num(colors))
            return np.rint(np.clip(colors, 0, 255)).astype(np.uint8)
        return colorize(self.numbers(values), scale.low, scale.high, self.colormap)

    def scale(self, frames: "FrameNumbers") -> TrackScale | None:
        """Return the color range for these frames; None for a color track.

        Raises
        ------
        InvalidInputError
            If the ends of the range, one of them a percentile, are in the wrong order.
        """
        if self.shows_colors:
            return None
        smallest, largest = frames.smallest, frames.largest
        if not np.isfinite(smallest):
            return TrackScale(0.0, 1.0, smallest, largest, has_missing=True)
        low, high = (
            frames.percentile(amount) if is_percent else amount for amount, is_percent in self._ends
        )
        low, high = self._snap_to_zero(low, high)
        if all(is_percent for _, is_percent in self._ends) and low < 0 < high:
            high = max(-low, high)
            low = -high
        if low > high:
            raise InvalidInputError(
                f"the range {self._range_text} of track {self.name!r} would be {low:.4g} to "
                f"{high:.4g}; the low end must not exceed the high end"
            )
        if low == high:  # a constant track, for example
            half = abs(low) / 2 or 0.5
            low, high = low - half, low + half
        return TrackScale(low, high, smallest, largest, frames.has_missing)

    def _snap_to_zero(self, low: float, high: float) -> tuple[float, float]:
        """Return 0 for percentiles whose sign may be due to the coding error.

        A track without negative values must not appear to have some. If that applies to both ends,
        the range is 0 to the bound.
        """
        bound = self._error_bound
        if bound == 0 or low > 0 or high < 0:
            return low, high
        (_, low_is_percentile), (_, high_is_percentile) = self._ends
        is_low_error = low_is_percentile and low >= -bound
        is_high_error = high_is_percentile and high <= bound
        if is_low_error and is_high_error:
            return 0.0, bound
        return 0.0 if is_low_error else low, 0.0 if is_high_error else high

    def caption(self, scale: TrackScale) -> str:
        """A caption that explains the color bar."""
        unit = f" ({self.unit})" if self.unit else ""
        ends = [
            f"percentile {end.strip()}" if "%" in end else end.strip()
            for end in self._range_text.split(":")
        ]
        text = f"Colors: {self.title}{unit}, from {' to '.join(ends)}"
        if all(is_percent for _, is_percent in self._ends) and scale.low == -scale.high:
            text += ", symmetric about 0"
        if not np.isnan(scale.smallest):
            span = scale.largest - scale.smallest
            ends = [short_number(end, span) for end in (scale.smallest, scale.largest)]
            text += f"; the values shown are {' to '.join(ends)}"
        return f"{text}." + (" Gray: no value." if scale.has_missing else "")


class FrameNumbers:
    """Accumulator of extremes and quantiles of numbers over frames."""

    def __init__(self) -> None:
        self.smallest: float = np.nan
        self.largest: float = np.nan
        self.has_missing: bool = False
        self._quantiles: list[Floats] = []

    def add(self, numbers: Floats) -> None:
        """Add the numbers of a frame, of shape (N,); NaN is missing."""
        valid = numbers[~np.isnan(numbers)]
        self.has_missing |= len(valid) < len(numbers)
        if len(valid):
            self._quantiles.append(np.quantile(valid, np.linspace(0, 1, _N_QUANTILES)))
            self.smallest = float(np.fmin(self.smallest, valid.min()))
            self.largest = float(np.fmax(self.largest, valid.max()))

    def percentile(self, percent: float) -> float:
        """Percentile of all numbers; 0 without numbers."""
        return float(np.percentile(self._quantiles, percent)) if self._quantiles else 0.0


def _select_columns(look: TrackLook, track: TrackSource) -> tuple[Sequence[int], str]:
    """The selected columns and the name of the component; empty for the only column."""
    n_columns = track.shape[2]
    component = look.component
    if component is None:
        component = KIND_ROWS[track.kind].component
        if component == "color":
            return range(3), component
        if n_columns == 1:
            return (0,), ""
    names = [*AXES[:n_columns]] if 1 < n_columns <= len(AXES) else []
    if n_columns <= MAX_MAGNITUDE_COLUMNS:
        names.append(MAGNITUDE)
    columns = [str(column) for column in range(n_columns)]
    if component not in (*columns, *names):
        numbers = columns[0] if n_columns == 1 else f"{columns[0]} to {columns[-1]}"
        got = f"got {component!r}" if look.component else "select one"
        raise InvalidInputError(
            f"track {look.name!r} has {counted(n_columns, 'number')} per {track.domain}: ",
            Keyword("component"),
            f" is {', '.join([numbers, *names])}; {got}",
        )
    if component == MAGNITUDE:
        return range(n_columns), MAGNITUDE
    column = AXES.index(component) if component in AXES else int(component)
    if n_columns == 1:
        return (0,), ""
    return (column,), AXES[column] if n_columns <= len(AXES) else f"column {column}"
