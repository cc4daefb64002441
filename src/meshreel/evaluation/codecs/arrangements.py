"""The vertices of a sequence in the orders that codecs without faces may take them in."""

from dataclasses import dataclass
from functools import cached_property

from meshreel.codec.connectivity.coder import decode_connectivity, decode_order, encode_connectivity
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.model.sequence import MeshSequence, Vertices


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A sequence with its vertices in one order, and what its faces cost then.

    Attributes
    ----------
    order : {"coded", "given"}
        That of the coded connectivity, or the one of the sequence, which is then stored.
    size_bytes : int
        Of our connectivity, with the order of the vertices where it is the given one.
    encode_s, decode_s : float
        Seconds of that.
    """

    order: str
    sequence: MeshSequence
    size_bytes: int
    encode_s: float
    decode_s: float


@dataclass(frozen=True, eq=False)
class Arrangements:
    """A sequence in both orders, each found when it is first asked for."""

    sequence: MeshSequence

    @cached_property
    def coded(self) -> Arrangement:
        """In the order of the coded connectivity."""
        return arranged(self.sequence, "coded")

    @cached_property
    def given(self) -> Arrangement:
        """In the order of the sequence."""
        return arranged(self.sequence, "given")


def arranged(sequence: MeshSequence, order: str) -> Arrangement:
    """The sequence in this order of vertices, with its connectivity coded and timed."""
    faces, n_verts = sequence.faces, sequence.n_verts
    kept = "drop" if order == "coded" else "vertices"
    coded, encode_s = timed(lambda: encode_connectivity(faces, n_verts, order=kept), REPEATS)

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
