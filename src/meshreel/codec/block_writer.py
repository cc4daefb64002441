"""Blocks of frames that are not all there yet, written to a stream one after another."""

from collections.abc import Callable
from itertools import chain
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.writer import Sections, StreamWriter
from meshreel.codec.methods import Basis
from meshreel.codec.source import CodedMesh
from meshreel.codec.targets import Aim
from meshreel.paper.encoder import PaperBlockCoder
from meshreel.reel.encoding.block_coder import (
    FieldBlockCoder,
    KeyBlock,
    checked_frames,
    field_mesh_of,
)
from meshreel.reel.encoding.effort import STEPS_OF_BOUND, checked_step, finest_step, quality_step
from meshreel.reel.encoding.rate_control import least_cost
from meshreel.sequence import extent_of
from meshreel.subspace.trajectories import BoundingFrame, bounding_frame

Vertices = npt.NDArray[np.floating]


class BlockWriter:
    """Codes blocks of positions in the given order, and writes them: all follow from the first.

    Parameters
    ----------
    file : binary file, open for writing
    mesh : CodedMesh
    first : float array of shape (T_b, V, 3)
        The first block, which is not written yet: what scale and step follow from.
    fps : float
    name : str
    """

    def __init__(
        self, file: BinaryIO, mesh: CodedMesh, first: Vertices, fps: float, name: str
    ) -> None:
        self._mesh = mesh
        extent = extent_of(first)
        frame = bounding_frame(extent)
        internal = first[:, mesh.order]
        if mesh.config.method_row.basis is Basis.JOINT:
            own_diagonal = extent.mean_diagonal / frame.scale or 1.0
            fields = _field_coder(mesh, frame, internal, own_diagonal)
            self._code: Callable[[Vertices], Sections] = _FieldBlocks(fields).code
            leading = fields.leading_sections()
        else:
            paper = PaperBlockCoder(mesh, frame, [internal])
            self._code, leading = paper.code, paper.leading_sections()
        header = mesh.header(frame, first.dtype, n_frames=0, fps=fps, name=name)
        self._writer = StreamWriter(file, header, chain(mesh.leading_sections(), leading))

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._writer.size_bytes

    def analyse(self, vertices: Vertices) -> Sections:
        """The sections of a block of shape (T_b, V, 3), in the given order of vertices.

        Integers are found now, bytes when the sections are taken.
        """
        return self._code(vertices.take(self._mesh.order, axis=1))

    def write(self, n_frames: int, sections: Sections) -> None:
        """Write a block."""
        self._writer.write_block(n_frames, sections)

    def finish(self) -> None:
        """Write what ends a stream."""
        self._writer.finish()


class _FieldBlocks:
    """Blocks of `reel`, the first of which is the key block of all."""

    def __init__(self, coder: FieldBlockCoder) -> None:
        self._coder = coder
        self._key: KeyBlock | None = None
        self._n_coded = 0

    def code(self, vertices: Vertices) -> Sections:
        """The sections of the next block, given in internal order."""
        coded = self._coder.code(checked_frames(self._coder, vertices), self._key, self._n_coded)
        self._key = self._key or coded.key
        self._n_coded += 1
        return coded.sections


def _field_coder(
    mesh: CodedMesh, frame: BoundingFrame, first: Vertices, own_diagonal: float
) -> FieldBlockCoder:
    """The coder of `reel` that meets the target, as far as the first block tells."""
    target, finest = mesh.config.target, finest_step(mesh.n_verts)
    choices = mesh.config.field_choices
    coder = FieldBlockCoder(field_mesh_of(mesh, choices.stencil_size), frame, choices)
    if target.aim is Aim.STEP:
        return coder.with_step(checked_step(target.value, finest), None)
    if target.aim is Aim.QUALITY:
        return coder.with_step(max(finest, quality_step(target.value) * own_diagonal), None)
    bound = target.bound.share(frame.scale)
    frames = checked_frames(coder.with_step(finest, bound), first)

    def size_bytes(step: float) -> float:
        coded = coder.with_step(max(finest, step), bound).code(frames)
        return float(sum(len(payload) for _, payload in coded.sections))

    step = least_cost(size_bytes, bound / STEPS_OF_BOUND)
    return coder.with_step(max(finest, step), bound)
