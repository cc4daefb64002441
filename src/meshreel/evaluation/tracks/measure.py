"""Runs that measure a track in our codec or another compressor, and their error bounds."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.track_bounds import DROP, EXACT, Measure, bound_of_track
from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.protocol import package_version
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.store import Outcome, Run
from meshreel.evaluation.runs.timing import REPEATS, machine_facts, seconds_of, timed
from meshreel.evaluation.tracks.peers import TrackPeer
from meshreel.metrics.track_errors import TrackErrors, track_errors
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track, TrackKind, TrackSource, value_range
from meshreel.runtime.progress import Progress

QUICK_PERCENT, PERCENT = (1.0, 0.1, 0.01), (3.0, 1.0, 0.3, 0.1, 0.03, 0.01)
QUICK_DEG, DEG = (2.0, 0.5), (4.0, 2.0, 1.0, 0.5, 0.25, 0.1)
QUICK_BITS, BITS = (6, 8), (4, 5, 6, 8, 10, 12)
EXACTLY = "exact"

OURS = "reel"

MAX_TRIES = 10
CLOSE_ENOUGH = 0.98
"""The search ends at an error above this fraction of the bound."""

MAX_STRIDE = 8.0
"""Largest factor by which a search step changes the tolerance."""


@dataclass(frozen=True)
class Level:
    """An error bound for all codecs.

    Attributes
    ----------
    text : str
        As for `--track NAME=` of `meshreel encode`.
    limit : float
        Largest error of a value, in the unit of `meshreel.compare`; 0 is lossless.
    """

    text: str
    limit: float


def levels_of(track: TrackSource, *, quick: bool) -> list[Level]:
    """The levels for a track, from coarse to fine; integers are coded only exactly."""
    texts: list[str] = []
    if track.dtype.kind != "f":
        pass
    elif track.kind is TrackKind.NORMAL:
        texts = [f"{angle:g}deg" for angle in (QUICK_DEG if quick else DEG)]
    elif track.kind is TrackKind.COLOR:
        texts = [f"{bits}bit" for bits in (QUICK_BITS if quick else BITS)]
    else:
        texts = [f"{share:g}%" for share in (QUICK_PERCENT if quick else PERCENT)]
    levels = [level_of(text, track) for text in texts]
    return [*(level for level in levels if level.limit > 0), Level(EXACTLY, 0.0)]


def level_of(text: str, track: TrackSource) -> Level:
    """Parse a bound for a track.

    Parameters
    ----------
    text : str
        As for `meshreel.codec.track_bounds.bound_of_track`, except "drop".

    Raises
    ------
    InvalidInputError
        If the bound is invalid for the track.
    """
    bound = bound_of_track(text, "", track)
    if bound == DROP:
        raise InvalidInputError("a track that is dropped cannot be measured; give it a bound")
    if bound == EXACT:
        return Level(EXACTLY, 0.0)
    if bound.measure is not Measure.SHARE:
        return Level(text, bound.amount)
    low, high = np.nan_to_num(value_range(track))
    return Level(text, bound.amount / 100 * float(np.linalg.norm(high - low)))


@dataclass(frozen=True, eq=False)
class TrackInput:
    """A sequence and the name of the track to measure."""

    sequence: MeshSequence
    name: str

    @property
    def track(self) -> Track:
        """The track."""
        track: Track = self.sequence.tracks[self.name]
        return track

    @cached_property
    def without(self) -> tuple[int, float]:
        """Bytes and encoding seconds of the stream without the track."""
        data, seconds = timed(lambda: encode(self.sequence, tracks={self.name: "drop"}), REPEATS)
        return len(data), statistics.median(seconds)

    @cached_property
    def order(self) -> npt.NDArray[np.int64] | None:
        """Vertex order of the coded connectivity; None for tracks of faces and corners."""
        if self.track.domain is not Domain.VERTEX:
            return None
        sequence = self.sequence
        coded = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
        return coded.internal_to_given


def our_run(track_input: TrackInput, level: Level, identity: dict[str, Any]) -> Run:
    """A run of our codec; positions use default options and are not counted."""
    return Run(
        name=f"{OURS} {level.text}",
        key=file_name(f"{track_input.name} {OURS} {level.text}"),
        setting={"kind": "track", "codec": OURS, "level": level.text, "track": identity},
        measure=lambda progress: _measure_ours(track_input, level, progress),
        facts={"codec": OURS, "level": level.text, "limit": level.limit},
    )


def peer_run(
    track_input: TrackInput, peer: TrackPeer, level: Level, identity: dict[str, Any]
) -> Run:
    """A run of a peer with the coarsest tolerance that keeps the error bound."""
    about = {"codec": peer.name, "summary": peer.summary, "version": package_version(peer)}
    return Run(
        name=f"{peer.name} {level.text}",
        key=file_name(f"{track_input.name} {peer.name} {level.text}"),
        setting={"kind": "track peer", "level": level.text, "track": identity, **about},
        measure=lambda progress: Outcome(measure_peer(track_input, peer, level, progress)),
        facts={"codec": peer.name, "level": level.text, "limit": level.limit},
        is_foreign=True,
    )


def _measure_ours(track_input: TrackInput, level: Level, progress: Progress) -> Outcome:
    sequence, name = track_input.sequence, track_input.name
    data, encode_s = timed(
        lambda: encode(sequence, tracks={name: level.text}, progress=progress), REPEATS
    )
    n_without, without_s = track_input.without
    values, decode_s = timed(lambda: _decode_track(data, name), REPEATS)
    figures = {
        "size_bytes": info(data).tracks[0].size_bytes,
        "positions_bytes": n_without,
        "seconds": seconds_of([max(seconds - without_s, 0.0) for seconds in encode_s], decode_s),
        **_errors(track_input.track, values),
    }
    return Outcome(figures)


def _decode_track(data: bytes, name: str) -> Values:
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        return reel.track(name)[:]


def measure_peer(
    track_input: TrackInput, peer: TrackPeer, level: Level, progress: Progress
) -> dict[str, Any]:
    """Measure a peer: bytes, errors, seconds, tolerance and vertex order.

    Raises
    ------
    InvalidInputError
        If it cannot keep the error bound.
    """
    if not level.limit and not peer.is_reversible:
        raise InvalidInputError("it has no lossless mode")
    track, n_tries = track_input.track, 0
    first = np.radians(level.limit) if track.kind is TrackKind.NORMAL else level.limit
    order = _smaller_order(track_input, peer, float(first))
    if order is not None:
        track = Track(track.values[:, order], track.domain, track.kind, track.unit)

    def largest_error(tolerance: float) -> float:
        nonlocal n_tries
        progress("finding the tolerance", n_tries / MAX_TRIES)
        n_tries += 1
        data = peer.encode(track.values, tolerance)
        return _errors_of(track, peer.decode(data, track.shape, track.dtype)).largest

    tolerance = 0.0
    if level.limit:
        tolerance = coarsest_tolerance(largest_error, level.limit, float(first), peer.grain)
    data, encode_s = timed(lambda: peer.encode(track.values, tolerance), REPEATS)
    values, decode_s = timed(lambda: peer.decode(data, track.shape, track.dtype), REPEATS)
    figures = {
        "size_bytes": len(data),
        "tolerance": tolerance,
        "order": "given" if order is None else "coded",
        "seconds": seconds_of(encode_s, decode_s),
        **_errors(track, values),
    }
    if not figures["largest_error"] <= level.limit:
        raise InvalidInputError("its lossless mode changes some numbers")
    return figures


def _smaller_order(
    track_input: TrackInput, peer: TrackPeer, tolerance: float
) -> npt.NDArray[np.int64] | None:
    """The coded vertex order if a peer needs fewer bytes with it, else None."""
    order, values = track_input.order, track_input.track.values
    if order is None:
        return None
    coded = len(peer.encode(values[:, order], tolerance))
    return order if coded < len(peer.encode(values, tolerance)) else None


def coarsest_tolerance(
    largest_error: Callable[[float], float], limit: float, first: float, grain: float
) -> float:
    """Search for the coarsest tolerance whose largest error is within a limit.

    Parameters
    ----------
    largest_error : callable
        Returns the largest error at a tolerance.
    limit : float
        Above 0.
    first : float
        First tolerance to try.
    grain : float
        Tolerances whose ratio is below this are equivalent.

    Raises
    ------
    InvalidInputError
        If `MAX_TRIES` tolerances are all too coarse.
    """
    valid, too_coarse, tolerance = 0.0, np.inf, first
    for _ in range(MAX_TRIES):
        error = largest_error(tolerance)
        if error <= limit:
            valid = max(valid, tolerance)
            if error >= CLOSE_ENOUGH * limit:
                break
            # Some codecs round tolerances and cannot come closer than a grain.
            tolerance *= min(max(limit / error if error else MAX_STRIDE, grain), MAX_STRIDE)
        else:
            too_coarse = min(too_coarse, tolerance)
            tolerance *= max(limit / error, 1 / MAX_STRIDE) / grain
        if too_coarse <= valid * grain:
            break
        if valid and not valid < tolerance < too_coarse:
            tolerance = float(np.sqrt(valid * too_coarse))
    if not valid:
        raise InvalidInputError(f"no tolerance keeps errors below {limit:g}")
    return valid


def _errors_of(track: Track, values: Values) -> TrackErrors:
    return track_errors(track, Track(values, track.domain))


def _errors(track: Track, values: Values) -> dict[str, Any]:
    errors = _errors_of(track, values)
    return {
        "largest_error": errors.largest,
        "rms_error": errors.rms,
        "machine": machine_facts(),
    }
