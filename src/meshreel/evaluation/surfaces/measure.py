"""Runs that measure a codec on a sequence whose faces may change."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.evaluation.codecs.measure import METHOD, PEER, MethodSetting
from meshreel.evaluation.codecs.peers.draco import LEVEL, Draco
from meshreel.evaluation.codecs.peers.integer_deltas import pack_frames, unpack_frames
from meshreel.evaluation.codecs.peers.protocol import package_version
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.store import Outcome, Run, finite
from meshreel.evaluation.runs.timing import REPEATS, machine_facts, seconds_of, timed
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.model.sequence import MeshFrame, MeshSequence
from meshreel.runtime.progress import Progress

N_SAMPLES = 20_000
"""Samples on each surface of a frame."""

MAX_COMPARED, MAX_COMPARED_QUICK = 10, 3
"""Largest number of frames, evenly spaced, whose surfaces are compared."""


@dataclass(frozen=True)
class Compared:
    """Some frames of a sequence, as `compare_surfaces` reads them."""

    frames: Sequence[MeshFrame]

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.frames)

    def __iter__(self) -> Iterator[MeshFrame]:
        return iter(self.frames)


def our_run(sequence: MeshSequence, setting: MethodSetting, max_compared: int) -> Run:
    """A run of our codec on positions and faces, whose order is dropped."""
    return Run(
        name=f"{setting.method} {setting.params}",
        key=file_name(f"{setting.label} {setting.params}"),
        setting={
            "kind": METHOD,
            "method": setting.method,
            "options": dict(setting.options),
            **_comparison(max_compared),
        },
        measure=lambda progress: _measure_ours(sequence, setting, max_compared, progress),
        facts={"codec": setting.label, "params": setting.params},
    )


def draco_run(sequence: MeshSequence, peer: Draco, bits: float, max_compared: int) -> Run:
    """A run of Draco, which codes each frame for itself."""
    about = {"codec": peer.name, "summary": peer.summary, "version": package_version(peer)}
    params = peer.params(bits)
    return Run(
        name=f"{peer.name} {params}",
        key=file_name(f"{peer.name} {params}"),
        setting={"kind": PEER, "value": bits, **about, **_comparison(max_compared)},
        measure=lambda progress: _measure_draco(sequence, int(bits), max_compared, progress),
        facts={"codec": peer.name, "params": params},
        is_foreign=True,
    )


def _comparison(max_compared: int) -> dict[str, Any]:
    return {"n_samples": N_SAMPLES, "max_compared": max_compared}


def _measure_ours(
    sequence: MeshSequence, setting: MethodSetting, max_compared: int, progress: Progress
) -> Outcome:
    options = {**dict(setting.options), "order": "drop", "attributes": "none"}
    data, encode_s = timed(
        lambda: encode(sequence, setting.method, **options, progress=progress), REPEATS
    )
    decoded, decode_s = timed(lambda: decode(data, progress=progress), REPEATS)
    n_connectivity = info(data).budget_bytes.get("connectivity", 0)
    frames = [decoded[number] for number in _compared(sequence, max_compared)]
    return _outcome(
        sequence, len(data), n_connectivity, (encode_s, decode_s), frames, max_compared, progress
    )


def _measure_draco(
    sequence: MeshSequence, bits: int, max_compared: int, progress: Progress
) -> Outcome:
    draco = import_module("DracoPy")
    originals = [
        (frame.vertices.astype(np.float32), frame.faces.astype(np.uint32)) for frame in sequence
    ]

    def encode_all() -> bytes:
        return pack_frames(
            [
                bytes(
                    draco.encode(
                        vertices, faces, quantization_bits=bits, compression_level=LEVEL,
                        create_metadata=False,
                    )
                )
                for vertices, faces in originals
            ]
        )  # fmt: skip

    progress("encoding and decoding", 0.0)
    data, encode_s = timed(encode_all, REPEATS)
    decoded, decode_s = timed(lambda: [draco.decode(one) for one in unpack_frames(data)], REPEATS)
    chosen = [decoded[number] for number in _compared(sequence, max_compared)]
    frames = [
        MeshFrame(np.asarray(one.points, np.float32), np.asarray(one.faces, np.int32))
        for one in chosen
    ]
    return _outcome(sequence, len(data), None, (encode_s, decode_s), frames, max_compared, progress)


def _outcome(
    sequence: MeshSequence,
    n_bytes: int,
    n_connectivity: int | None,
    seconds: tuple[list[float], list[float]],
    decoded: Sequence[MeshFrame],
    max_compared: int,
    progress: Progress,
) -> Outcome:
    n_positions = sum(one.n_frames * one.n_verts for one in sequence.segments)
    original = [sequence[number] for number in _compared(sequence, max_compared)]
    figures: dict[str, Any] = {
        "size_bytes": n_bytes,
        "connectivity_bytes": n_connectivity,
        "rate_bpvf": 8 * n_bytes / n_positions,
        "kbit_per_frame": 8e-3 * n_bytes / sequence.n_frames,
        "seconds": seconds_of(*seconds),
        "quality": errors_of(original, decoded, progress),
        "machine": machine_facts(),
    }
    return Outcome(figures)


def errors_of(
    original: Sequence[MeshFrame], decoded: Sequence[MeshFrame], progress: Progress
) -> dict[str, Any]:
    """Distances of the worse direction and PSNRs of frames, as in `compare`."""
    quality = compare_surfaces(
        Compared(original), Compared(decoded), n_samples=N_SAMPLES, progress=progress
    )
    worse = quality.worse
    errors: dict[str, Any] = finite(
        {
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
    )
    return errors


def _compared(sequence: MeshSequence, max_compared: int) -> list[int]:
    """Evenly spaced frames, at most `max_compared`."""
    n_compared = min(sequence.n_frames, max_compared)
    numbers: list[int] = np.linspace(0, sequence.n_frames - 1, n_compared).astype(int).tolist()
    return numbers
