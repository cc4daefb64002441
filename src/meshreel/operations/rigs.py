"""Rigs of the frames to write, and the sizes of other files to compare them with."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from meshreel.errors import ConnectivityChangeError, InvalidInputError, Keyword
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import FittedRig
from meshreel.model.notes import Notes, written_times
from meshreel.model.rig import Rig
from meshreel.model.rig_bounds import Bounds
from meshreel.rigging.fitting import bounds_of, fit_sequence, suffices_for_sample
from meshreel.runtime.counting import counted


def fit_rig(
    stream: SegmentedStream, options: WriteOptions, max_bones: int | None
) -> FittedRig | None:
    """Fit a rig as `RigFit` describes.

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
    gathered = next(stream.meshes()).gather()
    low, high = gathered.extent.low, gathered.extent.high
    diagonal = float(np.linalg.norm(high - low))
    bounds = bounds_of(
        gathered, quality=options.quality, kg=options.kg, max_error=options.max_error
    )
    _, budget = requested_budget(low, high, options, bounds.largest, consumer="the rig")
    bounds = replace(bounds, largest=100 * budget.max_added / (diagonal or 1.0))
    bones = max_bones if options.rig is True or not options.rig else options.rig
    if max_bones is not None and not suffices_for_sample(gathered, bounds, max_bones):
        return None
    times_s = written_times(stream.timing, stream.n_frames, Notes())
    try:
        rig = fit_sequence(gathered, times_s, bones=bones, bounds=bounds, progress=stream.progress)
    except InvalidInputError:
        if max_bones is None:
            raise
        return None
    stream.report({"rig": rig_figures(rig, bounds)}, describe_rig(rig))
    largest = rig.errors.largest_percent / 100 * diagonal
    stream.notes += budget.describe(largest)
    return FittedRig(rig, gathered.extent, budget.total(largest))


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
