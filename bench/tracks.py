"""Bytes of tracks compared with array compressors at equal largest error.

    python bench/tracks.py --vertices 10000 --frames 150
    python bench/tracks.py samba.npz
    python bench/tracks.py crash.vtkhdf --bounds 1% 0.1% 0.01% exact

Without a file: the tracks of `bench/heat_on_a_sphere.py`. With a file: its tracks, or velocities
(differences of positions) and normals of vertices if it has none. Default bounds: 0.1 % of the
range, normals 0.5 degrees. Needs `pip install '.[peers]'`; missing packages are left out.

Our bytes are those of the track in a file, without the positions from which it is predicted; our
encoding time is that of the file minus that of one without the track. The others receive the
coarsest tolerance that keeps the same bound, found by search, and the values of vertices in the
given order or in that of the coded connectivity, whichever takes fewer bytes.
"""

import argparse
import runpy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from measuring import start_table
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.track_bounds import DROP, EXACT, Measure, bound_of_track
from meshreel.errors import InvalidInputError
from meshreel.metrics.track_errors import track_errors
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.tracks import Track, TrackSource, value_range
from meshreel.studies.timing import timed
from track_peers import TRACK_PEERS, TrackPeer

SIMULATION = Path(__file__).with_name("heat_on_a_sphere.py")

MAX_TRIES = 10
CLOSE_ENOUGH = 0.98
"""The search ends at an error above this fraction of the bound."""

MAX_STRIDE = 8.0
"""Largest factor by which a search step changes the tolerance."""


def derived(plain: meshreel.MeshSequence) -> meshreel.MeshSequence:
    """A sequence with its velocities and normals as tracks."""
    fps = plain.fps or 25.0
    vertices = np.asarray(plain.vertices, np.float32)
    velocity = np.gradient(vertices, axis=0) * np.float32(fps)
    normals = np.stack([vertex_normals(frame, plain.faces) for frame in vertices])
    tracks = {
        "velocity": meshreel.Track(velocity.astype(np.float32), kind="velocity"),
        "normal": meshreel.Track(normals.astype(np.float32), kind="normal"),
    }
    return meshreel.MeshSequence(vertices, plain.faces, fps, tracks=tracks)


def limit_of(text: str, track: TrackSource) -> float:
    """Largest error of a value that a bound allows, in the unit of `meshreel.compare`; 0: exact.

    `text` is as for `bound_of_track`, except "drop".
    """
    bound = bound_of_track(text, "", track)
    if bound == DROP:
        raise InvalidInputError("a track that is dropped cannot be measured; give it a bound")
    if bound == EXACT:
        return 0.0
    if bound.measure is not Measure.SHARE:
        return bound.amount
    low, high = np.nan_to_num(value_range(track))
    return bound.amount / 100 * float(np.linalg.norm(high - low))


@dataclass(frozen=True, eq=False)
class TrackInput:
    """A sequence with only the track of this name."""

    sequence: meshreel.MeshSequence
    name: str

    @property
    def track(self) -> Track:
        """The track."""
        track: Track = self.sequence.tracks[self.name]
        return track

    @cached_property
    def without(self) -> tuple[int, float]:
        """Bytes of the stream without the track, and seconds to encode it."""
        data, seconds = timed(lambda: meshreel.encode(self.sequence, tracks={self.name: "drop"}))
        return len(data), float(np.median(seconds[:, 0]))

    @cached_property
    def order(self) -> npt.NDArray[np.int64] | None:
        """Vertex order of the coded connectivity; None for tracks of faces and corners."""
        if self.track.domain != "vertex":
            return None
        sequence = self.sequence
        coded = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
        return coded.internal_to_given


def measure_ours(source: TrackInput, bound: str) -> tuple[int, float, float]:
    """Bytes of the track, and our seconds to encode and decode it."""
    name = source.name
    data, encode_s = timed(lambda: meshreel.encode(source.sequence, tracks={name: bound}))

    def decode() -> npt.NDArray[Any]:
        with meshreel.ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
            return np.asarray(reel.track(name)[:])

    _, decode_s = timed(decode)
    encode_alone = max(0.0, float(np.median(encode_s[:, 0])) - source.without[1])
    return meshreel.info(data).tracks[0].size_bytes, encode_alone, float(np.median(decode_s[:, 0]))


def peer_bytes(source: TrackInput, peer: TrackPeer, limit: float) -> int:
    """Bytes that a peer needs with the coarsest tolerance that keeps the limit.

    Raises
    ------
    InvalidInputError
        If it cannot keep the limit.
    """
    if not limit and not peer.is_reversible:
        raise InvalidInputError("it has no lossless mode")
    track = source.track
    first = float(np.radians(limit) if track.kind == "normal" else limit)
    if source.order is not None:
        ordered = track.values[:, source.order]
        if len(peer.encode(ordered, first)) < len(peer.encode(track.values, first)):
            track = Track(ordered, track.domain, track.kind, track.unit)

    def largest_error(tolerance: float) -> float:
        data = peer.encode(track.values, tolerance)
        values = peer.decode(data, track.shape, track.dtype)
        return track_errors(track, Track(values, track.domain)).largest

    tolerance = coarsest_tolerance(largest_error, limit, first, peer.grain) if limit else 0.0
    if not largest_error(tolerance) <= limit:
        raise InvalidInputError("its lossless mode changes some numbers")
    return len(peer.encode(track.values, tolerance))


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


def rows(
    sequence: meshreel.MeshSequence, bounds: list[str], peers: list[TrackPeer]
) -> list[list[Any]]:
    """For each track and bound: bytes of our codec and of the others, and our seconds."""
    cells: list[list[Any]] = []
    for name, track in sequence.tracks.items():
        source = TrackInput(sequence.replace(tracks={name: track}), name)
        for bound in bounds or ["0.5deg" if track.kind == "normal" else "0.1%"]:
            limit = limit_of(bound, track)
            sizes: list[int | None] = []
            for peer in peers:
                try:
                    sizes.append(peer_bytes(source, peer, limit))
                except InvalidInputError:
                    sizes.append(None)
            size, *seconds = measure_ours(source, bound)
            best = min((other for other in sizes if other is not None), default=None)
            share = None if best is None else size / best
            cells.append([name, bound, source.without[0], size, *sizes, share, *seconds])
    return cells


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("inputs", nargs="*")
    parser.add_argument("--bounds", nargs="+", default=[], help="as of `encode --track NAME=`")
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--frames", type=int, default=150)
    arguments = parser.parse_args()
    sequences = {path: meshreel.load(path) for path in arguments.inputs}
    sequences = {
        path: given if given.tracks else derived(given) for path, given in sequences.items()
    }
    if not sequences:
        simulate = runpy.run_path(str(SIMULATION))["simulate"]
        sequences = {"sphere": simulate(arguments.vertices, arguments.frames)}
    peers = [peer for peer in TRACK_PEERS if peer.package.is_installed]
    head = ["track", "bound", "positions", "bytes", *(peer.name for peer in peers)]
    head += ["of the best", "encoding, s", "decoding, s"]
    print_row = start_table(*head)
    for name, sequence in sequences.items():
        for row in rows(sequence, arguments.bounds, peers):
            cells = [f"{cell:.2f}" if isinstance(cell, float) else str(cell) for cell in row]
            print_row(f"{Path(name).stem}, {cells[0]}", *cells[1:])


if __name__ == "__main__":
    main()
