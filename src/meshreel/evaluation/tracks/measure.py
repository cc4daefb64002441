"""Encode, decode, measure a track: by our codec or by a peer, within a largest error."""

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
from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.protocol import package_version
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.machine import machine_facts
from meshreel.evaluation.runs.run import Outcome, Run
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.evaluation.tracks.peers import TrackPeer
from meshreel.evaluation.tracks.settings import Level
from meshreel.metrics.track_errors import TrackErrors, track_errors
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track, TrackKind
from meshreel.runtime.progress import Progress

OURS = "reel"

MOST_TRIES = 10
NEAR = 0.98
"""A peer is near enough to the largest error that it may make."""

STRIDE = 8.0
"""Most by which a tolerance is changed at once."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A sequence with the one track that is measured.

    Parameters
    ----------
    name : str
        Of the track.
    """

    sequence: MeshSequence
    name: str

    @property
    def track(self) -> Track:
        """The track."""
        return self.sequence.tracks[self.name]

    @cached_property
    def without(self) -> tuple[int, float]:
        """Bytes of the stream without the track, and seconds of encoding that."""
        data, seconds = timed(lambda: encode(self.sequence, tracks={self.name: "drop"}), REPEATS)
        return len(data), statistics.median(seconds)

    @cached_property
    def order(self) -> npt.NDArray[np.int64] | None:
        """Vertices in the order of the coded connectivity; None for faces and corners."""
        if self.track.domain is not Domain.VERTEX:
            return None
        sequence = self.sequence
        coded = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
        return coded.internal_to_given


def our_run(measured: Measured, level: Level, identity: dict[str, Any]) -> Run:
    """The run of our codec; positions are as by default, and not counted."""
    return Run(
        name=f"{OURS} {level.text}",
        key=file_name(f"{measured.name} {OURS} {level.text}"),
        setting={"kind": "track", "codec": OURS, "level": level.text, "track": identity},
        measure=lambda progress: _measure_ours(measured, level, progress),
        facts={"codec": OURS, "level": level.text, "limit": level.limit},
    )


def peer_run(measured: Measured, peer: TrackPeer, level: Level, identity: dict[str, Any]) -> Run:
    """The run of a peer, with the coarsest tolerance that keeps the largest error."""
    about = {"codec": peer.name, "summary": peer.summary, "version": package_version(peer)}
    return Run(
        name=f"{peer.name} {level.text}",
        key=file_name(f"{measured.name} {peer.name} {level.text}"),
        setting={"kind": "track peer", "level": level.text, "track": identity, **about},
        measure=lambda progress: Outcome(measure_peer(measured, peer, level, progress)),
        facts={"codec": peer.name, "level": level.text, "limit": level.limit},
        is_foreign=True,
    )


def _measure_ours(measured: Measured, level: Level, progress: Progress) -> Outcome:
    sequence, name = measured.sequence, measured.name
    data, encode_s = timed(
        lambda: encode(sequence, tracks={name: level.text}, progress=progress), REPEATS
    )
    n_without, without_s = measured.without
    values, decode_s = timed(lambda: _decoded(data, name), REPEATS)
    figures = {
        "size_bytes": info(data).tracks[0].size_bytes,
        "positions_bytes": n_without,
        "seconds": seconds_of([max(one - without_s, 0.0) for one in encode_s], decode_s),
        **_errors(measured.track, values),
    }
    return Outcome(figures)


def _decoded(data: bytes, name: str) -> Values:
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        return reel.track(name)[:]


def measure_peer(
    measured: Measured, peer: TrackPeer, level: Level, progress: Progress
) -> dict[str, Any]:
    """Figures of a peer: bytes, errors, seconds, its tolerance, and the order it is given.

    Raises
    ------
    InvalidInputError
        If it does not keep the largest error.
    """
    if not level.limit and not peer.is_reversible:
        raise InvalidInputError("it has no mode that gives every number back")
    track, progressed = measured.track, 0
    first = np.radians(level.limit) if track.kind is TrackKind.NORMAL else level.limit
    order = _smaller_order(measured, peer, float(first))
    given = track if order is None else _with_values(track, track.values[:, order])

    def largest_error(tolerance: float) -> float:
        nonlocal progressed
        progress("finding the tolerance", progressed / MOST_TRIES)
        progressed += 1
        data = peer.encode(given.values, tolerance)
        return _apart(given, peer.decode(data, given.shape, given.dtype)).largest

    tolerance = 0.0
    if level.limit:
        tolerance = coarsest_tolerance(largest_error, level.limit, float(first), peer.grain)
    data, encode_s = timed(lambda: peer.encode(given.values, tolerance), REPEATS)
    values, decode_s = timed(lambda: peer.decode(data, given.shape, given.dtype), REPEATS)
    figures = {
        "size_bytes": len(data),
        "tolerance": tolerance,
        "order": "given" if order is None else "coded",
        "seconds": seconds_of(encode_s, decode_s),
        **_errors(given, values),
    }
    if not figures["largest_error"] <= level.limit:
        raise InvalidInputError("it does not give every number back")
    return figures


def _smaller_order(
    measured: Measured, peer: TrackPeer, tolerance: float
) -> npt.NDArray[np.int64] | None:
    """The order of vertices in which a peer needs fewer bytes: ours, or None for that given."""
    order, values = measured.order, measured.track.values
    if order is None:
        return None
    coded = len(peer.encode(values[:, order], tolerance))
    return order if coded < len(peer.encode(values, tolerance)) else None


def _with_values(track: Track, values: Values) -> Track:
    """A track of the same meaning with other values."""
    return Track(values, track.domain, track.kind, track.unit)


def coarsest_tolerance(
    largest_error: Callable[[float], float], limit: float, first: float, grain: float
) -> float:
    """The coarsest tolerance found, by which no error is above a limit.

    Parameters
    ----------
    largest_error : callable
        The largest error that a tolerance comes to.
    limit : float
        Above 0.
    first : float
        Tolerance that is tried first.
    grain : float
        Tolerances less than so many times apart are taken for the same.

    Raises
    ------
    InvalidInputError
        If `MOST_TRIES` tolerances are all too coarse.
    """
    kept, broken, tolerance = 0.0, np.inf, first
    for _ in range(MOST_TRIES):
        found = largest_error(tolerance)
        if found <= limit:
            kept = max(kept, tolerance)
            if found >= NEAR * limit:
                break
            # Rounding keeps some codecs from coming nearer than a grain.
            tolerance *= min(max(limit / found if found else STRIDE, grain), STRIDE)
        else:
            broken = min(broken, tolerance)
            tolerance *= max(limit / found, 1 / STRIDE) / grain
        if broken <= kept * grain:
            break
        if kept and not kept < tolerance < broken:
            tolerance = float(np.sqrt(kept * broken))
    if not kept:
        raise InvalidInputError(f"no tolerance was found that keeps errors below {limit:g}")
    return kept


def _apart(track: Track, values: Values) -> TrackErrors:
    """Errors of decoded values; the kind of the track says what an error is."""
    return track_errors(track, Track(values, track.domain))


def _errors(track: Track, values: Values) -> dict[str, Any]:
    errors = _apart(track, values)
    return {
        "largest_error": errors.largest,
        "rms_error": errors.rms,
        "machine": machine_facts(),
    }
