"""What a stream is worth: it is decoded and set against its original."""

from dataclasses import dataclass

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.connectivity.coder import encode_connectivity
from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.kg import kg_error_percent
from meshreel.metrics.sted import sted
from meshreel.progress import Progress, silent
from meshreel.sequence import FrameSource


@dataclass(frozen=True)
class Achieved:
    """Errors of a stream.

    Attributes
    ----------
    kg_error_percent, max_error_percent : float
    sted : float or None
        None where it was not asked for.
    """

    kg_error_percent: float
    max_error_percent: float
    sted: float | None


def measure_stream(
    sequence: FrameSource,
    data: bytes,
    *,
    order: str,
    with_sted: bool = False,
    progress: Progress = silent,
) -> Achieved:
    """Errors of a stream against the sequence that it was made of.

    Parameters
    ----------
    sequence : FrameSource
    data : bytes
    order : {"keep", "vertices", "drop"}
        As it was encoded: vertices whose order was dropped are matched by connectivity.
    with_sted : bool, default False
        Measure STED too, which takes longer.
    progress : callable, optional
    """
    decoded = decode(data, progress=progress).vertices
    if order == "drop":
        connectivity = encode_connectivity(sequence.faces, sequence.n_verts, order="drop")
        in_given_order = np.empty_like(decoded)
        in_given_order[:, connectivity.internal_to_given] = decoded
        decoded = in_given_order
    progress("measure", 0.5)
    vertices = sequence.read(0, sequence.n_frames)
    return Achieved(
        kg_error_percent(vertices, decoded),
        displacement_errors_percent(vertices, decoded).max_percent,
        sted(vertices, decoded, sequence.faces).sted if with_sted else None,
    )
