"""Efforts, tunes and qualities: the encoder's choices behind them."""

import math
from dataclasses import dataclass

from meshreel.codec.choices import Tune
from meshreel.codec.config import DEFAULT_EFFORT, EncoderConfig
from meshreel.codec.reel.encoding.analysis import FieldChoices
from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER
from meshreel.codec.targets import DEFAULT_QUALITY, Target, TargetKind
from meshreel.errors import InvalidInputError

USUAL_STEP = 1e-4
"""Step of quality 80, in diagonals of the model's own bounding box, the mean of all frames.

From here on, the nine sequences of `docs/codec.md` look like their originals at 1080p.
"""

POINTS_PER_HALVING = 12.0

STEPS_OF_BOUND = 14.0
"""Where the search for a largest error begins: rarer errors than this are cheaply corrected."""


def quality_step(quality: float) -> float:
    """Step of a quality in 1..100, in diagonals of the model's own bounding box."""
    return float(USUAL_STEP * 2.0 ** ((DEFAULT_QUALITY - quality) / POINTS_PER_HALVING))


@dataclass(frozen=True)
class Effort:
    """The choices behind an effort; the decoder's time grows with it too.

    Attributes
    ----------
    stencil_size : int
        Vertices that predict one.
    n_learned : int
        Modes that predictor weights follow.
    """

    stencil_size: int
    n_learned: int


def tune_named(name: str | None, target: Target) -> Tune:
    """The tune of this name; the one that serves the target where none is given."""
    if name is not None:
        return Tune(name)
    serves_geometry = target.kind in (TargetKind.MAX_ERROR, TargetKind.KG)
    return Tune.GEOMETRY if serves_geometry else Tune.VISUAL


EFFORTS = {
    1: Effort(6, 4),
    2: Effort(6, 8),
    3: Effort(8, 12),
    4: Effort(12, 16),
    5: Effort(16, 32),
    6: Effort(16, 48),
    7: Effort(16, 64),
    8: Effort(16, 128),
    9: Effort(16, 255),
}


def choices_of(config: EncoderConfig) -> FieldChoices:
    """The encoder's choices that the options mean, at some step."""
    effort = DEFAULT_EFFORT if config.effort is None else config.effort
    return choices_for(effort, tune_named(config.tune, config.target), config.n_modes)


def choices_for(effort: int, tune: Tune, n_modes: int | None) -> FieldChoices:
    """The encoder's choices for an effort and a tune, at some step."""
    spent = EFFORTS[int(effort)]
    is_visual = tune is Tune.VISUAL
    return FieldChoices(
        position_step=1.0,
        n_modes=n_modes,
        basis_step=4.0 if is_visual else 2.5,
        least_rms=0.8 if is_visual else 0.5,
        feedback_gain=0.6 if is_visual else 0.5,
        n_shaped_resolutions=2 if is_visual else 1,
        stencil_size=spent.stencil_size,
        n_learned=spent.n_learned,
    )


def finest_step(n_columns: int = 3) -> float:
    """Steps below this would make integers of fields too large for the stream."""
    # A field has at a vertex at most the length of its trajectory, and no coordinate exceeds half
    # a diagonal.
    return 0.5 * math.sqrt(n_columns) / LARGEST_INTEGER


def checked_step(step: float, finest: float) -> float:
    """The step itself.

    Raises
    ------
    InvalidInputError
        If it is too fine.
    """
    if step < finest:
        raise InvalidInputError(
            f"step {step:g} is finer than this sequence can be coded with; "
            f"at least {finest:.2g} is allowed"
        )
    return step
