"""Measure our codec and others on a sequence, at equal error."""

import ctypes
import gzip
import math
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from corpus.visible import SeenFrame
from meshreel.evaluation.draco import encode_frames, separate_equal
from meshreel.evaluation.peers import ARRAY_PEERS, Array
from meshreel.evaluation.positions import Arrangement, arrange
from meshreel.metrics.position_errors import ErrorSums, PositionErrors
from meshreel.metrics.reference import bounding_box_reference, shared_reference
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.threads import limit_cores
from meshreel.studies.timing import timed_once

SETTINGS: dict[str, dict[str, Any]] = {
    "q60": {"quality": 60},
    "q80": {"quality": 80},
    "q95": {"quality": 95},
    "0.1%": {"max_error": "0.1%"},
    "0.01%": {"max_error": "0.01%"},
}
"""Options of `meshreel.encode`, by their name in tables."""

PEERS = {peer.name: peer for peer in ARRAY_PEERS if peer.name in ("sz3", "zfp", "meshopt")}
MESHOPT_SETTINGS = ("q80", "0.1%", "0.01%")
"""Few: LZMA, after the codec, is slow."""

MAX_DRACO_BITS = 30
ZFP_FACTORS = (8.0, 4.0, 2.0, 1.0)
"""zfp seldom reaches its tolerance: multiples to try, the largest first."""

MIN_TIMED = 50_000
"""Vertices in all frames from which speed and memory are in the tables."""

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Subject:
    """A sequence of positions and faces, in memory, and the best vertex order for each codec."""

    sequence: MeshSequence
    is_drawn: bool
    """Whether pictures are compared, which takes most of the time."""
    order_of: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, sequence: MeshSequence, *, is_drawn: bool = False) -> "Subject":
        """Keep only triangles, and the positions of their vertices: Draco drops others."""
        segments = []
        for segment in sequence.segments:
            used, numbers = np.unique(segment.faces, return_inverse=True)
            vertices = segment.read(0, segment.n_frames)
            segments.append(
                MeshSequence(vertices[:, used], numbers.reshape(-1, 3).astype(np.int32))
                if len(used) < segment.n_verts
                else MeshSequence(vertices, segment.faces)
            )
        whole = segments[0] if len(segments) == 1 else MeshSequence.of_segments(segments)
        return cls(whole, is_drawn)

    @cached_property
    def segments(self) -> list[MeshSequence]:
        """Its segments, in memory."""
        return [MeshSequence.of_segments([segment]) for segment in self.sequence.segments]

    @cached_property
    def box(self) -> tuple[Floats, float, float]:
        """Lowest corner, longest side and diagonal of the bounding box of all frames."""
        corners = [
            (segment.vertices.min(axis=(0, 1)), segment.vertices.max(axis=(0, 1)))
            for segment in self.segments
        ]
        low = np.min([low for low, _ in corners], axis=0).astype(np.float64)
        sides = np.max([high for _, high in corners], axis=0).astype(np.float64) - low
        return low, float(sides.max()), float(np.linalg.norm(sides))

    @cached_property
    def seen(self) -> SeenFrame:
        """The frame of the first segment whose visible errors are measured."""
        one = self.segments[0]
        return SeenFrame(one.vertices, one.faces, is_drawn=self.is_drawn)

    @cached_property
    def arrangements(self) -> list[Arrangement]:
        """Vertex orders for codecs without faces, with the bytes of coded faces."""
        return [arrange(self.sequence, order) for order in ("coded", "given")]

    def errors(self, decoded: Iterator[Array]) -> PositionErrors:
        """Errors of the decoded positions of each segment."""
        pairs = [(one.vertices, other) for one, other in zip(self.segments, decoded, strict=True)]
        if len(pairs) == 1:
            sums = ErrorSums(shared_reference(*pairs[0]))
        else:
            every = np.concatenate([one.reshape(1, -1, 3) for one, _ in pairs], axis=1)
            sums = ErrorSums(bounding_box_reference(every))
        for original, values in pairs:
            sums.add(original, values)
        return sums.errors


def measure(sequence: MeshSequence, *, is_drawn: bool) -> dict[str, Any]:
    """Sizes and memory in bytes, errors in percent of the diagonal, and processor seconds."""
    subject = Subject.of(sequence, is_drawn=is_drawn)
    segments = subject.segments
    arrays = [
        part
        for one in segments
        for part in (one.vertices.astype(np.float32), one.faces.astype(np.int32))
    ]
    raw = b"".join(part.tobytes() for part in arrays)
    figures: dict[str, Any] = {
        "n_frames": subject.sequence.n_frames,
        "n_segments": len(segments),
        "n_verts": max(one.n_verts for one in segments),
        "n_faces": max(len(one.faces) for one in segments),
        "n_positions": sum(one.n_frames * one.n_verts for one in segments),
        "dtype": segments[0].vertices.dtype.name,
        "raw": len(raw),
        "gzip": len(gzip.compress(raw, 6)),
        "with_attributes": len(meshreel.encode(sequence)),
        "settings": {name: measure_setting(subject, name) for name in SETTINGS},
    }
    if figures["n_positions"] >= MIN_TIMED:
        figures["memory"] = memory_growth(subject.sequence)
    return figures


def memory_growth(sequence: MeshSequence) -> dict[str, int]:
    """Largest growth of a new process, on Linux, while it encodes a sequence, and then decodes it.

    Includes the results: the stream, and the decoded sequence.
    """
    arrays = [(one.read(0, one.n_frames), one.faces) for one in sequence.segments]
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_growth_of_process, arrays).result()


def _growth_of_process(arrays: list[tuple[Array, Array]]) -> dict[str, int]:
    limit_cores(1)
    meshreel.decode(meshreel.encode(meshreel.simulate_flag(2)))  # loads code
    sequence = MeshSequence.of_segments([MeshSequence(*one) for one in arrays])
    data, encode_bytes = _with_growth(partial(meshreel.encode, sequence))
    return {"encode": encode_bytes, "decode": _with_growth(partial(meshreel.decode, data))[1]}


def features(sequence: MeshSequence) -> dict[str, float]:
    """Properties of the first segment that explain sizes, each from 0 to 1.

    Returns
    -------
    dict
        distinct: distinct values of a coordinate over vertices, on a grid of 1e-5 of the diagonal;
        repeated: sides of faces in the first frame whose vector another side has, on this grid;
        resting: vertices that move by less than one step of this grid.
    """
    subject = Subject.of(sequence)
    vertices, faces = subject.segments[0].vertices, subject.segments[0].faces
    low, _, diagonal = subject.box
    steps = np.rint((vertices - low) / (1e-5 * diagonal or 1.0)).astype(np.int64)
    n_distinct = np.mean([len(np.unique(column)) for column in steps[0].T])
    sides = (steps[0][faces] - steps[0][np.roll(faces, 1, axis=1)]).reshape(-1, 3)
    counts = np.unique(np.abs(sides), axis=0, return_counts=True)[1]
    return {
        "distinct": float(n_distinct / vertices.shape[1]),
        "repeated": float(1 - (counts <= 2).dot(counts) / len(sides)),
        "resting": float(np.mean(np.ptp(steps, axis=0).max(axis=1) == 0)),
    }


def measure_setting(subject: Subject, name: str) -> dict[str, Any]:
    """Measure our codec with one setting, and others at its error."""
    options = SETTINGS[name]
    data, encoding = timed_once(partial(meshreel.encode, subject.sequence, **options))
    decoded, decoding = timed_once(partial(meshreel.decode, data))
    originals, results = subject.segments, list(decoded.segments)
    for one, other in zip(originals, results, strict=True):
        if not np.array_equal(one.faces, other.faces):
            raise ValueError("decoded faces differ")
    errors = subject.errors(one.read(0, one.n_frames) for one in results)
    percent = float(options["max_error"].rstrip("%")) if "max_error" in options else None
    budget = meshreel.info(data).budget_bytes
    order = budget.get("order", 0)
    if len(originals) == 1 and budget["connectivity"] != subject.arrangements[0].size_bytes:
        # Faces were listed, which is larger, but needs no order.
        order = len(data) - len(meshreel.encode(subject.sequence, order="drop", **options))
    figures: dict[str, Any] = {
        "size": len(data),
        "order": order,
        "max": errors.max_error_percent,
        "rms": errors.rms_error_percent,
        "encode_s": encoding.processor,
        "decode_s": decoding.processor,
    }
    if percent is not None:
        figures["is_broken"] = not errors.max_error_percent <= percent
    _, side, diagonal = subject.box
    if not 0 < diagonal < math.inf:
        return figures
    if percent is None:
        figures |= subject.seen.errors(results[0].read(0, results[0].n_frames))
        # Rounding to a grid leaves errors of half a step: root of 3 coordinates x step^2 / 12.
        step = errors.rms_error_percent / 100 * diagonal * 2
    else:
        step = percent / 100 * diagonal * 2 / math.sqrt(3)
    if step > 0:
        step = max(step, side / (2**MAX_DRACO_BITS - 1))
        figures["draco"] = draco_size(subject, step)
        if len(originals) == 1:
            figures |= peer_sizes(subject, name, step, percent)
    return figures


def draco_size(subject: Subject, step: float) -> int:
    """Bytes of Draco, which codes each frame for itself, with one quantization step.

    Vertices at equal positions stay apart, as in our file.
    """
    low, side, _ = subject.box
    bits = min(max(math.ceil(math.log2(side / step + 1)), 1), MAX_DRACO_BITS)
    frames = (
        (separate_equal(frame), one.faces)
        for one in subject.segments
        for frame in one.vertices.astype(np.float32)
    )
    whole_range = step * (2**bits - 1)
    return len(
        encode_frames(
            frames, bits, quantization_range=whole_range, quantization_origin=low.tolist()
        )
    )


def peer_sizes(subject: Subject, name: str, step: float, percent: float | None) -> dict[str, int]:
    """Bytes of codecs for constant faces, with our coded faces.

    The bounded codecs are measured only where a largest error is required.
    """
    _, side, diagonal = subject.box
    sizes = {}
    bits = math.log2(side / step + 1)
    if name in MESHOPT_SETTINGS and PEERS["meshopt"].is_available and 1 <= bits <= 16:
        sizes["meshopt"] = _size_of(subject, "meshopt", bits)
    if percent is None:
        return sizes
    share = percent / 100 / math.sqrt(3)  # of a coordinate
    sizes["sz3"] = _size_of(subject, "sz3", share)
    for factor in ZFP_FACTORS:
        arrangement = subject.arrangements[0].sequence
        positions = arrangement.vertices
        data = PEERS["zfp"].encode(arrangement, share * factor)
        values = PEERS["zfp"].decode(data, positions.shape, positions.dtype)
        distance = np.linalg.norm(values.astype(np.float64) - positions, axis=2).max()
        if distance <= percent / 100 * diagonal:
            sizes["zfp"] = _size_of(subject, "zfp", share * factor)
            break
    return sizes


def _size_of(subject: Subject, name: str, setting: float) -> int:
    """Bytes of a codec and our coded faces, in the vertex order that suited its first setting."""
    arrangements, encode = subject.arrangements, PEERS[name].encode
    if name in subject.order_of:
        one = arrangements[subject.order_of[name]]
        return one.size_bytes + len(encode(one.sequence, setting))
    sizes = [one.size_bytes + len(encode(one.sequence, setting)) for one in arrangements]
    subject.order_of[name] = sizes.index(min(sizes))
    return min(sizes)


def _with_growth(work: Callable[[], Any]) -> tuple[Any, int]:
    if hasattr(c_library := ctypes.CDLL(None), "malloc_trim"):
        c_library.malloc_trim(0)  # what earlier work freed would hide growth
    Path("/proc/self/clear_refs").write_text("5")  # the peak becomes the current size
    before = _status_bytes("VmRSS")
    result = work()
    return result, _status_bytes("VmHWM") - before


def _status_bytes(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(f"{name}:"))
