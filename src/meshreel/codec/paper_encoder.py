"""The paper's methods: a source to the parts of a stream."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from meshreel.bitstream.layout import Section
from meshreel.bitstream.writer import Sections
from meshreel.codec import payloads
from meshreel.codec.blocks import tracked_from, write_coded_block
from meshreel.codec.config import EncoderConfig
from meshreel.codec.mesh_model import MeshModel, choose_anchors
from meshreel.codec.methods import Basis
from meshreel.codec.pipeline import Quantized, analyse, modes_needed
from meshreel.codec.source import Source
from meshreel.entropy.floats import encode_floats
from meshreel.progress import Progress
from meshreel.subspace.trajectories import to_matrices


class PaperEncoder:
    """Makes the parts of a stream, block after block.

    Parameters
    ----------
    source : Source
    progress : callable
    """

    def __init__(self, source: Source, progress: Progress) -> None:
        self._source = source
        self._progress = progress
        self._config = _with_modes_for_all(source)
        self._mesh = _mesh_model(source, self._config)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """What comes before the first block."""
        yield from self._source.leading_sections()
        if self._config.method_row.has_anchors:
            yield Section.ANCHOR_VERTICES, payloads.write_anchor_vertices(self._mesh.anchors)

    def blocks(self) -> Iterator[tuple[int, Sections]]:
        """Frames and sections of each block."""
        method, mesh = self._config.method_row, self._mesh
        before: Quantized | None = None
        for start, vertices in self._source.blocks():
            self._progress("frames", start / self._source.sequence.n_frames)
            before = tracked_from(method, before, len(vertices))
            matrices = to_matrices(vertices, self._source.frame)
            block = analyse(matrices, mesh, self._config, before)
            exact = encode_floats(vertices[:, mesh.isolated]) if len(mesh.isolated) else b""
            yield len(vertices), write_coded_block(block, len(vertices), method, before, exact)
            before = block.basis
        self._progress("frames", 1.0)


def _mesh_model(source: Source, config: EncoderConfig) -> MeshModel:
    anchors = np.zeros(0, np.int64)
    if config.method_row.has_anchors:
        anchors = choose_anchors(source.faces, source.n_verts, config.anchor_share)
    return MeshModel(source.faces, source.n_verts, anchors, config.laplacian_choice)


def _with_modes_for_all(source: Source) -> EncoderConfig:
    """The configuration, with the number of modes that a tracked basis has in all its blocks."""
    config = source.config
    if config.method_row.basis is not Basis.TRACKED or config.n_modes is not None:
        return config
    needed = max(
        modes_needed(to_matrices(vertices, source.frame), config) for _, vertices in source.blocks()
    )
    return replace(config, n_modes=needed, energy=None)
