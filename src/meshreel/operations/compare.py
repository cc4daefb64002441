"""Errors of a decoded animation relative to its original."""

from dataclasses import replace

from meshreel.codec.dropped_order import MATCHED, match_order
from meshreel.formats.options import Reading
from meshreel.formats.supported_options import check_supported
from meshreel.metrics.compare import Quality, measure_quality
from meshreel.metrics.surface_distance import SurfaceQuality
from meshreel.model.notes import Notes
from meshreel.operations.inputs import AnyInput, check_inputs, chosen_frames, loaded

MAX_CODING_PERCENT = 10.0
"""Larger differences, in percent of the diagonal, are not coding errors."""


def compare(
    original: AnyInput,
    decoded: AnyInput,
    reading: Reading,
    notes: Notes,
    *,
    frames: slice | None = None,
    surface: bool | None = None,
    n_samples: int | None = None,
) -> Quality | SurfaceQuality:
    """Measure a decoded animation; parameters, result and errors as of `meshreel.compare`.

    Parameters
    ----------
    reading : Reading
        Options for both files, but an animation is that of the original.
    notes : Notes
        Receives notes on vertices that were matched, on differences that are not of coding, and on
        frames that do not exist.
    frames : slice, optional
        The frames of both to compare. Default: all.
    """
    check_inputs([original, decoded])
    check_supported([original, decoded], replace(reading, animation=None))
    check_supported([original], Reading(animation=reading.animation))
    first, second = loaded(original, reading), loaded(decoded, replace(reading, animation=None))
    first, second, is_matched = match_order(first, second)
    if is_matched:
        notes.changed(MATCHED)
    if frames is not None:
        first, second = (
            sequence.part(chosen_frames(frames, sequence.n_frames, notes))
            for sequence in (first, second)
        )
    quality = measure_quality(
        first, second, surface=surface, n_samples=n_samples, progress=reading.progress
    )
    if isinstance(quality, Quality) and quality.max_error_percent > MAX_CODING_PERCENT:
        notes.result(
            f"vertices differ by up to {quality.max_error_percent:.3g} % of the diagonal, more "
            "than coding explains; check that axes (y-up, z-up), unit and position are equal"
        )
    return quality
