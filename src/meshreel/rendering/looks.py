"""How an animation is drawn: options of `meshreel render` and of players, each a field."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal

from meshreel.codec.option import Option
from meshreel.errors import InvalidInputError, Keyword

COLORS = "Coloring by a track"
LOOK = "Look"
"""Groups of options."""

_END = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]{1,3})?)\s*(%?)\s*", re.I)
_SIZE = re.compile(r"(\d{1,5})x(\d{1,5})", re.I)


@dataclass(frozen=True)
class TrackLook:
    """How to show a track; raises InvalidInputError if its range is none."""

    name: Annotated[
        str,
        Option(
            "Color the mesh by a track, such as stress; color tracks are shown directly.",
            flag="--track",
            metavar="NAME",
            group=COLORS,
        ),
    ]
    component: Annotated[
        str | None,
        Option(
            "Component of the values; INDEX counts from 0. Default: the magnitude of vectors, x of "
            "normals.",
            names=("x", "y", "z", "magnitude"),
            metavar="x|y|z|magnitude|INDEX",
            group=COLORS,
        ),
    ] = None
    range: Annotated[
        str | None,
        Option(
            "Ends of the color range, numbers or percentiles of the frames shown, such as 0:500 or "
            "2%:98%. Percentiles of opposite sign give a range symmetric about 0. Default: 2%:98%; "
            "for normals -1:1.",
            metavar="LOW:HIGH",
            group=COLORS,
        ),
    ] = None
    colormap: Annotated[
        Literal["sequential", "diverging"] | None,
        Option(
            "Violet to yellow, or blue over gray to red. Default: diverging if 0 is inside the "
            "range, else sequential.",
            group=COLORS,
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.range is not None:
            parse_range(self.range)


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a picture or a film shows an animation."""

    heatmap: Annotated[
        Literal["distance", "angle", "sted", "track"] | None,
        Option(
            "Color the decoded mesh by its error: vertex distance, angle between normals, local "
            "STED, or error of {track} in its unit. If the meshes differ, distance is that to the "
            "surface of the original."
        ),
    ] = None
    track: TrackLook | None = None
    cut: Annotated[
        str | None,
        Option(
            "Hide the cells of a volume mesh beyond a plane, so that the inside is visible: x=40% "
            "of the box, x=0.2 in model units, x for the middle; -x keeps the other side. The "
            "first frame decides which cells.",
            metavar="AXIS[=POSITION]",
            group=LOOK,
        ),
    ] = None
    view: Annotated[
        str,
        Option(
            "View direction: front, side, top, or degrees to the right and up.",
            metavar="AZ,EL",
            group=LOOK,
        ),
    ] = "30,12"
    up: Annotated[
        Literal["x", "y", "z"] | None,
        Option("The up axis. Default: z for meshes that stand on z = 0, else y.", group=LOOK),
    ] = None
    follow: Annotated[
        bool | None,
        Option(
            "Whether the camera follows the mesh. Default: if the mesh would look small, or "
            "off-center in a picture.",
            flag="--follow/--no-follow",
            group=LOOK,
        ),
    ] = None
    size: Annotated[
        str | None,
        Option(
            "Size of the whole picture in pixels. Default: depends on the content.",
            metavar="WxH",
            group=LOOK,
        ),
    ] = None
    background: Annotated[str, Option("A name, or #rrggbb.", metavar="COLOR", group=LOOK)] = "white"

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of the picture; raises InvalidInputError if the size is none."""
        if self.size is None:
            return None
        if not (match := _SIZE.fullmatch(self.size)):
            raise InvalidInputError(
                Keyword("size"),
                f" takes WIDTHxHEIGHT in pixels, such as 1280x720; got {self.size!r}",
            )
        return int(match[1]), int(match[2])


def parse_range(text: str) -> tuple[tuple[float, bool], tuple[float, bool]]:
    """Both ends of "LOW:HIGH", each a number and whether it is a percentile.

    Raises
    ------
    InvalidInputError
        If the text is not a range.
    """
    ends = [_END.fullmatch(part) for part in text.split(":")]
    if len(ends) == 2 and ends[0] and ends[1]:
        low, high = ((float(end[1]), end[2] == "%") for end in ends if end)
        is_inside = all(0 <= amount <= 100 for amount, is_percent in (low, high) if is_percent)
        is_finite = math.isfinite(low[0]) and math.isfinite(high[0])
        if is_inside and is_finite and (low[0] < high[0] or low[1] != high[1]):
            return low, high
    raise InvalidInputError(
        "a range is LOW:HIGH, low first, each a number or a percentile of 0% to 100%, such as "
        f"0:500, -1:1 or 2%:98%; got {text!r}"
    )
