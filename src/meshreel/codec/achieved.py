"""Measured errors of a stream, decoded and compared with its original."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Vertices
from meshreel.codec.bitstream.layout import Order
from meshreel.codec.dropped_order import internal_numbers
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.surface.payloads import surface_in_order
from meshreel.codec.surface.uv_grid import has_uvs, is_quantized
from meshreel.errors import SolverError
from meshreel.metrics.normals import normal_angles
from meshreel.metrics.position_errors import ErrorSums, add_blocks
from meshreel.metrics.reference import reference_of_extent
from meshreel.metrics.sted import LocalSted
from meshreel.metrics.track_errors import TrackErrors, errors_of_tracks, joined_errors
from meshreel.model.extent import Extent
from meshreel.model.frame_choice import evenly_spaced
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import Domain
from meshreel.runtime.progress import Count, Progress, silent

SHAPE_FRAMES = 10
"""Number of evenly spaced frames in which normals and edges are compared; all frames would take
longer than encoding."""


@dataclass(frozen=True)
class Achieved:
    """Errors of a stream relative to its original."""

    kg_error_percent: float
    max_error_percent: float
    tracks: dict[str, TrackErrors]
    normal_angle_mean_deg: float | None = None
    """Mean angle between normals of faces. None if it was not requested."""
    sted_spatial: float | None = None
    """Spatial part of STED, close to STED. None if it was not requested."""
    n_shape_frames: int = 0
    """Number of frames of which the last two are the means."""


def measure_stream(
    sequence: MeshSequence,
    data: bytes,
    *,
    with_shape: bool = False,
    extent: Extent | None = None,
    progress: Progress = silent,
) -> Achieved:
    """Return the errors of a stream relative to its original, measured block by block.

    Parameters
    ----------
    with_shape : bool, default False
        Whether to measure normals and edges too.
    extent : Extent, optional
        Extent whose diagonal errors are relative to. Default: that of the original.
    """
    reference = reference_of_extent(extent or sequence.extent)
    sums = ErrorSums(reference)
    tracks: dict[str, list[TrackErrors]] = {}
    segments = sequence.segments
    n_frames, first_frame = sequence.n_frames, 0
    shape_frames = evenly_spaced(n_frames, SHAPE_FRAMES if with_shape else 0)
    angles: list[float] = []
    stretches: list[float] = []
    for number, segment in enumerate(segments):

        def decoded_blocks(
            reel: ReelFile,
            internal: Integers | None,
            first: int = first_frame,
            segment: FrameSource = segment,
        ) -> Iterator[Vertices]:
            local = None
            for start, frames in reel.pieces():
                reordered = frames if internal is None else frames[:, internal]
                for index in range(len(reordered)):
                    if first + start + index in shape_frames:
                        original = segment.read(start + index, start + index + 1)
                        pair = original, reordered[index : index + 1]
                        angles.append(normal_angles(*pair, segment.faces).mean_deg)
                        local = local or LocalSted(segment.faces, segment.n_verts)
                        stretches.append(local.mean(*pair, reference))
                yield reordered
                progress("measuring", Count(first + start + len(frames), n_frames, "frames"))

        progress("measuring", Count(first_frame, n_frames, "frames"))
        with ReelFile(BytesIO(data), memory=OWN_STREAM, segment=number) as reel:
            is_dropped = reel.order == "drop"
            numbers = internal_numbers(segment) if is_dropped else {}
            add_blocks(sums, segment, decoded_blocks(reel, numbers.get(Domain.VERTEX)))
            for name, errors in errors_of_tracks(segment.tracks, reel.tracks, numbers).items():
                tracks.setdefault(name, []).append(errors)
        first_frame += segment.n_frames
    position_errors = sums.errors
    return Achieved(
        position_errors.kg_error_percent,
        position_errors.max_error_percent,
        {name: joined_errors(track_errors) for name, track_errors in tracks.items()},
        sum(angles) / len(angles) if angles else None,
        sum(stretches) / len(stretches) if stretches else None,
        len(angles),
    )


def measure_tracks(sequence: FrameSource, data: bytes) -> dict[str, TrackErrors]:
    """Return the errors of the tracks of a stream; parameters as in `measure_stream`."""
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        is_dropped = reel.order == "drop"
        numbers = internal_numbers(sequence) if is_dropped else {}
        return errors_of_tracks(sequence.tracks, reel.tracks, numbers)


def require_exact(sequence: FrameSource, data: bytes) -> None:
    """Compare the lossless positions and tracks of a stream with its original, bit for bit.

    Raises
    ------
    SolverError
        If they differ.
    """
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        numbers = internal_numbers(sequence) if reel.order == "drop" else {}
        pairs: dict[str, Any] = {"positions": (sequence, reel)} if reel.method == LOSSLESS else {}
        pairs |= {
            f"values of track {name!r}": (sequence.tracks[name], track)
            for name, track in reel.tracks.items()
            if track.is_exact
        }
        for start, stop in pairwise(reel.block_starts):
            for name, (original, decoded) in pairs.items():
                values = decoded.read(start, stop)
                order = numbers.get(getattr(decoded, "domain", Domain.VERTEX))
                require_same_bits(
                    name,
                    original.read(start, stop),
                    values if order is None else values.take(order, axis=1),
                )


def require_same_bits(name: str, original: npt.NDArray[Any], decoded: npt.NDArray[Any]) -> None:
    """Raise SolverError unless arrays have the same type, shape and bits."""
    is_alike = (original.dtype, original.shape) == (decoded.dtype, decoded.shape)
    bits, bits_hat = (np.ascontiguousarray(array).view(np.uint8) for array in (original, decoded))
    if not (is_alike and np.array_equal(bits, bits_hat)):
        raise SolverError(
            f"{name} do not decode bit for bit; nothing is written; please report the input"
        )


def measure_uvs(sequence: MeshSequence, data: bytes) -> float | None:
    """Return the largest error of a texture coordinate of a stream, in widths of the texture.

    None without texture coordinates.

    Parameters
    ----------
    sequence : MeshSequence
        The original, with its complete surface.
    """
    largest = []
    for number, segment in enumerate(sequence.segments):
        if not has_uvs(segment.surface):
            continue
        opened = whole_stream(data, segment=number)
        internal = np.arange(segment.n_verts)
        if opened.order_kept is Order.DROP:
            internal = np.argsort(internal_numbers(segment)[Domain.VERTEX])
        surface = surface_in_order(
            segment.surface, opened.order_kept, segment.faces, opened.file.faces, internal
        )
        for uv, uv_hat in zip(surface.attributes, opened.surface.attributes, strict=True):
            if is_quantized(uv):
                errors = uv_hat.per_item().astype(np.float64) - uv.per_item()
                largest.append(float(np.abs(errors[np.isfinite(errors)]).max(initial=0)))
    return max(largest, default=None)
