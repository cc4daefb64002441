"""Comparison with Draco on sequences whose faces change, by the distances between surfaces."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.evaluation.comparison import (
    BD_RATE,
    CodecResults,
    Comparison,
    Error,
    Kind,
    method_run,
    peer_run,
)
from meshreel.evaluation.draco import DRACO, decode_frames, encode_frames
from meshreel.evaluation.peers import Peer
from meshreel.evaluation.positions import PEERS, own_sweeps, params_of
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.model.sequence import MeshFrame, MeshSequence
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Run
from meshreel.studies.timing import seconds_of, timed

METHOD = "reel"
"""The only method that encodes segments at a choice of rates."""

N_SAMPLES = 20_000
"""Samples on each surface of a frame."""

MAX_COMPARED, MAX_COMPARED_QUICK = 10, 3
"""Largest number of frames, evenly spaced, whose surfaces are compared."""

KIND = Kind(
    title="meshreel compared with Draco on changing faces: rate, distance between surfaces, time",
    rate="kbit_per_frame",
    rate_name="kilobits per frame",
    errors=(
        Error(
            "rms_distance_percent", "RMS distance", "RMS distance (% of the diagonal)",
            (0.1, 0.05, 0.02, 0.01),
        ),
    ),
    columns={
        "kbit per frame": "kbit_per_frame",
        "bpvf": "rate_bpvf",
        "PSNR, dB": "quality.psnr_db",
        "D1, dB": "quality.d1_psnr_db",
        "D2, dB": "quality.d2_psnr_db",
        "RMS %": "quality.rms_distance_percent",
        "largest %": "quality.max_distance_percent",
    },
    caption="All bits without the order.",
    methodology=(
        "**Data.** Positions and faces, without attributes and tracks. Codecs need not preserve "
        "the order of vertices and faces.",
        "**Rate.** All bits, including connectivity and headers, per frame. Draco codes each frame "
        "for itself; 4 bytes per frame for its length are counted.",
        "**Distance.** Root mean square over samples of equal density on one surface, of the "
        "distance to the closest point of the other surface; the worse direction, in percent of "
        "the diagonal of the compared frames. PSNR is 10 log10(3 p^2 / mse) with the longest side "
        "p of their bounding box, D1 and D2 as V-DMC defines them. 20,000 samples per surface; at "
        "most 10 frames (3 with --quick), evenly spaced, are compared.",
        BD_RATE,
    ),
)  # fmt: skip


def compare_surface_codecs(
    methods: Sequence[str] = (METHOD,), peers: Sequence[Peer] = PEERS, *, quick: bool = False
) -> Comparison:
    """Compare our codec with Draco by the distances between surfaces.

    The report lists methods and peers that need the same faces in every frame.
    """
    drawn = [peer for peer in peers if peer is DRACO]
    others = [name for name in methods if name != METHOD]
    others += [peer.name for peer in peers if peer is not DRACO]
    n_compared = MAX_COMPARED_QUICK if quick else MAX_COMPARED
    about = {"n_samples": N_SAMPLES, "max_compared": n_compared}

    def runs(given: MeshSequence) -> list[Run]:
        segments = [
            MeshSequence(segment.read(0, segment.n_frames), segment.faces)
            for segment in given.segments
        ]
        whole = MeshSequence.of_segments(segments, given.name, given.timing)
        sizes = whole.n_frames, max(segment.n_verts for segment in whole.segments)
        sweep = own_sweeps(quick=quick)[METHOD](*sizes) if METHOD in methods else []
        return [
            method_run(METHOD, options, partial(measure_ours, whole, options, n_compared), **about)
            for options in sweep
        ] + [
            peer_run(
                peer, params_of(peer, bits), partial(measure_draco, whole, bits, n_compared),
                value=bits, **about,
            )
            for peer in drawn
            if peer.package.is_available
            for bits in (peer.quick if quick else peer.settings)
        ]  # fmt: skip

    def excluded(_: Sequence[CodecResults]) -> list[str]:
        names = ", ".join(f"`{name}`" for name in others)
        return [f"codecs that need the same faces in every frame: {names}"] if others else []

    return Comparison(KIND, runs, drawn, excluded)


def measure_ours(
    sequence: MeshSequence, options: dict[str, Any], n_compared: int, progress: Progress
) -> dict[str, Any]:
    """Measure our codec on positions and faces, whose order is dropped."""
    data, encode_s = timed(
        lambda: encode(
            sequence, METHOD, **options, order="drop", attributes="none", progress=progress
        )
    )
    decoded, decode_s = timed(lambda: decode(data, progress=progress))
    frames = [decoded[number] for number in _compared(sequence, n_compared)]
    figures = _figures(sequence, len(data), (encode_s, decode_s), frames, progress)
    return {**figures, "connectivity_bytes": info(data).budget_bytes.get("connectivity", 0)}


def measure_draco(
    sequence: MeshSequence, bits: float, n_compared: int, progress: Progress
) -> dict[str, Any]:
    """Measure Draco, which codes each frame for itself."""
    originals = [(frame.vertices, frame.faces) for frame in sequence]
    progress("encoding and decoding", 0.0)
    data, encode_s = timed(lambda: encode_frames(originals, bits))
    decoded, decode_s = timed(lambda: decode_frames(data))
    chosen = [decoded[number] for number in _compared(sequence, n_compared)]
    frames = [
        MeshFrame(np.asarray(mesh.points, np.float32), np.asarray(mesh.faces, np.int32))
        for mesh in chosen
    ]
    return _figures(sequence, len(data), (encode_s, decode_s), frames, progress)


def _figures(
    sequence: MeshSequence,
    n_bytes: int,
    seconds: tuple[Floats, Floats],
    decoded: Sequence[MeshFrame],
    progress: Progress,
) -> dict[str, Any]:
    n_positions = sum(segment.n_frames * segment.n_verts for segment in sequence.segments)
    original = [sequence[number] for number in _compared(sequence, len(decoded))]
    return {
        "size_bytes": n_bytes,
        "rate_bpvf": 8 * n_bytes / n_positions,
        "kbit_per_frame": 8e-3 * n_bytes / sequence.n_frames,
        "seconds": seconds_of(*seconds),
        "quality": errors_of(original, decoded, progress),
    }


def errors_of(
    original: Sequence[MeshFrame], decoded: Sequence[MeshFrame], progress: Progress
) -> dict[str, Any]:
    """Distances of the worse direction and PSNRs of frames, as in `compare`."""
    sequences = (
        MeshSequence.of_segments(
            MeshSequence(frame.vertices[None], frame.faces) for frame in frames
        )
        for frames in (original, decoded)
    )
    quality = compare_surfaces(*sequences, n_samples=N_SAMPLES, progress=progress)
    worse = quality.worse
    return {
        "rms_distance_percent": worse.rms_percent,
        "mean_distance_percent": worse.mean_percent,
        "p95_distance_percent": worse.p95_percent,
        "max_distance_percent": worse.max_percent,
        "psnr_db": quality.psnr_db,
        "d1_psnr_db": quality.d1_psnr_db,
        "d2_psnr_db": quality.d2_psnr_db,
        "normal_angle_mean_deg": worse.normal_angle_mean_deg,
        "n_frames": quality.n_frames,
    }


def _compared(sequence: MeshSequence, max_compared: int) -> list[int]:
    """Evenly spaced frames, at most `max_compared`."""
    n_compared = min(sequence.n_frames, max_compared)
    numbers: list[int] = np.linspace(0, sequence.n_frames - 1, n_compared).astype(int).tolist()
    return numbers
