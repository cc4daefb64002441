"""Errors of the texture coordinates of a stream."""

from dataclasses import dataclass

import numpy as np

from meshreel.codec.bitstream.layout import Order
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.codec.surface.payloads import surface_in_order
from meshreel.codec.surface.uv_grid import is_quantized
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import Attribute

TEXELS = 4096
"""Width of the texture whose texels are the unit of errors."""


@dataclass(frozen=True)
class UvErrors:
    """Errors of texture coordinates.

    Attributes
    ----------
    largest : float
        Largest error of a coordinate, in widths of the texture.
    """

    largest: float

    @property
    def texels(self) -> float:
        """Largest error in texels of a texture of 4096 x 4096."""
        return self.largest * TEXELS


def measure_uvs(sequence: MeshSequence, data: bytes) -> UvErrors | None:
    """Measure the errors of the texture coordinates of a stream; None if it has none.

    Parameters
    ----------
    sequence : MeshSequence
        The original, with its complete surface.
    """
    several = (
        _errors_of_segment(segment, whole_stream(data, segment=number))
        for number, segment in enumerate(sequence.segments)
    )
    errors = [error for errors_of_segment in several for error in errors_of_segment]
    return UvErrors(max(errors)) if errors else None


def _errors_of_segment(sequence: FrameSource, opened: OpenStream) -> list[float]:
    """Return the largest error of each attribute with rounded texture coordinates."""
    faces, order = sequence.faces, opened.order_kept
    internal = np.arange(sequence.n_verts)
    if order is Order.DROP and sequence.surface.attributes:
        internal = encode_connectivity(faces, sequence.n_verts, order="drop").internal_to_given
    kept = surface_in_order(sequence.surface, order, faces, opened.faces, internal).attributes
    if not any(map(is_quantized, kept)):
        return []
    pairs = zip(kept, opened.surface.attributes, strict=True)
    return [_largest(uv, uv_hat) for uv, uv_hat in pairs if is_quantized(uv)]


def _largest(given: Attribute, decoded: Attribute) -> float:
    errors = decoded.per_item().astype(np.float64) - given.per_item()
    return float(np.abs(errors[np.isfinite(errors)]).max(initial=0))
