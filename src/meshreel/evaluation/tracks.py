"""Comparison of a track in our codec with array compressors, at equal largest error."""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from io import BytesIO
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.track_bounds import DROP, EXACT, Measure, bound_of_track
from meshreel.errors import InvalidInputError
from meshreel.evaluation.comparison import (
    METHOD,
    CodecResults,
    Comparison,
    Error,
    Kind,
    codec_run,
    peer_run,
    seconds_table,
)
from meshreel.evaluation.peers import TrackPeer
from meshreel.evaluation.track_peers import TRACK_PEERS
from meshreel.metrics.track_errors import error_unit, track_errors
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Domain
from meshreel.model.tracks import (
    Track,
    TrackKind,
    TrackSource,
    describe_track,
    track_by_name,
    value_range,
)
from meshreel.rendering.documents import NONE, Paragraph, Part, Table, significant
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Result, Run, done
from meshreel.studies.study import Subject
from meshreel.studies.timing import seconds_of, timed

PERCENT, QUICK_PERCENT = (3.0, 1.0, 0.3, 0.1, 0.03, 0.01), (1.0, 0.1, 0.01)
DEG, QUICK_DEG = (4.0, 2.0, 1.0, 0.5, 0.25, 0.1), (2.0, 0.5)
BITS, QUICK_BITS = (4, 5, 6, 8, 10, 12), (6, 8)
EXACTLY = "exact"

OURS = "reel"

MAX_TRIES = 10
CLOSE_ENOUGH = 0.98
"""The search ends at an error above this fraction of the bound."""

MAX_STRIDE = 8.0
"""Largest factor by which a search step changes the tolerance."""


def kind_of(name: str = "", unit: str = "") -> Kind:
    """What is compared, for a track of this name and unit of errors."""
    suffix = f", {unit}" if unit else ""
    return Kind(
        title="A track compared with array compressors: rate, distortion, time",
        rate="bits_per_number",
        rate_name="bits per number",
        errors=(Error("largest_error", "largest error", f"largest error of {name}{suffix}"),),
        columns={
            "bits per number": "bits_per_number",
            f"largest error{suffix}": "quality.largest_error",
            f"RMS error{suffix}": "quality.rms_error",
            "order of vertices": "order",
        },
        caption="Bits of the track alone, per number.",
        methodology=(
            "**Rate.** Bytes of the track alone, per number. Our track is part of a file with "
            "positions and faces, from which it is predicted; these are not counted but listed "
            "separately.",
            "**Largest error.** Distance of a value from its original: the length of the "
            "difference; for normals the angle; for colors the largest difference of a channel. "
            "Percentages refer to the range of the track; for vectors, to the diagonal of the "
            "bounding box of all values.",
            "**Equal largest error.** Our codec receives the error bound directly. The others "
            "receive the coarsest tolerance that keeps the same bound, found by search with their "
            "decoders: several have smaller errors than their tolerance.",
            "**Order.** The others receive the values of vertices in the original order or in the "
            "order of meshreel's coded connectivity, whichever takes fewer bytes; the order is not "
            "counted.",
            "**Our seconds.** Our encoding time is that of a file with the track minus that of one "
            "without; our decoding time is that of the track alone.",
        ),
    )


def compare_track(
    name: str, peers: Sequence[TrackPeer] = TRACK_PEERS, *, quick: bool = False
) -> Comparison:
    """Compare a track of this name, the same in all sequences, with array compressors.

    Running it raises InvalidInputError if a sequence lacks the track.
    """

    def runs(sequence: MeshSequence) -> list[Run]:
        source = TrackInput(with_track_alone(sequence, name), name)
        return track_runs(source, levels_of(source.track, quick=quick), peers)

    def results(subject: Subject, measured: list[Result]) -> CodecResults:
        track = subject.sequence.tracks[name]
        about = {
            **identity_of(name, track),
            "described": describe_track(track),
            "shape": list(track.shape),
            "error_unit": error_unit(track),
            "raw_bytes": track.values.nbytes,
            "positions_bytes": next(
                (run["positions_bytes"] for run in done(measured) if run["codec"] == OURS), None
            ),
        }
        text = f"`{name}` is {about['described']}: {about['raw_bytes']:,} bytes uncompressed."
        if about["positions_bytes"] is not None:
            text += f" Positions, faces and order take another {about['positions_bytes']:,} bytes."
        about["text"] = text
        kind = kind_of(name, about["error_unit"])
        return CodecResults(kind, subject.slug, subject.store.sequence, measured, [], about)

    return Comparison(kind_of(), runs, results, peers, track_tables)


def track_tables(results: CodecResults) -> list[Part]:
    """Tables of sizes at equal error, and of seconds."""
    missing = Paragraph("'-': the codec has no result; the reason is listed below.")
    return [size_table(results), missing, seconds_table(results)]


def size_table(results: CodecResults) -> Table:
    """Bytes of each codec at each error bound, and the ratio of ours to the best of the others."""
    levels = list(dict.fromkeys(result["params"] for result in results.measured))
    sizes: dict[str, dict[str, int]] = {}
    for result in done(results.measured):
        sizes.setdefault(result["codec"], {})[result["params"]] = result["size_bytes"]
    rows = [
        (codec, *(f"{of[level]:,}" if level in of else NONE for level in levels))
        for codec, of in sizes.items()
    ]
    ours, others = sizes.pop(OURS, {}), sizes.values()
    best = {
        level: min((of.get(level, np.inf) for of in others), default=np.inf) for level in levels
    }
    ratios = [ours[level] / best[level] if level in ours else 0.0 for level in levels]
    if any(ratios):
        cells = (significant(ratio or None) for ratio in ratios)
        rows.append((f"{OURS} / best of the others", *cells))
    title = f"Bytes of the track at equal largest error, {results.name}"
    return Table(title, ("codec", *map(_level_text, levels)), tuple(rows))


def _level_text(level: str) -> str:
    """Text such as "0.1 %" or "0.5 deg"."""
    if level == EXACTLY:
        return level
    digits = level.rstrip("%abcdefghijklmnopqrstuvwxyz")
    return f"{digits} {level[len(digits) :]}"


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


def with_track_alone(sequence: MeshSequence, name: str) -> MeshSequence:
    """The sequence without its other tracks.

    Raises
    ------
    InvalidInputError
        If it lacks the track.
    """
    return sequence.replace(tracks={name: track_by_name(sequence.tracks, name)})


def identity_of(name: str, track: Track) -> dict[str, Any]:
    """Name and a hash of the values."""
    digest = hashlib.sha256(f"{describe_track(track)} {track.shape}".encode())
    digest.update(track.values.tobytes())
    return {"name": name, "sha256": digest.hexdigest()}


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
    def without(self) -> tuple[int, Floats]:
        """Bytes of the stream without the track, and seconds to encode it on both clocks."""
        data, seconds = timed(lambda: encode(self.sequence, tracks={self.name: "drop"}))
        return len(data), np.median(seconds, axis=0)

    @cached_property
    def order(self) -> npt.NDArray[np.int64] | None:
        """Vertex order of the coded connectivity; None for tracks of faces and corners."""
        if self.track.domain is not Domain.VERTEX:
            return None
        sequence = self.sequence
        coded = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
        return coded.internal_to_given


def track_runs(
    source: TrackInput, levels: Sequence[Level], peers: Sequence[TrackPeer]
) -> list[Run]:
    """The runs of our codec at all levels, then those of the available peers."""
    track = identity_of(source.name, source.track)
    ours = {"kind": METHOD, "method": OURS, "track": track}
    return [
        codec_run(OURS, level.text, ours | {"level": level.text}, partial(_ours, source, level))
        for level in levels
    ] + [
        peer_run(
            peer, level.text, partial(measure_peer, source, peer, level), track=track,
            level=level.text,
        )
        for peer in peers
        if peer.package.is_available
        for level in levels
    ]  # fmt: skip


def _ours(source: TrackInput, level: Level, progress: Progress) -> dict[str, Any]:
    """Measure our codec; positions use default options and are not counted."""
    sequence, name = source.sequence, source.name
    data, encode_s = timed(lambda: encode(sequence, tracks={name: level.text}, progress=progress))
    n_without, without_s = source.without
    values, decode_s = timed(lambda: _decode_track(data, name))
    size = info(data).tracks[0].size_bytes
    return {
        **_figures(source.track, level, values, size),
        "positions_bytes": n_without,
        "seconds": seconds_of(np.maximum(encode_s - without_s, 0.0), decode_s),
    }


def _decode_track(data: bytes, name: str) -> Values:
    with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
        return reel.track(name)[:]


def measure_peer(
    source: TrackInput, peer: TrackPeer, level: Level, progress: Progress
) -> dict[str, Any]:
    """Measure a peer with the coarsest tolerance that keeps the error bound.

    Raises
    ------
    InvalidInputError
        If it cannot keep the error bound.
    """
    if not level.limit and not peer.is_reversible:
        raise InvalidInputError("it has no lossless mode")
    track, n_tries = source.track, 0
    first = float(np.radians(level.limit) if track.kind is TrackKind.NORMAL else level.limit)
    order = _smaller_order(source, peer, first)
    if order is not None:
        track = Track(track.values[:, order], track.domain, track.kind, track.unit)

    def largest_error(tolerance: float) -> float:
        nonlocal n_tries
        progress("finding the tolerance", n_tries / MAX_TRIES)
        n_tries += 1
        data = peer.encode(track.values, tolerance)
        values = peer.decode(data, track.shape, track.dtype)
        return track_errors(track, Track(values, track.domain)).largest

    tolerance = 0.0
    if level.limit:
        tolerance = coarsest_tolerance(largest_error, level.limit, first, peer.grain)
    data, encode_s = timed(lambda: peer.encode(track.values, tolerance))
    values, decode_s = timed(lambda: peer.decode(data, track.shape, track.dtype))
    figures = _figures(track, level, values, len(data))
    if not figures["quality"]["largest_error"] <= level.limit:
        raise InvalidInputError("its lossless mode changes some numbers")
    return {
        **figures,
        "tolerance": tolerance,
        "order": "given" if order is None else "coded",
        "seconds": seconds_of(encode_s, decode_s),
    }


def _figures(track: Track, level: Level, values: Values, size_bytes: int) -> dict[str, Any]:
    errors = track_errors(track, Track(values, track.domain))
    return {
        "limit": level.limit,
        "size_bytes": size_bytes,
        "bits_per_number": 8 * size_bytes / math.prod(track.shape),
        "quality": {"largest_error": errors.largest, "rms_error": errors.rms},
    }


def _smaller_order(
    source: TrackInput, peer: TrackPeer, tolerance: float
) -> npt.NDArray[np.int64] | None:
    """The coded vertex order if a peer needs fewer bytes with it, else None."""
    order, values = source.order, source.track.values
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
