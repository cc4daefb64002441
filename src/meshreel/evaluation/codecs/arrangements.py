"""Vertex orders for codecs that do not code faces."""

from dataclasses import dataclass
from functools import cached_property

from meshreel.codec.connectivity.coder import decode_connectivity, decode_order, encode_connectivity
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.model.sequence import MeshSequence, Vertices


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A sequence in one vertex order, and the cost of its coded connectivity.

    Attributes
    ----------
    order : {"coded", "given"}
        The order of the coded connectivity, or the original one, which must then be stored.
    size_bytes : int
        Coded connectivity, including the order if it is the original one.
    encode_s, decode_s : float
        Seconds for the connectivity.
    """

    order: str
    sequence: MeshSequence
    size_bytes: int
    encode_s: float
    decode_s: float


@dataclass(frozen=True, eq=False)
class Arrangements:
    """A sequence in both vertex orders, computed on first use."""

    sequence: MeshSequence

    @cached_property
    def coded(self) -> Arrangement:
        """The order of the coded connectivity."""
        return arrange(self.sequence, "coded")

    @cached_property
    def given(self) -> Arrangement:
        """The original order."""
        return arrange(self.sequence, "given")


def arrange(sequence: MeshSequence, order: str) -> Arrangement:
    """Bring the sequence into a vertex order, and code and time its connectivity."""
    faces, n_verts = sequence.faces, sequence.n_verts
    stored = "drop" if order == "coded" else "vertices"
    coded, encode_s = timed(lambda: encode_connectivity(faces, n_verts, order=stored), REPEATS)

    def decode_faces() -> None:
        internal = decode_connectivity(coded.payload, n_verts, len(faces))
        decode_order(coded.order_payload, internal, n_verts)

    _, decode_s = timed(decode_faces, REPEATS)
    if order == "coded":
        vertices: Vertices = sequence.vertices[:, coded.internal_to_given]
        sequence = MeshSequence(vertices.copy(), coded.internal_faces)
    size = len(coded.payload) + len(coded.order_payload)
    seconds = seconds_of(encode_s, decode_s)
    return Arrangement(order, sequence, size, seconds["encode"], seconds["decode"])
