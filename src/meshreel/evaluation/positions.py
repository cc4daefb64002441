"""Comparison of codecs of vertex positions, by rate, distances of vertices and seconds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.open_stream import whole_file
from meshreel.evaluation.comparison import Comparison, method_run, peer_run
from meshreel.evaluation.draco import DRACO
from meshreel.evaluation.peers import ARRAY_PEERS, Peer
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.sted import sted
from meshreel.model.sequence import MeshSequence, Vertices
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Result, Run
from meshreel.studies.timing import seconds_of, timed

PEERS = (DRACO, *ARRAY_PEERS)
DEFAULT_METHODS = ("reel", "pca-qp", "v2v")

Sweep = Callable[[int, int], list[dict[str, Any]]]
"""Returns the options to measure for a sequence of this many frames and vertices."""


def method_sweeps(*, quick: bool) -> dict[str, Sweep]:
    """The sweeps of our methods that are not the paper's, by name."""
    steps: tuple[float, ...] = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5)
    profiles: tuple[tuple[str, int], ...] = (("visual", 5), ("visual", 9), ("geometry", 9))
    if quick:
        steps, profiles = steps[1:6:2], profiles[:1]
    reel = [
        {"step": step, "tune": tune, "effort": effort}
        for tune, effort in profiles
        for step in steps
    ]
    # Error bounds in percent of the diagonal; larger bounds suit other methods.
    grid = [{"max_error": error} for error in (1e-3, 3e-4, 1e-4)]
    return {"reel": lambda *_: reel, "lossless": lambda *_: [{}], "grid": lambda *_: grid}


def compare_positions(
    methods: Mapping[str, Sweep],
    peers: Sequence[Peer] = PEERS,
    recorded: Sequence[Result] = (),
    *,
    quick: bool = False,
) -> Comparison:
    """Compare our methods with other codecs, and with points measured elsewhere.

    Parameters
    ----------
    recorded : sequence of results
        From `read_recorded`; points of other sequences are ignored.
    quick : bool
        Use few settings of each codec.
    """

    def runs(sequence: MeshSequence) -> list[Run]:
        arrangement = cache(partial(arrange, sequence))
        return [
            method_run(method, options, partial(measure_method, sequence, method, options))
            for method, sweep in methods.items()
            for options in sweep(sequence.n_frames, sequence.n_verts)
        ] + [
            peer_run(peer, peer.params.format(value),
                     partial(measure_peer, sequence, arrangement, peer, value),
                     value=value)
            for peer in peers
            if peer.is_available
            for value in (peer.quick if quick else peer.settings)
        ]  # fmt: skip

    return Comparison(runs, peers, recorded)


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A sequence in one vertex order, and the cost of its coded connectivity."""

    order: str
    """{"coded", "given"}. The order of the coded connectivity, or the original one, which must then
    be stored.
    """
    sequence: MeshSequence
    size_bytes: int
    """Coded connectivity, including the order if it is the original one."""
    encode_s: Floats
    decode_s: Floats
    """float64 arrays of shape (2,). Wall-clock and processor seconds for the connectivity."""


def arrange(sequence: MeshSequence, order: str) -> Arrangement:
    """Bring the sequence into a vertex order, and code and time its connectivity."""
    faces, n_verts = sequence.faces, sequence.n_verts
    order_kept = "drop" if order == "coded" else "vertices"
    coded, encode_s = timed(lambda: encode_connectivity(faces, n_verts, order=order_kept))
    stream = encode(MeshSequence(sequence.vertices[:1], faces), "lossless", order=order_kept)
    _, decode_s = timed(lambda: whole_file(stream).read_mesh())
    if order == "coded":
        vertices: Vertices = sequence.vertices[:, coded.internal_to_given]
        sequence = MeshSequence(vertices.copy(), coded.internal_faces)
    size = len(coded.payload) + len(coded.order_payload)
    seconds = (np.median(runs, axis=0) for runs in (encode_s, decode_s))
    return Arrangement(order, sequence, size, *seconds)


def measure_method(
    sequence: MeshSequence, method: str, options: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    """Measure one of our methods.

    Rate and seconds are measured without the vertex order, as for other codecs; quality is
    measured on a stream with it.
    """
    data, encode_s = timed(
        lambda: encode(sequence, method, **options, order="drop", progress=progress)
    )
    _, decode_s = timed(lambda: decode(data, progress=progress))
    ordered = decode(encode(sequence, method, **options, progress=progress))
    progress("measuring", 0.0)
    return {
        **_sizes(sequence, len(data), info(data).budget_bytes.get("connectivity", 0)),
        "seconds": seconds_of(encode_s, decode_s),
        "quality": errors_of(sequence, ordered.vertices),
    }


def measure_peer(
    sequence: MeshSequence,
    arrangement: Callable[[str], Arrangement],
    peer: Peer,
    value: float,
    progress: Progress,
) -> dict[str, Any]:
    """Measure another codec.

    If it does not code faces, the bytes and seconds of our connectivity are added, and the vertex
    order, "coded" or "given", is the one with the smaller total.
    """
    progress("encoding and decoding", 0.0)
    if peer.has_faces:
        return _measure_coder(sequence, peer, value)
    faces = min(
        map(arrangement, ("coded", "given")),
        key=lambda option: option.size_bytes + len(peer.encode(option.sequence, value)),
    )
    return _measure_coder(faces.sequence, peer, value, faces)


def _measure_coder(
    original: MeshSequence, peer: Peer, value: float, faces: Arrangement | None = None
) -> dict[str, Any]:
    """Sizes, seconds and errors, including the connectivity in `faces` if given."""
    source = peer.prepare(original) if peer.prepare else original
    data, encode_s = timed(lambda: peer.encode(source, value))
    shape, dtype = (source.n_frames, source.n_verts, 3), source.vertices.dtype
    known = (shape, dtype, source.faces) if peer.takes_faces else (shape, dtype)
    decoded, decode_s = timed(lambda: peer.decode(data, *known))
    if peer.restore:
        decoded = peer.restore(decoded, source, value)
    if faces:
        encode_s, decode_s = encode_s + faces.encode_s, decode_s + faces.decode_s
    n_connectivity = faces.size_bytes if faces else None
    return {
        **_sizes(source, len(data) + (n_connectivity or 0), n_connectivity),
        "vertex_order": faces.order if faces else None,
        "seconds": seconds_of(encode_s, decode_s),
        "quality": errors_of(original, decoded),
    }


def errors_of(original: MeshSequence, vertices_hat: Vertices) -> dict[str, float]:
    """KG error, STED, largest and RMS error of decoded positions, as in `compare`."""
    positions = vars(position_errors(original.vertices, vertices_hat))
    return {**positions, "sted": sted(original.vertices, vertices_hat, original.faces).sted}


def _sizes(sequence: MeshSequence, n_bytes: int, n_connectivity: int | None) -> dict[str, Any]:
    return {
        "size_bytes": n_bytes,
        "connectivity_bytes": n_connectivity,
        "rate_bpvf": 8 * n_bytes / (sequence.n_verts * sequence.n_frames),
    }
