"""Encoder parameters of efforts and tunes."""

import math

from meshreel.codec.reel.encoding.analysis import FieldChoices
from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER
from meshreel.codec.reel_options import DEFAULT_EFFORT, ReelOptions, Tune
from meshreel.codec.targets import Target, TargetKind

STEPS_OF_BOUND = 7.0
"""Ratio of an error bound to the first step tried; corrections of rare larger errors are cheap."""

EFFORTS = {
    1: (6, 4),
    2: (6, 8),
    3: (8, 12),
    4: (12, 16),
    5: (16, 32),
    6: (16, 48),
    7: (16, 64),
    8: (16, 128),
    9: (16, 255),
}
"""Number of vertices that predict one, and of modes that prediction weights adapt to, by effort.
Decoding takes longer with higher efforts too."""


def tune_named(name: str | None, target: Target) -> Tune:
    """Return the tune of this name; None selects the tune that suits the target."""
    if name is not None:
        return Tune(name)
    is_geometric = target.kind in (TargetKind.MAX_ERROR, TargetKind.KG)
    return Tune.GEOMETRY if is_geometric else Tune.VISUAL


def choices_of(config: ReelOptions) -> FieldChoices:
    """Return the encoder parameters of options; the step is still to be set."""
    effort = DEFAULT_EFFORT if config.effort is None else config.effort
    return choices_for(effort, tune_named(config.tune, config.target), config.n_modes)


def choices_for(effort: int, tune: Tune, n_modes: int | None) -> FieldChoices:
    """Return the encoder parameters of an effort and a tune; the step is still to be set."""
    stencil_size, n_learned = EFFORTS[int(effort)]
    is_visual = tune is not Tune.GEOMETRY
    return FieldChoices(
        position_step=1.0,
        n_modes=n_modes,
        basis_step=4.0 if is_visual else 2.5,
        least_rms=0.8 if is_visual else 0.5,
        feedback_gain=0.6 if is_visual else 0.5,
        n_shaped_resolutions=2 if is_visual else 1,
        stencil_size=stencil_size,
        n_learned=n_learned,
        slides=tune is Tune.SURFACE,
    )


def finest_step(n_columns: int = 3) -> float:
    """Return the finest step whose integers of fields still fit in a stream."""
    # A field value is at most as long as the trajectory of its vertex; coordinates are at most half
    # a diagonal.
    return 0.5 * math.sqrt(n_columns) / LARGEST_INTEGER


FINEST_STEP = finest_step()
"""Finest step of positions, in diagonals."""
