"""Runs that measure the paper's variants."""

import io
from dataclasses import asdict
from typing import Any

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import StreamInfo, info
from meshreel.metrics.compare import compare
from meshreel.model.sequence import MeshSequence
from meshreel.paper.stream_rates import rates
from meshreel.paper.sweeps import Setting
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Outcome, Run, finite
from meshreel.studies.timing import REPEATS, machine_facts, seconds_of, timed

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
    options, n_repeats = setting.options(), REPEATS if repeat else 1

    def measure(progress: Progress) -> Outcome:
        data, encode_s = timed(lambda: encode(sequence, **options, progress=progress), n_repeats)
        decoded, decode_s = timed(lambda: decode(data, progress=progress), n_repeats)
        smallest = info(encode(sequence, **options, order="drop", progress=progress))
        stream, frame = info(data), io.BytesIO()
        np.save(frame, decoded.vertices[shown_frame])
        figures = {
            "stream": stream.as_dict(),
            "rate_bpvf": stream.rate_bpvf,
            "rate_order_dropped_bpvf": smallest.rate_bpvf,
            "size_order_dropped_bytes": smallest.size_bytes,
            "budget_order_dropped_bytes": smallest.budget_bytes,
            **_rate_figures(data, smallest),
            "seconds": seconds_of(encode_s, decode_s),
            "quality": finite(compare(sequence, decoded, progress=progress).as_dict()),
            "machine": machine_facts(),
        }
        return Outcome(figures, {"reel": data, "npy": frame.getvalue()})

    name = f"{setting.label}, {setting.n_modes or 'default'} modes, {setting.bits} bits"
    return Run(name, setting.key, asdict(setting), measure, needs=("reel",))


def _rate_figures(data: bytes, smallest: StreamInfo) -> dict[str, Any]:
    """The rates of a stream in the paper's count, in plain types.

    "rate_order_dropped_entropy_bpvf" is the rate of the file if its coefficients took their
    zero-order entropy.
    """
    stream_rates = rates(data)
    figures: dict[str, Any] = {
        name: {part: getattr(getattr(stream_rates, name), part) for part in RATE_PARTS}
        for name in ("eq13", "stored")
    }
    for name in ("q_entropy", "q_d_per_block", "dictionary_bits"):
        figures[name] = getattr(stream_rates, name)
    saved = 3 * (stream_rates.q_entropy - stream_rates.stored.q)
    return {
        "rates": figures,
        "rate_order_dropped_entropy_bpvf": smallest.rate_bpvf + saved,
        "bits_per_row": [rows.tolist() for rows in stream_rates.stored.bits_per_row],
    }


RATE_PARTS = ("q", "q_a", "q_d", "q_s")
