"""Measured errors of a stream, decoded and compared with its original."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.metrics.sted import sted
from meshreel.metrics.streamed import streamed_errors
from meshreel.metrics.track_errors import TrackErrors, errors_of_tracks
from meshreel.model.sequence import FrameSource
from meshreel.runtime.profiling import staged
from meshreel.runtime.progress import Count, Progress, silent

Vertices = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Achieved:
    """Errors of a stream.

    Attributes
    ----------
    sted : float or None
        None if it was not requested.
    """

    kg_error_percent: float
    max_error_percent: float
    sted: float | None
    tracks: dict[str, TrackErrors]


@staged("measuring")
def measure_stream(
    sequence: FrameSource,
    data: bytes,
    *,
    order: str,
    with_sted: bool = False,
    progress: Progress = silent,
) -> Achieved:
    """Return the errors of a stream relative to its original, measured block by block.

    Parameters
    ----------
    order : {"keep", "vertices", "drop"}
        The encoder's option: vertices whose order was dropped are matched by connectivity.
    with_sted : bool, default False
        Whether to measure STED too, which keeps all frames in memory.
    progress : callable, optional
    """
    internal = _internal(sequence, order)
    runs: list[Vertices] = []

    def pieces(reel: ReelFile) -> Iterator[tuple[int, Vertices]]:
        for start, frames in reel.pieces():
            ordered = frames if internal is None else frames[:, internal]
            if with_sted:
                runs.append(ordered)
            yield start, ordered
            progress("measuring", Count(start + len(frames), reel.n_frames, "frames"))

    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        errors = streamed_errors(sequence, pieces(reel))
        tracks: dict[str, TrackErrors] = {}
        if sequence.tracks:
            tracks = errors_of_tracks(sequence.tracks, reel.tracks, internal)
    measured_sted = None
    if with_sted:
        vertices = sequence.read(0, sequence.n_frames)
        measured_sted = sted(vertices, np.concatenate(runs), sequence.faces).sted
    return Achieved(errors.kg_error_percent, errors.max_error_percent, measured_sted, tracks)


@staged("measuring")
def measure_tracks(sequence: FrameSource, data: bytes, *, order: str) -> dict[str, TrackErrors]:
    """Return the errors of the tracks of a stream; parameters as in `measure_stream`."""
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        return errors_of_tracks(sequence.tracks, reel.tracks, _internal(sequence, order))


def _internal(sequence: FrameSource, order: str) -> Integers | None:
    """Return the decoded number of each vertex; None if the order is kept."""
    if order != "drop":
        return None
    connectivity = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
    return np.argsort(connectivity.internal_to_given)
