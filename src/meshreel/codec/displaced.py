"""Positions that a track moved: their bound, and a note if it hides the motion."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from meshreel.codec.config import EncoderConfig
from meshreel.codec.error_bounds import MODEL_UNITS
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.subspace.trajectories import stored_frame
from meshreel.errors import Keyword, Message
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import value_range

HIDDEN_SHARE = 0.1
"""A note reports errors of positions that exceed this share of the motion."""

MIN_ROUNDINGS = 4.0
"""Smallest bound of positions, in roundings of their largest coordinate."""


def with_bound_of_motion(config: EncoderConfig, sequence: MeshSequence) -> EncoderConfig:
    """Return options whose bound of positions also holds for the motion that a track added.

    A bound in percent then also refers to the range of the displacements, enlarged by their factor.
    """
    percent = config.bound_percent
    if percent is None or not isinstance(config, ReelOptions):
        return config
    motions = [motion for _, motion in _motions(sequence) if motion]
    if not motions:
        return config
    extent = sequence.extent
    largest = max(np.abs(extent.low).max(), np.abs(extent.high).max())
    rounding = float(np.spacing(sequence.dtype.type(largest)))
    length = max(percent / 100 * min(motions), MIN_ROUNDINGS * rounding)
    if length >= percent / 100 * stored_frame(extent).scale:
        return config
    return replace(config, bound=None, max_error=f"{length!r}{MODEL_UNITS}")


def motion_notes(sequence: MeshSequence, error: float) -> list[Note]:
    """Return a note if an error of positions, in model units, hides the motion by a track."""
    for name, motion in _motions(sequence):
        if error > HIDDEN_SHARE * motion > 0:
            text = Message(
                f"positions are off by up to {error:.3g}, and {name} moves them by {motion:.3g}: "
                "enlarge the motion (",
                Keyword("displace", f"{name}:{10 ** np.ceil(np.log10(error / motion) + 1):g}"),
                "), or set ",
                Keyword("bound"),
                f", which bounds the motion too; the track {name} has an error bound of its own",
            )
            return [Note(NoteKind.RESULT, "displacement", text=text)]
    return []


def _motions(sequence: MeshSequence) -> Iterator[tuple[str, float]]:
    """Yield the track that moved each segment, and the diagonal of the range of its motion."""
    for segment in sequence.segments:
        name, factor = segment.surface.displaced_by or ("", 0.0)
        if name in segment.tracks:
            low, high = map(np.nan_to_num, value_range(segment.tracks[name]))
            yield name, abs(factor) * float(np.linalg.norm(high - low))
