"""Encoding of a sequence in segments: one stream each, joined to one."""

from dataclasses import replace

import numpy as np

from meshreel.codec.config import EncoderConfig
from meshreel.codec.joining import join_streams
from meshreel.codec.source import Source
from meshreel.codec.subspace.trajectories import bounding_frame
from meshreel.codec.surface.uv_grid import check_uvs, has_uvs
from meshreel.codec.track_bounds import Measure, TrackBound, TrackTargets, kept_bounds
from meshreel.errors import InvalidInputError
from meshreel.model.segments import SegmentedSequence, tracks_of_all
from meshreel.model.sequence import Extent
from meshreel.model.surface_selection import Names, describe_missing, missing_everywhere, select
from meshreel.model.tracks import track_by_name, value_range
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress


def encode_segments(
    config: EncoderConfig,
    sequence: SegmentedSequence,
    attributes: Names,
    tracks: TrackTargets | None,
    progress: Progress,
    engine: Engine | None,
) -> bytes:
    """Return a stream of all segments; the options apply to the sequence as a whole.

    Errors and steps are relative to the bounding box of all frames, and percentage bounds of a
    track to its range over all segments.

    Raises
    ------
    InvalidInputError
        If no segment has an attribute or a track of a selected name, the method needs constant
        connectivity, or no stream meets the target.
    """
    progress("encoding connectivity", 0.0)
    _check_names(sequence, attributes, tracks or {})
    ranges: dict[str, float] = {}
    sources = []
    surfaces = [select(one.surface, attributes, ignore_missing=True) for one in sequence.segments]
    if config.uv_bits is not None:
        for surface in list(filter(has_uvs, surfaces)) or surfaces:
            check_uvs(surface, config.uv_bits)
    for segment, surface in zip(sequence.segments, surfaces, strict=True):
        targets = {name: one for name, one in (tracks or {}).items() if name in segment.tracks}
        bounds = kept_bounds(config, segment.tracks, targets)
        for name, bound in bounds.items():
            if bound.measure is Measure.SHARE and name not in ranges:
                ranges[name] = _range_size(sequence, name)
        source = Source(
            segment,
            config,
            surface,
            {name: _in_units(bound, ranges.get(name)) for name, bound in bounds.items()},
            whole_extent=sequence.extent,
        )
        sources.append(source)
    streams = list(config.method_row.encode_segments(sources, progress, engine))
    return join_streams(streams, name=sequence.name, start_s=sequence.start_s)


def _check_names(sequence: SegmentedSequence, attributes: Names, tracks: TrackTargets) -> None:
    """Raise InvalidInputError if no segment has an attribute or track of a name."""
    surfaces = [segment.surface for segment in sequence.segments]
    if missing := missing_everywhere(surfaces, attributes):
        raise InvalidInputError(describe_missing(surfaces[0], missing))
    all_tracks = tracks_of_all(sequence)
    for name in tracks:
        track_by_name(all_tracks, name)


def _range_size(sequence: SegmentedSequence, name: str) -> float:
    """Return the diagonal of the range of a track's values in all segments, in its units."""
    tracks = [segment.tracks[name] for segment in sequence.segments if name in segment.tracks]
    widths = {track.shape[2] for track in tracks}
    if len(widths) > 1:
        raise InvalidInputError(
            f"track {name!r} has {' and '.join(map(str, sorted(widths)))} numbers per value in "
            "different segments, which have no common range; give its bound in units"
        )
    low, high = zip(*map(value_range, tracks), strict=True)
    lowest, highest = np.fmin.reduce(low), np.fmax.reduce(high)
    return bounding_frame(Extent(np.nan_to_num(lowest), np.nan_to_num(highest), 0.0)).scale


def _in_units(bound: TrackBound, range_size: float | None) -> TrackBound:
    """Return a bound in percent of a range as one in units of the track."""
    if bound.measure is not Measure.SHARE or range_size is None:
        return bound
    return replace(bound, measure=Measure.UNITS, amount=bound.amount / 100.0 * range_size)
