"""The paper's methods: a source to the sections of a stream."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from meshreel.bitstream.layout import Section
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


def paper_sections(source: Source, progress: Progress) -> Iterator[tuple[Section, bytes]]:
    """All sections of the stream but the end."""
    config = _with_modes_for_all(source)
    mesh = _mesh_model(source, config)
    yield from source.leading_sections()
    if config.method_row.has_anchors:
        yield Section.ANCHOR_VERTICES, payloads.write_anchor_vertices(mesh.anchors)
    before: Quantized | None = None
    for start, vertices in source.blocks():
        progress("frames", start / source.sequence.n_frames)
        before = tracked_from(config.method_row, before, len(vertices))
        block = analyse(to_matrices(vertices, source.frame), mesh, config, before)
        yield from write_coded_block(block, len(vertices), config.method_row, before)
        before = block.basis
        if len(mesh.isolated):
            yield Section.EXACT, encode_floats(vertices[:, mesh.isolated])
    progress("frames", 1.0)


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
