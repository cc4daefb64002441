"""Rigs of the animations that writers receive, and sentences on them."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import ConnectivityChangeError, InvalidInputError, Keyword
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.model.rig import Rig
from meshreel.model.rig_bounds import Bounds
from meshreel.model.sequence import MeshSequence
from meshreel.rigging.fitting import bounds_of, fit_sequence
from meshreel.runtime.counting import counted


def is_rigged(options: WriteOptions) -> bool:
    """Return whether a rig is to be written.

    Raises
    ------
    InvalidInputError
        If another option has no effect with this choice.
    """
    if not options.rig:
        for name in ("kg", "quality"):
            if getattr(options, name) is not None:
                raise InvalidInputError(
                    Keyword(name), " is a bound of rigs; add ", Keyword("rig"), ", or omit it"
                )
        return False
    return True


def rig_of(
    stream: SegmentedStream, options: WriteOptions, times_s: Floats
) -> tuple[MeshSequence, Rig, float | None]:
    """Return the frames of a stream, a rig within the error bounds, and its total error.

    The notes gain its errors. The total is relative to the original, as of `ErrorBudget.total`.

    Raises
    ------
    ConnectivityChangeError
        If the faces change.
    InvalidInputError
        As `meshreel.rigging.fitting.fit_sequence`.
    """
    if stream.n_segments > 1:
        raise ConnectivityChangeError(
            f"a rig needs the same faces in all frames; got {stream.n_segments} segments; register "
            "the frames first (meshreel register), or write morph targets (omit ",
            Keyword("rig"),
            ")",
        )
    [sequence] = [segment.gather() for segment in stream.segments()]
    low, high = sequence.extent.low, sequence.extent.high
    diagonal = float(np.linalg.norm(high - low))
    bounds = bounds_of(
        sequence, quality=options.quality, kg=options.kg, max_error=options.max_error
    )
    _, budget = requested_budget(low, high, options, bounds.largest, consumer="the rig")
    bounds = replace(bounds, largest=100 * budget.max_added / (diagonal or 1.0))
    rig = fit_sequence(
        sequence,
        times_s,
        bones=None if options.rig is True else options.rig,
        bounds=bounds,
        progress=stream.progress,
    )
    stream.report({"rig": rig_figures(rig, bounds)}, describe_rig(rig))
    largest = rig.errors.largest_percent / 100 * diagonal
    stream.notes += budget.describe(largest)
    return sequence, rig, budget.total(largest)


def rig_figures(rig: Rig, bounds: Bounds) -> dict[str, Any]:
    """Return the size, the errors and the error bounds of a rig, for tables and JSON."""
    return {
        "n_bones": rig.n_bones,
        "n_targets": rig.n_targets,
        **asdict(rig.errors),
        "bounds_percent": asdict(bounds),
    }


def describe_rig(rig: Rig) -> str:
    """Return a sentence with the size and the errors of a rig."""
    correctives = f" and {counted(rig.n_targets, 'corrective target')}" if rig.n_targets else ""
    errors = rig.errors
    return (
        f"the rig has {counted(rig.n_bones, 'bone')}{correctives}: KG error "
        f"{errors.kg_percent:.3g} %, largest error {errors.largest_percent:.3g} % of the diagonal, "
        f"mean error of face normals {errors.normal_deg:.2g} degrees"
    )
