"""Streams of the paper's methods as arrays: basis, coefficients and anchors of each block."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from meshreel.arrays import Floats, Integers, Vertices
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.memory import memory_limit
from meshreel.codec.option import COUNT
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import CorruptStreamError, InvalidInputError, Keyword
from meshreel.model.sequence import Faces
from meshreel.paper.blocks import is_difference, stored_block
from meshreel.paper.coded_values import Anchors, BlockValues, CodedBlock, Quantized
from meshreel.paper.decoder import open_paper_stream
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.quantization import Steps
from meshreel.paper.synthesis import DecodedBlock, synthesise
from meshreel.paper.variants import Basis, variant_named
from meshreel.runtime.counting import counted, counts_text

ROUNDING = 1e-6
"""Largest distance of a value from a multiple of its step, in steps."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PaperBlock(BlockValues):
    """Dequantized arrays of a block of frames, with vertices in output order.

    The first axis of all arrays but `isolated_positions` is x, y, z. Values are in units of
    `PaperStream.scale`, relative to `PaperStream.origin`.

    Attributes
    ----------
    start : int
        Number of the first frame.
    n_frames : int
        Number of frames, T.
    basis : float64 array of shape (3, T, K), or None
        Eigen-trajectories U as columns (Eq. 5), rounded to `basis_steps`. None for `gft`, whose
        basis is `PaperStream.graph_fourier_basis`.
    coefficients : float64 array of shape (3, K, V), or (3, K, T) for `gft`
        Projected delta coordinates ``U^T (L A^T)^T`` after quantization (Eqs. 9 and 10); for `v2v`,
        projected coordinates ``U^T A``; for `gft`, the deltas of each frame on graph frequencies.
    anchor_coefficients : float64 array of shape (3, K, A), or None
        Coefficients of the anchors' positions on the basis. None for `v2v` and `gft`.
    anchor_residuals : float64 array of shape (3, A, T), or None
        Anchor positions minus the product of basis and coefficients. None for `v2v`, and if the
        stream has coefficients only: `pca`, `pca-q`, ``choices={"anchor_values": "coefficients"}``.
    isolated_positions : float array of shape (T, N, 3), or None
        Positions of `PaperStream.isolated` in model units, exact. None without isolated vertices.
    basis_steps, coefficient_steps, anchor_coefficient_steps, anchor_residual_steps : float32 arrays
        Quantization steps, of shape (1,) for all rows or (rows,) for each. None where the array
        is None.
    is_difference : bool
        Whether the stream stores the dictionary as the difference from that of the previous block.
    prediction : float64 array of the shape of `coefficients`, or None
        What an experiment subtracts from the coefficients before it quantizes them.
    """

    start: int
    n_frames: int
    isolated_positions: Vertices | None
    basis_steps: Steps | None
    coefficient_steps: Steps
    anchor_coefficient_steps: Steps | None
    anchor_residual_steps: Steps | None
    is_difference: bool = False
    prediction: Floats | None = None

    def __repr__(self) -> str:
        last = self.start + self.n_frames - 1
        return f"<PaperBlock: frames {self.start}..{last}, {counted(self.n_modes, 'mode')}>"


@dataclass(frozen=True, eq=False, repr=False)
class PaperStream:
    """A stream of one of the paper's seven methods as arrays; from `read`.

    Vertex numbers are those of the decoded sequence (output order). `reconstruct` computes with the
    arrays of `blocks`: reconstruct from changed arrays with ``dataclasses.replace``.

    Attributes
    ----------
    method : str
        One of `METHODS`.
    faces : integer array of shape (M, 3)
    blocks : tuple of PaperBlock
        In the order of their frames.
    origin : tuple of 3 floats
        Center of the bounding box of all frames, in model units.
    scale : float
        Diagonal of that box, in model units: a position is ``origin + scale * value``.
    dtype : dtype
        Number type of reconstructed positions, that of the encoded sequence.
    order : integer array of shape (V,)
        Internal number of each vertex; `MeshModel` and the bytes have this order.
    mesh : MeshModel
        Connectivity, anchors and Laplacian in internal order, with the factored system.
    """

    method: str
    faces: Faces
    blocks: tuple[PaperBlock, ...]
    origin: tuple[float, ...]
    scale: float
    dtype: np.dtype[np.floating]
    order: Integers
    mesh: MeshModel

    @property
    def n_frames(self) -> int:
        """Number of frames of all blocks, T."""
        return sum(block.n_frames for block in self.blocks)

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return self.mesh.n_verts

    @property
    def anchors(self) -> Integers:
        """Vertex numbers of the anchors, ascending; the order of all arrays of anchors.

        `pca` and `pca-q` have one in each connected component, `v2v` has none.
        """
        return np.sort(self._output_numbers(self.mesh.anchors))

    @property
    def isolated(self) -> Integers:
        """Vertices without an edge, ascending; deltas do not determine them."""
        return np.sort(self._output_numbers(self.mesh.isolated))

    @cached_property
    def laplacian(self) -> csr_array:
        """The Laplacian L of the deltas, of shape (V, V); `v2v` does not use it."""
        permuted = csr_array(self.mesh.laplacian[self.order][:, self.order])
        permuted.sort_indices()
        return permuted

    def graph_fourier_basis(self, n_modes: int) -> Floats:
        """Low-frequency eigenvectors of D - C, which `gft` projects deltas on (Eq. 6).

        Parameters
        ----------
        n_modes : int
            K, in 1..V; `PaperBlock.n_modes` for all rows of a block.

        Returns
        -------
        float64 array of shape (V, K), columns orthonormal, by ascending frequency

        Raises
        ------
        InvalidInputError
            If `n_modes` is out of range, or the basis would take too much memory or, unless the
            stream was read with `all_frequencies`, too much time.
        """
        return np.asarray(self.mesh.graph_fourier_basis(n_modes)[self.order])

    def reconstruct(self, n_modes: int | None = None) -> Vertices:
        """Vertex positions of all frames, from the arrays of the blocks.

        Least squares with the anchors (Eq. 12), or with one vertex of each component for `pca` and
        `pca-q` (Eq. 11); the product of basis and coefficients for `v2v`.

        Parameters
        ----------
        n_modes : int, optional
            Leading rows of coefficients to use of each block (the paper's k_l). Default: all.

        Returns
        -------
        float array of shape (T, V, 3), in model units
            The vertices of ``meshreel.decode(data, n_modes=n_modes)``.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1, a replaced array has the wrong shape, or the basis of `gft`
            takes too much; as `graph_fourier_basis`.
        CorruptStreamError
            If positions are not finite.
        SolverError
            If the system is singular to working precision.
        """
        if n_modes is not None:
            COUNT.check(n_modes, Keyword("n_modes"))
        vertices = np.empty((self.n_frames, self.n_verts, 3), self.dtype)
        n_done = 0
        for block in self.blocks:
            self._decode(block, n_modes).fill(vertices[n_done : n_done + block.n_frames], 0)
            n_done += block.n_frames
        if not np.isfinite(vertices).all():
            raise CorruptStreamError(
                "the blocks reconstruct to positions that are not finite; the stream is damaged"
            )
        return vertices

    def frames(self, numbers: Sequence[int]) -> Vertices:
        """Vertex positions of frames with these numbers, of shape (n, V, 3), as `reconstruct`."""
        vertices = np.empty((len(numbers), self.n_verts, 3), self.dtype)
        for block in self.blocks:
            inside = [
                (place, number - block.start)
                for place, number in enumerate(numbers)
                if block.start <= number < block.start + block.n_frames
            ]
            decoded = self._decode(block, None) if inside else None
            for place, number in inside:
                assert decoded is not None
                decoded.fill(vertices[place : place + 1], number)
        return vertices

    def __repr__(self) -> str:
        counts = counts_text(
            frame=self.n_frames,
            vertex=self.n_verts,
            anchor=len(self.mesh.anchors),
            block=len(self.blocks),
        )
        return f"<PaperStream {self.method}: {counts}>"

    def coded_block(self, block: PaperBlock) -> CodedBlock:
        """The integers of a block, possibly changed, in internal order.

        Raises
        ------
        InvalidInputError
            If an array has the wrong shape, lacks its steps, or is not made of multiples of them.
        """
        _check_shapes(block, self)
        values, residual, prediction = self._internal_values(block), block.coefficients, None
        if block.prediction is not None:
            prediction = self._internal_columns(block.prediction)
            residual = residual - block.prediction
        rows = None if values.basis is None else np.swapaxes(values.basis, 1, 2)
        arrays = {
            "basis": rows,
            "coefficients": self._internal_columns(residual),
            "anchor_coefficients": values.anchor_coefficients,
            "anchor_residuals": values.anchor_residuals,
        }
        integers = {
            name: _integers(array, block, name)
            for name, array in arrays.items()
            if array is not None
        }
        at_anchors = [integers.get("anchor_coefficients"), integers.get("anchor_residuals")]
        anchors = Anchors(*at_anchors) if any(at_anchors) else None
        return CodedBlock(integers.get("basis"), anchors, integers["coefficients"], prediction)

    def _internal_columns(self, coefficients: Floats) -> Floats:
        """Coefficients in internal order; a row of `gft` has a column for each frame."""
        if variant_named(self.method).basis is Basis.GRAPH:
            return coefficients
        return np.take(coefficients, inverse_permutation(self.order), axis=2)

    def _internal_values(self, block: PaperBlock) -> BlockValues:
        """The arrays of a block in internal order."""
        anchors = inverse_permutation(self.anchor_order)
        return BlockValues(
            block.basis,
            self._internal_columns(block.coefficients),
            _take(block.anchor_coefficients, anchors, axis=2),
            _take(block.anchor_residuals, anchors, axis=1),
        )

    def _decode(self, block: PaperBlock, n_modes: int | None) -> DecodedBlock:
        """Convert a block to the form of the decoder, which uses internal order."""
        _check_shapes(block, self)
        variant, values = variant_named(self.method), self._internal_values(block)
        if n_modes is not None:
            values = values.truncated(n_modes)
        # Values of a damaged stream may overflow; `reconstruct` checks the positions.
        with np.errstate(over="ignore", invalid="ignore"):
            frames_of = synthesise(values, self.mesh, variant, self.order, factor_once=True)
        return DecodedBlock(
            start=block.start,
            n_frames=block.n_frames,
            frames_of=frames_of,
            frame=BoundingFrame(self.origin, self.scale),
            exact=block.isolated_positions,
            exact_vertices=self.isolated,
        )

    def _output_numbers(self, vertices: Integers) -> Integers:
        """Output numbers of vertices in internal order."""
        return inverse_permutation(self.order)[vertices]

    @property
    def anchor_order(self) -> Integers:
        """Index of each anchor among the anchors of the mesh, which are in internal order."""
        return np.argsort(self._output_numbers(self.mesh.anchors))


def read(
    data: bytes | bytearray | memoryview | str | os.PathLike[str],
    *,
    all_frequencies: bool = False,
    memory: float | str | None = None,
) -> PaperStream:
    """Read a stream of one of the paper's methods as arrays.

    Parameters
    ----------
    data : bytes or path
        A stream from `meshreel.encode` with one of `METHODS`, or the path of a `.reel` file.
    all_frequencies : bool, default False
        Compute any number of graph frequencies of `gft`. By default `PaperStream`, like
        `meshreel.decode`, refuses bases that take more than a few minutes, because a damaged or
        hostile small stream may announce any number. All frequencies of 10,000 vertices take
        minutes and 1.6 GB, of 20,000 vertices eight times as long and 6.4 GB. The computed basis is
        kept with the stream.
    memory : float or str, optional
        Upper limit for a block and for the graph Fourier basis: bytes, or text such as "2GiB".
        Default: 2 GiB.

    Returns
    -------
    PaperStream

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or the stream has another method.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a complete stream that this build supports.
    MemoryLimitError
        If a block needs more memory than the limit.

    Examples
    --------
    >>> stream = meshreel.paper.read(meshreel.encode(sequence, "pca-qp"))
    >>> vertices = stream.reconstruct()
    """
    limit = memory_limit(memory)
    opened, decoder = open_paper_stream(bytes_of(data), limit)
    mesh = decoder.mesh
    if all_frequencies:
        mesh = replace(mesh, basis_memory=limit.limit_bytes)
    stream = PaperStream(
        method=opened.method,
        faces=opened.file.faces,
        blocks=(),
        origin=opened.frame.origin,
        scale=opened.frame.scale,
        dtype=opened.dtype,
        order=opened.file.stored_mesh[1].astype(np.int64),
        mesh=mesh,
    )
    stored = map(partial(stored_block, opened), range(opened.n_blocks))
    with np.errstate(over="ignore", invalid="ignore"):  # `reconstruct` checks the positions
        blocks = tuple(
            paper_block(
                stream,
                decoder.coded(block, number),
                block.start,
                block.n_frames,
                decoder.exact(block),
                is_difference=is_difference(block, variant_named(stream.method)),
            )
            for number, block in enumerate(stored)
        )
    return replace(stream, blocks=blocks)


def bytes_of(data: bytes | bytearray | memoryview | str | os.PathLike[str]) -> bytes:
    """Return the bytes of a stream, or of the file at a path; raises InvalidInputError."""
    if isinstance(data, bytes | bytearray | memoryview):
        return bytes(data)
    if not isinstance(data, str | os.PathLike):
        raise InvalidInputError(
            "read takes the bytes of a .reel stream, or the path of a .reel file; got "
            f"{type(data).__name__}"
        )
    try:
        return Path(data).read_bytes()
    except OSError as error:
        raise InvalidInputError(
            f"{data} cannot be read: {error.strerror}; give the path of a .reel file"
        ) from error


def paper_block(
    stream: PaperStream,
    coded: CodedBlock,
    start: int,
    n_frames: int,
    exact: Vertices | None,
    *,
    is_difference: bool,
) -> PaperBlock:
    """Convert a coded block to arrays in output order.

    Parameters
    ----------
    stream : PaperStream
        Its blocks are not used.
    exact : float array of shape (T, N, 3), or None
        Positions of isolated vertices in internal order.
    """
    values, anchors, prediction = coded.values, coded.anchors, coded.prediction
    coefficients = values.coefficients
    if values.basis is not None:
        coefficients = np.take(coefficients, stream.order, axis=2)
        prediction = _take(prediction, stream.order, axis=2)
    if exact is not None:
        exact = exact[:, np.argsort(stream._output_numbers(stream.mesh.isolated))]
    return PaperBlock(
        start=start,
        n_frames=n_frames,
        basis=values.basis,
        coefficients=coefficients,
        anchor_coefficients=_take(values.anchor_coefficients, stream.anchor_order, axis=2),
        anchor_residuals=_take(values.anchor_residuals, stream.anchor_order, axis=1),
        isolated_positions=exact,
        basis_steps=_steps_of(coded.basis),
        coefficient_steps=coded.coefficients.steps,
        anchor_coefficient_steps=_steps_of(None if anchors is None else anchors.coefficients),
        anchor_residual_steps=_steps_of(None if anchors is None else anchors.residuals),
        is_difference=is_difference,
        prediction=prediction,
    )


def _take(values: Floats | None, indices: Integers, axis: int) -> Floats | None:
    return None if values is None else np.take(values, indices, axis)


def _steps_of(quantized: Quantized | None) -> Steps | None:
    return None if quantized is None else quantized.steps


def _integers(values: Floats, block: PaperBlock, name: str) -> Quantized:
    """Return an array of a block, of shape (3, rows, columns), as integers.

    Raises
    ------
    InvalidInputError
        If it has no steps, or values that are not multiples of them.
    """
    steps = {
        "basis": block.basis_steps,
        "coefficients": block.coefficient_steps,
        "anchor_coefficients": block.anchor_coefficient_steps,
        "anchor_residuals": block.anchor_residual_steps,
    }[name]
    if steps is None or len(steps) not in (1, values.shape[1]):
        count = "none" if steps is None else len(steps)
        raise InvalidInputError(
            f"{name} of the block at frame {block.start} need 1 or {values.shape[1]} quantization "
            f"steps; got {count}"
        )
    quantized = Quantized.of(values, steps)
    allowed = ROUNDING * steps.astype(np.float64)[None, :, None]
    if np.any(np.abs(quantized.values - values) > allowed):
        raise InvalidInputError(
            f"{name} of the block at frame {block.start} are not multiples of their quantization "
            "steps; quantize them, or replace the steps too"
        )
    return quantized


def _check_shapes(block: PaperBlock, stream: PaperStream) -> None:
    """Raise InvalidInputError if arrays of a block, possibly replaced, do not fit the stream."""
    variant, n_modes, n_frames = variant_named(stream.method), block.n_modes, block.n_frames
    on_graph, n_anchors = variant.basis is Basis.GRAPH, len(stream.mesh.anchors)
    n_columns, n_isolated = n_frames if on_graph else stream.n_verts, len(stream.mesh.isolated)
    on_modes = variant.has_anchors and not on_graph
    expected = {
        "basis": None if on_graph else (3, n_frames, n_modes),
        "coefficients": (3, n_modes, n_columns),
        "prediction": None if block.prediction is None else (3, n_modes, n_columns),
        "anchor_coefficients": (3, n_modes, n_anchors) if on_modes else None,
        "anchor_residuals": (3, n_anchors, n_frames) if variant.has_anchors else None,
        "isolated_positions": (n_frames, n_isolated, 3) if n_isolated else None,
    }
    for name, shape in expected.items():
        array = getattr(block, name)
        is_optional = name == "anchor_residuals" and on_modes
        if (array is None and is_optional) or (None if array is None else array.shape) == shape:
            continue
        raise InvalidInputError(
            f"{name} of the block at frame {block.start} must "
            f"{'be None' if shape is None else f'have shape {shape}'} for a stream of "
            f"{stream.method}; got {'None' if array is None else f'shape {array.shape}'}"
        )
