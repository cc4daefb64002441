"""Options of our codec alone."""

from enum import Enum

from meshreel.codec.option import Option, Range
from meshreel.codec.rounding_options import ROUNDING
from meshreel.codec.targets import LOSSLESS, MAX_ERROR, TARGET_OPTIONS, UNIT

DEFAULT_EFFORT = 5
EFFORT_RANGE = Range(1, 9, is_whole=True)


class Tune(Enum):
    """The error that bits are spent against."""

    VISUAL = "visual"
    GEOMETRY = "geometry"


TUNE = Option(
    "tune",
    str,
    "What bits are spent on. visual: how the surface looks; geometry: where vertices are.",
    default_text="what the target needs, else visual",
    names=tuple(tune.value for tune in Tune),
    more="visual serves STED, geometry KG and the largest error.",
)
EFFORT = Option(
    "effort",
    int,
    f"{EFFORT_RANGE.words}: time against size.",
    default_text=str(DEFAULT_EFFORT),
    range=EFFORT_RANGE,
)

OPTIONS = {
    "reel": (*TARGET_OPTIONS, LOSSLESS, TUNE, EFFORT, *ROUNDING),
    "lossless": (LOSSLESS,),
    "grid": (MAX_ERROR, UNIT, *ROUNDING),
}
"""By the name of the method."""
