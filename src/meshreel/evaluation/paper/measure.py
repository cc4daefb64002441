"""Encode, decode, measure: one setting of one sequence to one stored result."""

from dataclasses import asdict

import numpy as np
import numpy.typing as npt

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.errors import MeshReelError
from meshreel.evaluation.paper.count import paper_count
from meshreel.evaluation.paper.settings import Setting
from meshreel.evaluation.runs.machine import machine_facts
from meshreel.evaluation.runs.store import Result, Store, finite
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.metrics.compare import compare
from meshreel.paper.decoder import bits_per_row, coded_blocks
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import MeshSequence

MEASURED = (
    "wall-clock seconds in one process, arrays in memory to bytes in memory and back, with "
    "connectivity and entropy coding, without files; the order of vertices and faces kept"
)


def run(
    sequence: MeshSequence,
    setting: Setting,
    store: Store,
    *,
    shown_frame: int = 0,
    repeat: bool = False,
    progress: Progress = silent,
) -> Result:
    """The result of a setting: the stored one, or a new one that is then stored.

    The sequence is encoded once with its order kept, for quality and seconds, and once with the
    order dropped, for the smallest size.

    Parameters
    ----------
    sequence : MeshSequence
    setting : Setting
    store : Store
        Of this sequence.
    shown_frame : int
        The decoded frame that is stored for pictures.
    repeat : bool
        Time three times what takes less than two seconds, and keep the median.

    Returns
    -------
    dict of plain types; with "refused" and why where the method refuses the sequence
    """
    found = store.find(setting)
    if found is not None:
        return found
    try:
        figures, data, frame = _measure(sequence, setting, shown_frame, repeat, progress)
    except MeshReelError as error:
        return store.write(setting.key, asdict(setting), {"refused": str(error)})
    with replace_when_done(store.path(setting.key, "reel"), overwrite=True) as temporary:
        temporary.write_bytes(data)
    with replace_when_done(store.path(setting.key, "npy"), overwrite=True) as temporary:
        np.save(temporary, frame)
    return store.write(setting.key, asdict(setting), figures)


def _measure(
    sequence: MeshSequence, setting: Setting, shown_frame: int, repeat: bool, progress: Progress
) -> tuple[Result, bytes, npt.NDArray[np.floating]]:
    options = setting.options()
    n_repeats = REPEATS if repeat else 1
    data, encode_s = timed(lambda: encode(sequence, **options, progress=progress), n_repeats)
    decoded, decode_s = timed(lambda: decode(data, progress=progress), n_repeats)
    smallest = info(encode(sequence, **options, order="drop", progress=progress))
    stream = info(data)
    return (
        {
            "stream": stream.as_dict(),
            "rate_bpvf": stream.rate_bpvf,
            "rate_order_dropped_bpvf": smallest.rate_bpvf,
            "size_order_dropped_bytes": smallest.size_bytes,
            "budget_order_dropped_bytes": smallest.budget_bytes,
            "paper_count": paper_count(setting, stream, coded_blocks(data)),
            "bits_per_row": [rows.tolist() for rows in bits_per_row(data)],
            "seconds": {**seconds_of(encode_s, decode_s), "measured": MEASURED},
            "quality": finite(compare(sequence, decoded, progress=progress).as_dict()),
            "machine": machine_facts(),
        },
        data,
        decoded.vertices[shown_frame],
    )
