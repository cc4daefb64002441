"""Views of a frame: the mesh, its original and the heat map of their difference."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import require_comparable
from meshreel.metrics.heat import HEATS, Field, heat_field
from meshreel.metrics.reference import reference_of_box
from meshreel.model.geometry.fans import fan_corners
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.sequence import Faces, FrameSource
from meshreel.model.surface import Domain, Kind, Surface
from meshreel.model.tracks import TrackSource, track_by_name
from meshreel.rendering.camera import Camera
from meshreel.rendering.colormap import colorize, round_up
from meshreel.rendering.painting import Color, Image
from meshreel.rendering.rasterizer import CLAY, render
from meshreel.rendering.track_colors import FrameNumbers, TrackColors, TrackLook, TrackScale
from meshreel.runtime.progress import Count, Progress, silent

HEAT_PERCENTILE = 99.5
"""The range of a heat map ends at a round number above this percentile of all values."""

TRACK_HEAT = "track"

HEAT_NAMES = (*HEATS, TRACK_HEAT)
"""Kinds of heat maps: errors of positions, or errors of the track."""

GLOW = 0.5
"""Unlit share of colors that represent numbers: near the color bar, with visible folds."""

WHITE: Color = (255, 255, 255)


@dataclass(frozen=True)
class HeatRange:
    """The color range of a heat map, the same for all frames.

    Attributes
    ----------
    high : float
        End of the range, a round number; it begins at 0.
    largest : float
        Largest of all values, which may exceed `high`.
    frame : int
        Frame of the largest value.
    """

    high: float
    largest: float
    frame: int


Frame = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Scales:
    """Color ranges of the heat map and of the track; None without one."""

    heat: HeatRange | None = None
    track: TrackScale | None = None


NO_SCALES = Scales()


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame of each sequence of a scene, the original first.

    Attributes
    ----------
    positions : list of float arrays of shape (V, 3)
    values : list of arrays of shape (N, C)
        Track values; empty without a track.
    """

    positions: list[Frame]
    values: list[Values]


class Scene:
    """A mesh to draw, alone or next to its original and the heat map of their difference.

    Parameters
    ----------
    original : FrameSource, optional
        With the same frames, vertices and triangles.
    heat : str, optional
        One of `HEAT_NAMES`; needs the original.
    background : three integers
        sRGB in 0..255.
    track : TrackLook, optional
        Colors the mesh and the original by the track of this name.

    Raises
    ------
    InvalidInputError
        If the original has another mesh or is missing for a heat map, or the track is missing.
    """

    def __init__(
        self,
        sequence: FrameSource,
        original: FrameSource | None = None,
        heat: str | None = None,
        *,
        background: Color = WHITE,
        track: TrackLook | None = None,
    ) -> None:
        if heat is not None and original is None:
            raise InvalidInputError(
                "a heat map shows the difference from an original; name it with --original"
            )
        if heat == TRACK_HEAT and track is None:
            raise InvalidInputError("a heat map of a track needs its name: add --track")
        self.sequence, self.original = sequence, original
        self.heat, self.background = heat, background
        self._sources = [sequence] if original is None else [original, sequence]
        self._colors = [_colors_of(source) for source in self._sources]
        self._shadings = [_shading_of(source) for source in self._sources]
        if original is not None:
            require_comparable(original, sequence)
        self.track: TrackColors | None = None
        self._tracks: list[TrackSource] = []
        if track is not None:
            self.track = TrackColors(track, track_by_name(sequence.tracks, track.name))
            self._tracks = [track_by_name(source.tracks, track.name) for source in self._sources]
        self._field: Field | None = None
        if original is not None and heat is not None and heat != TRACK_HEAT:
            extent = original.extent
            diagonal = reference_of_box(extent.low, extent.high).diagonal
            self._field = heat_field(heat, original.faces, original.n_verts, diagonal)

    @property
    def track_column(self) -> int:
        """The last column whose views are colored by the track."""
        return -1 if self.original is None else 1

    @property
    def titles(self) -> list[str]:
        """The title of each view; empty for a single mesh."""
        if self.original is None:
            return [""]
        suffix = f": {self.track.title}" if self.track is not None else ""
        heat = [self._heat_label] if self.heat else []
        return [f"original{suffix}", f"decoded{suffix}", *heat]

    @property
    def _heat_label(self) -> str:
        if self.track is not None and self.heat == TRACK_HEAT:
            unit = f", {self.track.error_unit}" if self.track.error_unit else ""
            return f"error of {self.track.name}{unit}"
        return HEATS[self.heat].label if self.heat else ""

    @property
    def heat_unit(self) -> str:
        """The unit of the heat map; may be empty."""
        if self.track is not None and self.heat == TRACK_HEAT:
            return self.track.error_unit
        return HEATS[self.heat].unit if self.heat else ""

    @property
    def framed(self) -> FrameSource:
        """The sequence that the camera frames: the original if there is one."""
        return self.original if self.original is not None else self.sequence

    def read(self, number: int) -> Moment:
        """Read a frame of each sequence."""
        return Moment(
            [_frame(source, number) for source in self._sources],
            [np.asarray(track.read(number, number + 1)[0]) for track in self._tracks],
        )

    def scales(self, numbers: Sequence[int], progress: Progress = silent) -> Scales:
        """Return color ranges that suit these frames, of which there must be at least one."""
        if self.heat is None and self.track is None:
            return NO_SCALES
        track_numbers, heat_numbers, maxima = FrameNumbers(), FrameNumbers(), []
        for done, number in enumerate(numbers, 1):
            moment = self.read(number)
            if self.track is not None and not self.track.shows_colors:
                for values in moment.values:
                    track_numbers.add(self.track.numbers(values))
            if self.heat is not None:
                heat = self._heat(moment)
                heat_numbers.add(heat)
                maxima.append(float(np.max(heat, initial=0.0, where=~np.isnan(heat))))
            progress("measuring", Count(done, len(numbers), "frames"))
        heat_range = None
        if self.heat is not None:
            worst = int(np.argmax(maxima))
            high = round_up(heat_numbers.percentile(HEAT_PERCENTILE))
            heat_range = HeatRange(high, maxima[worst], numbers[worst])
        return Scales(heat_range, None if self.track is None else self.track.scale(track_numbers))

    def draw(self, moment: Moment, camera: Camera, scales: Scales = NO_SCALES) -> list[Image]:
        """Draw the views of a frame, in the order of their titles.

        Parameters
        ----------
        moment : Moment
            From `read`.
        scales : Scales, optional
            From `scales`.
        """
        colors, glow = self._colors, 0.0
        if self.track is not None:
            colors, glow = self._track_colors(self.track, moment, scales.track), GLOW
        views = [
            (positions, source.faces, view_colors, glow, shading)
            for positions, source, view_colors, shading in zip(
                moment.positions, self._sources, colors, self._shadings, strict=True
            )
        ]
        if scales.heat is not None:
            heat = colorize(self._heat(moment), 0.0, scales.heat.high)
            if self.track is not None and self.heat == TRACK_HEAT:
                heat = self._of_items(self.track, heat, self.sequence)
            views.append(
                (moment.positions[-1], self.sequence.faces, heat, GLOW, self._shadings[-1])
            )
        return [
            render(
                frame, faces, camera,
                colors=view_colors, background=self.background, glow=glow, shading=shading,
            )
            for frame, faces, view_colors, glow, shading in views
        ]  # fmt: skip

    def _heat(self, moment: Moment) -> npt.NDArray[np.float64]:
        """Error of each vertex, or of each value of the track."""
        if self._field is not None:
            return self._field(*moment.positions)
        assert self.track is not None  # checked in __init__
        return self.track.errors(*moment.values)

    def _track_colors(
        self, track: TrackColors, moment: Moment, scale: TrackScale | None
    ) -> list[npt.ArrayLike]:
        return [
            self._of_items(track, track.colors(values, scale), source)
            for values, source in zip(moment.values, self._sources, strict=True)
        ]

    @staticmethod
    def _of_items(track: TrackColors, colors: Image, source: FrameSource) -> Image:
        return colors_of_items(colors, track.domain, source.surface, source.faces)


def _shading_of(source: FrameSource) -> RowNormals | None:
    """Normals of a mesh with hard edges; None for a smooth mesh."""
    if source.surface.hard_edges is None:
        return None
    return RowNormals.of_surface(source.faces, source.surface, source.n_verts)


def _colors_of(source: FrameSource) -> npt.ArrayLike:
    colors = surface_colors(source.surface, source.faces)
    return CLAY if colors is None else colors


@dataclass(frozen=True, eq=False)
class ChosenFrames:
    """Positions of selected frames, read during iteration."""

    source: FrameSource
    numbers: Sequence[int]

    def __iter__(self) -> Iterator[Frame]:
        return (_frame(self.source, number) for number in self.numbers)


def _frame(source: FrameSource, number: int) -> Frame:
    frame: Frame = source.read(number, number + 1)[0]
    return frame


def surface_colors(surface: Surface, faces: Faces) -> npt.NDArray[np.float32] | None:
    """The first color attribute of a mesh, sRGB in 0..255; None without one.

    Parameters
    ----------
    surface : Surface
        Byte colors are used unchanged, others times 255; opacity is ignored.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    float32 array of shape (V, 3), per vertex, or (M, 3, 3), per corner of each face
    """
    attributes = surface.of_kind(Kind.COLOR)
    if not attributes:
        return None
    attribute = attributes[0]
    values = attribute.per_item()[:, :3].astype(np.float32)
    if values.shape[1] < 3:
        values = np.repeat(values[:, :1], 3, axis=1)  # shades of gray
    if attribute.values.dtype != np.uint8:
        values = 255 * np.nan_to_num(values)
    values = np.clip(values, 0, 255)
    return np.asarray(colors_of_items(values, attribute.domain, surface, faces))


def colors_of_items(
    colors: npt.NDArray[Any], domain: Domain, surface: Surface, faces: Faces
) -> npt.NDArray[Any]:
    """Convert colors of polygons or their corners to corners of triangles.

    Parameters
    ----------
    colors : array of shape (N, 3)
    domain : Domain
        Items that the colors belong to; vertex colors are returned unchanged.
    surface : Surface
        Defines the polygons.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    array of shape (V, 3) or (M, 3, 3)
    """
    if domain is Domain.VERTEX:
        return colors
    sizes = surface.sizes(len(faces))
    if domain is Domain.CORNER:
        return np.asarray(colors[fan_corners(sizes)])
    triangle_colors = np.repeat(colors, sizes - 2, axis=0)
    return np.repeat(triangle_colors[:, np.newaxis], 3, axis=1)
