"""What an encoder works on: a sequence in internal order, cut into blocks of frames."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section, VertexType
from meshreel.codec.config import EncoderConfig
from meshreel.codec.methods import Order
from meshreel.connectivity.coder import CodedConnectivity, encode_connectivity
from meshreel.sequence import Faces, MeshSequence
from meshreel.subspace.trajectories import BoundingFrame, bounding_frame


@dataclass(frozen=True)
class Source:
    """A sequence, and how it is to be coded.

    Attributes
    ----------
    sequence : MeshSequence
    config : EncoderConfig
    """

    sequence: MeshSequence
    config: EncoderConfig

    @cached_property
    def connectivity(self) -> CodedConnectivity:
        """The faces, coded, and the internal order of vertices that follows."""
        return encode_connectivity(
            self.sequence.faces, self.sequence.n_verts, order=self.config.order
        )

    @cached_property
    def frame(self) -> BoundingFrame:
        """Where the model lies and how large it is."""
        return bounding_frame(self.sequence.vertices)

    @property
    def faces(self) -> Faces:
        """In internal order."""
        return self.connectivity.internal_faces

    @property
    def n_verts(self) -> int:
        """V."""
        return self.sequence.n_verts

    @property
    def block_frames(self) -> int:
        """Frames coded together; the last block may have fewer."""
        return self.config.frames_in_block(self.sequence.n_frames, self.n_verts)

    def blocks(self) -> Iterator[tuple[int, npt.NDArray[np.floating]]]:
        """First frame and positions, of shape (T_b, V, 3) in internal order, of each block."""
        n_frames, size = self.sequence.n_frames, self.block_frames
        order = self.connectivity.internal_to_given
        for start in range(0, n_frames, size):
            yield start, self.sequence.vertices[start : start + size].take(order, axis=1)

    def header(self) -> Header:
        """What the stream begins with."""
        sequence, config = self.sequence, self.config
        return Header(
            n_frames=sequence.n_frames,
            n_verts=sequence.n_verts,
            n_faces=sequence.n_faces,
            fps=sequence.fps,
            vertex_type=VertexType(sequence.vertices.dtype.itemsize),
            method=config.method_row.code,
            laplacian=config.laplacian_choice,
            order=config.order_choice,
            origin=self.frame.origin,
            scale=self.frame.scale,
            name=sequence.name,
        )

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections of connectivity and order."""
        yield Section.CONNECTIVITY, self.connectivity.payload
        if self.config.order_choice is not Order.DROP:
            yield Section.ORDER, self.connectivity.order_payload
