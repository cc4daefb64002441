"""Rigs of the frames to write, and the sizes of other files to compare them with."""

from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import ConnectivityChangeError, Keyword, MeshReelError
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import FittedRig
from meshreel.formats.save import save_part
from meshreel.model.notes import Notes, written_times
from meshreel.model.rig import Rig
from meshreel.model.rig_bounds import Bounds
from meshreel.rigging.fitting import bounds_of, fit_sequence
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource

GLTF = (".glb", ".gltf")


def fit_rig(stream: SegmentedStream, options: WriteOptions) -> FittedRig:
    """Return a rig of a stream within the error bounds of the options, and report its errors.

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
    rig = fit_sequence(
        gathered,
        written_times(stream.timing, stream.n_frames, Notes()),
        bones=None if options.rig is True else options.rig,
        bounds=bounds,
        progress=stream.progress,
    )
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


def sizes_of_alternatives(
    sequence: "AnySource",
    frames: range,
    output: Path,
    options: WriteOptions,
    rig: dict[str, Any],
    progress: Progress,
) -> dict[str, int]:
    """Return the bytes of the same frames as morph targets and as a .reel, by name.

    Morph targets have the error bound of the rig, and are for glTF outputs; a .reel has its KG
    bound. What does not meet the bound, or cannot be written, has no entry: nobody asked for it.

    Parameters
    ----------
    rig : dict of str to any
        Figures of the written rig.
    """
    sizes = {}
    bounds = rig["bounds_percent"]
    if output.suffix.lower() in GLTF:
        bound = bounds["largest"] if options.max_error is None else options.max_error
        morphs = replace(options, rig=None, kg=None, quality=None, max_error=bound)
        with TemporaryDirectory() as folder, suppress(MeshReelError, OSError, MemoryError):
            path = Path(folder) / output.name
            save_part(sequence, frames, path, options=morphs, progress=progress)
            sizes["morph targets"] = path.stat().st_size
    if isinstance(sequence, ReelFile):
        if len(frames) == sequence.n_frames:
            sizes[".reel (input)"] = sequence.size_bytes
    elif options.origin is None:
        with suppress(MeshReelError, MemoryError):
            data = encode(sequence.part(frames), kg=bounds["kg"], progress=progress)
            sizes[".reel"] = len(data)
    return sizes
