"""Runs that measure the paper's variants."""

import io
from dataclasses import asdict
from typing import Any

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import StreamInfo, info
from meshreel.evaluation.runs.store import Outcome, Run, finite
from meshreel.evaluation.runs.timing import (
    REPEATS,
    machine_facts,
    processor_seconds_of,
    timed_on_both_clocks,
)
from meshreel.metrics.compare import compare
from meshreel.model.sequence import MeshSequence
from meshreel.paper.stream_rates import rates
from meshreel.paper.sweeps import Setting
from meshreel.runtime.progress import Progress

MEASURED = (
    "wall-clock and processor seconds (all threads) in one process, from arrays in memory to bytes "
    "in memory and back, with connectivity and entropy coding, without files; the order of "
    "vertices and faces is preserved"
)


def variant_run(
    sequence: MeshSequence, setting: Setting, *, shown_frame: int = 0, repeat: bool = False
) -> Run:
    """A run of a setting; its stream and one decoded frame are stored with the result.

    The sequence is encoded once with vertex order, for quality and seconds, and once without, for
    the smallest size.

    Parameters
    ----------
    shown_frame : int
        The decoded frame to store for pictures.
    repeat : bool
        Use the median of three runs if one takes less than two seconds.
    """
    modes = setting.n_modes or "default"

    def measure(progress: Progress) -> Outcome:
        return _measure(sequence, setting, shown_frame, REPEATS if repeat else 1, progress)

    return Run(
        name=f"{setting.label}, {modes} modes, {setting.bits} bits",
        key=setting.key,
        setting=asdict(setting),
        measure=measure,
        needs=("reel",),
    )


def _measure(
    sequence: MeshSequence, setting: Setting, shown_frame: int, n_repeats: int, progress: Progress
) -> Outcome:
    options = setting.options()
    data, *encode_s = timed_on_both_clocks(
        lambda: encode(sequence, **options, progress=progress), n_repeats
    )
    decoded, *decode_s = timed_on_both_clocks(lambda: decode(data, progress=progress), n_repeats)
    smallest = info(encode(sequence, **options, order="drop", progress=progress))
    stream = info(data)
    frame = io.BytesIO()
    np.save(frame, decoded.vertices[shown_frame])
    figures = {
        "stream": stream.as_dict(),
        "rate_bpvf": stream.rate_bpvf,
        "rate_order_dropped_bpvf": smallest.rate_bpvf,
        "size_order_dropped_bytes": smallest.size_bytes,
        "budget_order_dropped_bytes": smallest.budget_bytes,
        **_rate_figures(data, smallest),
        "seconds": {**processor_seconds_of(encode_s, decode_s), "measured": MEASURED},
        "quality": finite(compare(sequence, decoded, progress=progress).as_dict()),
        "machine": machine_facts(),
    }
    return Outcome(figures, {"reel": data, "npy": frame.getvalue()})


def _rate_figures(data: bytes, smallest: StreamInfo) -> dict[str, Any]:
    """The rates of a stream in the paper's count, in plain types.

    "rate_order_dropped_entropy_bpvf" is the rate of the file if its coefficients took their
    zero-order entropy.
    """
    found = rates(data)
    counts = {
        name: {part: getattr(count, part) for part in ("q", "q_a", "q_d", "q_s")}
        for name, count in (("eq13", found.eq13), ("stored", found.stored))
    }
    other = {name: getattr(found, name) for name in ("q_entropy", "q_d_per_block")}
    saved = 3 * (found.q_entropy - found.stored.q)
    return {
        "rates": {**counts, **other, "dictionary_bits": found.dictionary_bits},
        "rate_order_dropped_entropy_bpvf": smallest.rate_bpvf + saved,
        "bits_per_row": [rows.tolist() for rows in found.stored.bits_per_row],
    }
