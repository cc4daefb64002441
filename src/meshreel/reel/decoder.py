"""The blocks of a stream of `reel` to frames."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections
from meshreel.codec.decoded_block import DecodedBlock
from meshreel.codec.frame_products import JointFrames
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.reel.agreed.blocks import read_corrections, read_field_block
from meshreel.reel.agreed.fields import (
    FieldBlock,
    KeyFields,
    Layout,
    decode_basis,
    decode_fields,
)
from meshreel.reel.agreed.mesh import FieldMesh

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class ReelBlockDecoder:
    """Decodes the blocks of a stream in any order; the key block that others refer to is kept.

    Parameters
    ----------
    opened : OpenStream
    n_modes : int or None
        Only the first so many modes of each block move; the others rest at their mean over the
        block, and corrections, which belong to all modes together, are left out.

    Raises
    ------
    InvalidInputError
        If `n_modes` is below 1.
    """

    def __init__(self, opened: OpenStream, n_modes: int | None) -> None:
        if n_modes is not None and not (1 <= n_modes < float("inf") and int(n_modes) == n_modes):
            raise InvalidInputError(f"n_modes must be a whole number of at least 1; got {n_modes}")
        self._opened = opened
        self._n_modes = n_modes
        self._field_mesh: FieldMesh | None = None
        self._key: tuple[int, Layout, KeyFields] | None = None

    def block(self, number: int) -> DecodedBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored, order = self._opened.stored(number), self._opened.order
        with np.errstate(over="ignore", invalid="ignore"):
            frames_of = self._frames_of(number, stored, order)
        return DecodedBlock(
            start=stored.start,
            n_frames=stored.n_frames,
            frames_of=frames_of,
            frame=self._opened.frame,
            corrections=self._corrections(stored, order),
        )

    def _frames_of(self, number: int, stored: StoredBlock, order: Integers) -> JointFrames:
        block, mesh = self._read(stored)
        key = self._key_of(number, block.layout)
        basis = decode_basis(block.basis)
        values = decode_fields(block, mesh, key)
        if key is None:
            self._key = number, block.layout, KeyFields(values)
        if self._n_modes is not None:
            basis = resting_after(basis, self._n_modes)
        return JointFrames(basis, values, float(block.layout.step), mesh.number[order])

    def _corrections(self, stored: StoredBlock, order: Integers) -> Corrections | None:
        """Corrections of vertices as they go out."""
        if self._n_modes is not None:
            return None
        found = read_corrections(stored, self._opened.n_verts)
        return found and replace(found, vertices=inverse_permutation(order)[found.vertices])

    def _read(self, stored: StoredBlock) -> tuple[FieldBlock, FieldMesh]:
        opened = self._opened
        block, mesh = read_field_block(
            stored, opened.internal_faces, opened.n_verts, self._field_mesh
        )
        if len(opened.stream.places) > 1:  # else the mesh has served
            self._field_mesh = mesh
        return block, mesh

    def _key_of(self, number: int, layout: Layout) -> KeyFields | None:
        """The fields that a block refers to, decoded now or kept from before."""
        if not layout.reference:
            return None
        wanted = number - layout.reference
        if self._key is None or self._key[0] != wanted:
            if wanted < 0:
                raise CorruptStreamError(f"block {number} refers to one before the first")
            block, mesh = self._read(self._opened.stored(wanted))
            if block.layout.reference:
                raise CorruptStreamError(
                    f"block {number} refers to block {wanted}, which refers to another itself"
                )
            self._key = wanted, block.layout, KeyFields(decode_fields(block, mesh))
        _, key_layout, key = self._key
        if key_layout.stencil_size != layout.stencil_size:
            raise CorruptStreamError(
                f"block {number} has stencils of {layout.stencil_size}; that which it refers to "
                f"has {key_layout.stencil_size}"
            )
        return key


def resting_after(basis: Floats, n_modes: int) -> Floats:
    """Temporal basis of shape (3, T, K), of which vectors behind the first stay at their mean.

    Few modes so begin with the mean shape of the block, and not with nothing.
    """
    means = basis[:, :, n_modes:].mean(axis=1, keepdims=True)
    rest = np.broadcast_to(means, basis[:, :, n_modes:].shape)
    return np.concatenate([basis[:, :, :n_modes], rest], axis=2)
