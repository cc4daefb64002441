"""Views of a mesh in one frame: itself, its original, and how far it is off."""

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
from meshreel.model.tracks import TrackSource, named_track
from meshreel.rendering.camera import Camera
from meshreel.rendering.colormap import colorize, round_up
from meshreel.rendering.painting import Color, Image
from meshreel.rendering.rasterizer import CLAY, render
from meshreel.rendering.track_colors import FrameNumbers, TrackColors, TrackLook, TrackScale
from meshreel.runtime.progress import Count, Progress, silent

HEAT_PERCENTILE = 99.5
"""The colours of a heat map end at a round number above this percentile of all values shown."""

TRACK_HEAT = "track"

HEAT_NAMES = (*HEATS, TRACK_HEAT)
"""What a heat map can show: how far vertices are off, or the values of the track."""

GLOW = 0.9
"""Colours that stand for numbers keep so much of themselves in light and shade."""

WHITE: Color = (255, 255, 255)


@dataclass(frozen=True)
class HeatRange:
    """The range of colours, the same for all frames.

    Attributes
    ----------
    high : float
        Where the colours end; a round number. They begin at 0.
    largest : float
        Of all values; it may lie above.
    frame : int
        Where it is.
    """

    high: float
    largest: float
    frame: int


Frame = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Scales:
    """What colours mean in all frames.

    Attributes
    ----------
    heat : HeatRange or None
        Of the heat map, if there is one.
    track : TrackScale or None
        Of the track, if it is shown by colours that stand for its numbers.
    """

    heat: HeatRange | None = None
    track: TrackScale | None = None


NO_SCALES = Scales()


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame of a scene, in each of its sequences, that of the original first.

    Attributes
    ----------
    positions : list of float arrays of shape (V, 3)
    values : list of arrays of shape (N, C)
        Of the track; empty without one.
    """

    positions: list[Frame]
    values: list[Values]


class Scene:
    """A mesh to be drawn, alone or beside its original and the heat map of their difference.

    Parameters
    ----------
    original : FrameSource, optional
        Of the same frames, vertices and triangles.
    heat : str, optional
        One of `HEAT_NAMES`; needs the original.
    background : three integers
        sRGB in 0..255.
    track : TrackLook, optional
        Colours the mesh by a track, and the original by that of the same name.

    Raises
    ------
    InvalidInputError
        If the original is another mesh, there is none to show heat by, or no such track.
    """

    def __init__(
        self,
        shown: FrameSource,
        original: FrameSource | None = None,
        heat: str | None = None,
        *,
        background: Color = WHITE,
        track: TrackLook | None = None,
    ) -> None:
        if heat is not None and original is None:
            raise InvalidInputError(
                "a heat map shows how far a mesh is from its original; name that (--original)"
            )
        if heat == TRACK_HEAT and track is None:
            raise InvalidInputError("a heat map of a track needs its name (--track)")
        self.shown, self.original, self.heat, self.background = shown, original, heat, background
        self._sources = [shown] if original is None else [original, shown]
        self._colors = [_colors_of(source) for source in self._sources]
        self._shadings = [_shading_of(source) for source in self._sources]
        if original is not None:
            require_comparable(original, shown)
        self.track: TrackColors | None = None
        self._tracks: list[TrackSource] = []
        if track is not None:
            self.track = TrackColors(track, named_track(shown.tracks, track.name))
            self._tracks = [named_track(source.tracks, track.name) for source in self._sources]
        self._field: Field | None = None
        if original is not None and heat is not None and heat != TRACK_HEAT:
            extent = original.extent
            diagonal = reference_of_box(extent.low, extent.high).diagonal
            self._field = heat_field(heat, original.faces, original.n_verts, diagonal)

    @property
    def track_column(self) -> int:
        """The last column of views that are coloured by the track."""
        return -1 if self.original is None else 1

    @property
    def titles(self) -> list[str]:
        """A title for each view; an empty one for a mesh by itself."""
        if self.original is None:
            return [""]
        of_track = f": {self.track.title}" if self.track is not None else ""
        heat = [self._heat_label] if self.heat else []
        return [f"original{of_track}", f"decoded{of_track}", *heat]

    @property
    def _heat_label(self) -> str:
        if self.track is not None and self.heat == TRACK_HEAT:
            unit = f", {self.track.error_unit}" if self.track.error_unit else ""
            return f"error of {self.track.name}{unit}"
        return HEATS[self.heat].label if self.heat else ""

    @property
    def heat_unit(self) -> str:
        """The unit of the heat map; empty if it has none."""
        if self.track is not None and self.heat == TRACK_HEAT:
            return self.track.error_unit
        return HEATS[self.heat].unit if self.heat else ""

    @property
    def framed(self) -> FrameSource:
        """The sequence that the camera must see: the original, where there is one."""
        return self.original if self.original is not None else self.shown

    def read(self, number: int) -> Moment:
        """A frame of each sequence."""
        return Moment(
            [_frame(source, number) for source in self._sources],
            [np.asarray(track.read(number, number + 1)[0]) for track in self._tracks],
        )

    def scales(self, numbers: Sequence[int], progress: Progress = silent) -> Scales:
        """The ranges of colours that suit these frames.

        Parameters
        ----------
        numbers : sequence of int
            Of frames, at least one.
        progress : Progress, default silent
        """
        if self.heat is None and self.track is None:
            return NO_SCALES
        of_track, of_heat, most = FrameNumbers(), FrameNumbers(), []
        for done, number in enumerate(numbers, 1):
            moment = self.read(number)
            if self.track is not None and not self.track.shows_colors:
                for values in moment.values:
                    of_track.add(self.track.numbers(values))
            if self.heat is not None:
                heat = self._heat(moment)
                of_heat.add(heat)
                most.append(float(np.max(heat, initial=0.0, where=~np.isnan(heat))))
            progress("measuring", Count(done, len(numbers), "frames"))
        range_of_heat = None
        if self.heat is not None:
            worst = int(np.argmax(most))
            high = round_up(of_heat.percentile(HEAT_PERCENTILE))
            range_of_heat = HeatRange(high, most[worst], numbers[worst])
        return Scales(range_of_heat, None if self.track is None else self.track.scale(of_track))

    def draw(self, moment: Moment, camera: Camera, scales: Scales = NO_SCALES) -> list[Image]:
        """The views of a frame, in the order of their titles.

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
        looks = [
            (positions, source.faces, given, glow, shading)
            for positions, source, given, shading in zip(
                moment.positions, self._sources, colors, self._shadings, strict=True
            )
        ]
        if scales.heat is not None:
            heat = colorize(self._heat(moment), 0.0, scales.heat.high)
            if self.track is not None and self.heat == TRACK_HEAT:
                heat = self._of_items(self.track, heat, self.shown)
            looks.append((moment.positions[-1], self.shown.faces, heat, GLOW, self._shadings[-1]))
        return [
            render(
                frame,
                faces,
                camera,
                colors=given,
                background=self.background,
                glow=glow,
                shading=shading,
            )
            for frame, faces, given, glow, shading in looks
        ]

    def _heat(self, moment: Moment) -> npt.NDArray[np.float64]:
        """How far each vertex, or each value of the track, is off in a frame."""
        if self._field is not None:
            return self._field(*moment.positions)
        assert self.track is not None  # checked at the beginning
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
    """How a mesh with hard edges is shaded; None for a smooth one."""
    if source.surface.hard_edges is None:
        return None
    return RowNormals.of_surface(source.faces, source.surface, source.n_verts)


def _colors_of(source: FrameSource) -> npt.ArrayLike:
    own = surface_colors(source.surface, source.faces)
    return CLAY if own is None else own


@dataclass(frozen=True, eq=False)
class ChosenFrames:
    """Positions of some frames of a source, read whenever they are gone through.

    Parameters
    ----------
    numbers : sequence of int
    """

    source: FrameSource
    numbers: Sequence[int]

    def __iter__(self) -> Iterator[Frame]:
        return (_frame(self.source, number) for number in self.numbers)


def _frame(source: FrameSource, number: int) -> Frame:
    frame: Frame = source.read(number, number + 1)[0]
    return frame


def surface_colors(surface: Surface, faces: Faces) -> npt.NDArray[np.float32] | None:
    """The first colour attribute of a mesh, sRGB in 0..255; None if it has none.

    Parameters
    ----------
    surface : Surface
        Colours of bytes are taken as they are, others times 255; opacity is left out.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    float32 array of shape (V, 3), of each vertex, or (M, 3, 3), of each corner of each face
    """
    found = surface.of_kind(Kind.COLOR)
    if not found:
        return None
    values = found[0].per_item()[:, :3].astype(np.float32)
    if values.shape[1] < 3:
        values = np.repeat(values[:, :1], 3, axis=1)  # shades of grey
    if found[0].values.dtype != np.uint8:
        values = 255 * np.nan_to_num(values)
    values = np.clip(values, 0, 255)
    return np.asarray(colors_of_items(values, found[0].domain, surface, faces))


def colors_of_items(
    colors: npt.NDArray[Any], domain: Domain, surface: Surface, faces: Faces
) -> npt.NDArray[Any]:
    """Colours of vertices as they are, of shape (V, 3); those of others of each triangle's corners.

    Parameters
    ----------
    colors : array of shape (N, 3)
    domain : Domain
        What the N are; faces are polygons, corners are theirs.
    surface : Surface
        Has the polygons.
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
    of_triangles = np.repeat(colors, sizes - 2, axis=0)
    return np.repeat(of_triangles[:, np.newaxis], 3, axis=1)
