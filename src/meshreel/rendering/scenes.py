"""Views of a mesh in one frame: itself, its original, and how far it is off."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import require_comparable
from meshreel.metrics.heat import HEATS, Field, heat_field
from meshreel.metrics.reference import reference_of_box
from meshreel.rendering.camera import Camera
from meshreel.rendering.colormap import colorize, round_up
from meshreel.rendering.painting import Color, Image
from meshreel.rendering.rasterizer import CLAY, render
from meshreel.rendering.surface_colors import surface_colors
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.sequence import FrameSource

HEAT_PERCENTILE = 99.5
"""The colours of a heat map end at a round number above this percentile of all values shown."""

_N_QUANTILES = 1000
"""So many values of each frame stand for all of its vertices."""

HEAT_GLOW = 0.9
"""Heat maps keep so much of their colours in light and shade: a fold is no error."""

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


class Scene:
    """A mesh to be drawn, alone or beside its original and the heat map of their difference.

    Parameters
    ----------
    shown : FrameSource
    original : FrameSource, optional
        Of the same frames, vertices and triangles.
    heat : str, optional
        One of `meshreel.metrics.heat.HEATS`; needs the original.
    background : three integers
        sRGB in 0..255.

    Raises
    ------
    InvalidInputError
        If the original is another mesh, or there is none to show heat by.
    """

    def __init__(
        self,
        shown: FrameSource,
        original: FrameSource | None = None,
        heat: str | None = None,
        *,
        background: Color = WHITE,
    ) -> None:
        if heat is not None and original is None:
            raise InvalidInputError(
                "a heat map shows how far a mesh is from its original; name that (--original)"
            )
        self.shown, self.original, self.heat, self.background = shown, original, heat, background
        self._sources = [shown] if original is None else [original, shown]
        self._colors = [_colors_of(source) for source in self._sources]
        if original is not None:
            require_comparable(original, shown)
        self._field: Field | None = None
        if original is not None and heat is not None:
            extent = original.extent
            diagonal = reference_of_box(extent.low, extent.high).diagonal
            self._field = heat_field(heat, original.faces, original.n_verts, diagonal)

    @property
    def titles(self) -> list[str]:
        """A title for each view; an empty one for a mesh by itself."""
        if self.original is None:
            return [""]
        heat = [HEATS[self.heat].label] if self.heat else []
        return ["original", "decoded", *heat]

    @property
    def framed(self) -> FrameSource:
        """The sequence that the camera must see: the original, where there is one."""
        return self.original if self.original is not None else self.shown

    def read(self, number: int) -> list[Frame]:
        """The positions of a frame in each sequence, those of the original first."""
        return [_frame(source, number) for source in self._sources]

    def heat_range(self, numbers: Sequence[int], progress: Progress = silent) -> HeatRange | None:
        """The range of colours that suits these frames; None where there is no heat map.

        Parameters
        ----------
        numbers : sequence of int
            Of frames, at least one.
        progress : Progress, default silent
        """
        if self._field is None:
            return None
        shares = (np.arange(_N_QUANTILES) + 0.5) / _N_QUANTILES
        quantiles, most = [], []
        for done, number in enumerate(numbers, 1):
            values = self._field(*self.read(number))
            quantiles.append(np.quantile(values, shares).astype(np.float32))
            most.append(float(values.max()))
            progress("measuring", Count(done, len(numbers), "frames"))
        high = round_up(float(np.percentile(quantiles, HEAT_PERCENTILE)))
        worst = int(np.argmax(most))
        return HeatRange(high, most[worst], numbers[worst])

    def draw(
        self, frames: Sequence[Frame], camera: Camera, heat_range: HeatRange | None = None
    ) -> list[Image]:
        """The views of a frame, in the order of their titles.

        Parameters
        ----------
        frames : sequence of float arrays of shape (V, 3)
            From `read`.
        camera : Camera
        heat_range : HeatRange, optional
            From `heat_range`.
        """
        faces = [source.faces for source in self._sources]
        looks = [*zip(frames, faces, self._colors, [0.0] * len(frames), strict=True)]
        if self._field is not None and heat_range is not None:
            heat = colorize(self._field(*frames), 0.0, heat_range.high)
            looks.append((frames[-1], self.shown.faces, heat, HEAT_GLOW))
        return [
            render(frame, faces, camera, colors=colors, background=self.background, glow=glow)
            for frame, faces, colors, glow in looks
        ]


def _colors_of(source: FrameSource) -> npt.ArrayLike:
    own = surface_colors(source.surface, source.faces)
    return CLAY if own is None else own


@dataclass(frozen=True, eq=False)
class ChosenFrames:
    """Positions of some frames of a source, read whenever they are gone through.

    Parameters
    ----------
    source : FrameSource
    numbers : sequence of int
    """

    source: FrameSource
    numbers: Sequence[int]

    def __iter__(self) -> Iterator[Frame]:
        return (_frame(self.source, number) for number in self.numbers)


def _frame(source: FrameSource, number: int) -> Frame:
    frame: Frame = source.read(number, number + 1)[0]
    return frame
