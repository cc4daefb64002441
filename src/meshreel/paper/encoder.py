"""Encoder of blocks of frames with the paper's variants."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.arrays import Vertices
from meshreel.codec.bitstream.container import Sections
from meshreel.codec.bitstream.layout import Laplacian, Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.memory import DEFAULT_LIMIT
from meshreel.codec.paper_options import PaperOptions
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame, to_matrices
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.tracks import Track
from meshreel.paper import blocks
from meshreel.paper.analysis import (
    THE_PAPERS,
    Replacements,
    analyse,
    modes_needed,
    n_frequencies,
)
from meshreel.paper.anchors import check_anchors, choose_anchors
from meshreel.paper.blocks import initial_basis, write_coded_block
from meshreel.paper.coded_values import CodedBlock, Quantized
from meshreel.paper.exact_values import encode_exact
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.quantization import step_for_all_rows
from meshreel.paper.settings import anchors_of, choices
from meshreel.paper.variants import Basis, Variant, variant_named
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Progress, silent

BASES = "graph Fourier bases"
"""Key of the graph Fourier bases that coders of the same mesh share, in `CodedMesh.derived`."""

SHAPE_BITS = 12
"""Bits of the largest coordinate of the shape from which cotangent weights are computed."""


class PaperBlockCoder:
    """Codes blocks of frames in order; a tracked basis is passed from each to the next.

    Parameters
    ----------
    known_blocks : iterable of float arrays of shape (T_b, V, 3)
        Blocks that determine the number of modes of a tracked basis, which is the same in all
        blocks: all blocks, or only the first if the others are not known yet.
    progress : callable, optional
        Called before the graph Fourier basis is computed.
    replacements : Replacements, optional
        Steps that an experiment replaces; streams with them cannot be decoded from their bytes.

    Raises
    ------
    InvalidInputError
        If the anchors do not fit the mesh, or the graph Fourier basis takes too much memory, or,
        with the default number of frequencies, too much time.
    """

    def __init__(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        known_blocks: Iterable[Vertices],
        progress: Progress = silent,
        replacements: Replacements = THE_PAPERS,
    ) -> None:
        self._frame = frame
        self._replacements = replacements
        config = mesh.config
        assert isinstance(config, PaperOptions)  # those of these methods
        self._variant = variant_named(config.method)
        blocks = iter(known_blocks)
        first = next(blocks)
        self._config = config
        if replacements.basis is None:
            _check_modes(mesh, self._variant, len(first))
            if self._variant.basis is Basis.TRACKED and config.n_modes is None:
                # A tracked basis has the same number of modes in all blocks.
                n_modes = max(modes_needed(each, frame, config) for each in chain([first], blocks))
                self._config = replace(config, n_modes=n_modes, energy=None)
        self._shape: Quantized | None = None
        if config.laplacian_choice is Laplacian.COTANGENT:
            coordinates = to_matrices(first[:1], frame)
            self._shape = Quantized.of(coordinates, step_for_all_rows(coordinates, SHAPE_BITS))
        self.mesh = _mesh_model(mesh, self._config, self._shape, replacements.laplacian)
        self._dictionary: Quantized | None = None
        if self._variant.basis is Basis.GRAPH:
            n_modes = n_frequencies(self._config.n_modes, mesh.n_verts)
            self.mesh.graph_fourier_basis(n_modes, progress)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections between the connectivity and the first block."""
        if self._variant.has_anchors:
            yield Section.ANCHOR_VERTICES, blocks.write_anchor_vertices(self.mesh.anchors)
        if self._shape is not None:
            yield Section.SHAPE, blocks.write_curves(self._shape)

    def code(self, vertices: Vertices, tracks: Mapping[str, Track] | None = None) -> Sections:
        """The sections of the next block.

        Parameters
        ----------
        vertices : float array of shape (T_b, V, 3)
            In internal order.
        tracks : mapping, optional
            Always empty: these methods code positions.
        """
        return self.write(*self.analyse(vertices), vertices)

    def write(self, block: CodedBlock, reference: Quantized | None, vertices: Vertices) -> Sections:
        """The sections of a block from `analyse`, with the exact positions of isolated vertices."""
        isolated = self.mesh.isolated
        exact = encode_exact(vertices[:, isolated]) if len(isolated) else b""
        return write_coded_block(block, len(vertices), self._variant, reference, exact)

    def analyse(self, vertices: Vertices) -> tuple[CodedBlock, Quantized | None]:
        """The integers of the next block, and the dictionary from which its own differs, if any.

        Parameters
        ----------
        vertices : float array of shape (T_b, V, 3)
            In internal order.
        """
        reference = initial_basis(self._variant, self._dictionary, len(vertices))
        block = analyse(
            vertices, self._frame, self.mesh, self._config, reference, self._replacements
        )
        self._dictionary = block.basis
        is_whole = choices(self._config).dictionary == "whole"
        if is_whole or (reference and block.basis and reference.shape != block.basis.shape):
            reference = None
        return block, reference


def _check_modes(mesh: CodedMesh, variant: Variant, block_frames: int) -> None:
    """Raise InvalidInputError if a block has fewer modes than the options request."""
    n_modes = mesh.config.n_modes or 1
    if variant.basis is Basis.GRAPH:
        if n_modes > mesh.n_verts:
            raise InvalidInputError(
                f"n_modes={n_modes} exceeds the {mesh.n_verts} graph frequencies, one for each "
                f"vertex; give at most {mesh.n_verts}"
            )
    elif n_modes > block_frames:
        raise InvalidInputError(
            f"n_modes={n_modes} exceeds the {counted(block_frames, 'frame')} of a block, each of "
            f"which adds a mode; give at most {block_frames}, or longer blocks (",
            Keyword("block_frames"),
            ")",
        )


def _mesh_model(
    mesh: CodedMesh,
    config: PaperOptions,
    shape: Quantized | None,
    own_laplacian: csr_array | None = None,
) -> MeshModel:
    """The model of a mesh; coders of the same mesh share it."""
    anchors: npt.NDArray[np.int64] = np.zeros(0, np.int64)
    if variant_named(config.method).has_anchors:
        chosen, options = anchors_of(config), choices(config)
        if isinstance(chosen, Sequence):
            vertices = check_anchors(chosen, mesh.given_faces, mesh.n_verts)
            anchors = np.sort(inverse_permutation(mesh.order)[vertices])
        else:
            is_random = options.anchor_set == "random"
            rng = np.random.default_rng(options.anchor_seed) if is_random else None
            anchors = choose_anchors(mesh.faces, mesh.n_verts, chosen, rng)
    positions = None if shape is None else shape.values[:, 0].T
    basis_memory = None
    if config.n_modes is not None:
        basis_memory = config.memory_bytes or DEFAULT_LIMIT.limit_bytes
    key = MeshModel, anchors.tobytes(), config.laplacian_choice, basis_memory, id(own_laplacian)
    if key not in mesh.derived:
        mesh.derived[key] = MeshModel(
            mesh.faces,
            mesh.n_verts,
            anchors,
            config.laplacian_choice,
            positions,
            basis_memory=basis_memory,
            own_laplacian=own_laplacian,
            bases=mesh.derived.setdefault(BASES, {}),
        )
    model: MeshModel = mesh.derived[key]
    return model
