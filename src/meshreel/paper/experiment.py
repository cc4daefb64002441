"""Experiments with the paper's method: steps of one's own, measured like the variants."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from meshreel.arrays import Floats, Integers, Vertices
from meshreel.codec.bitstream.container import Sections
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.memory import DEFAULT_LIMIT
from meshreel.codec.options import config_of
from meshreel.codec.paper_options import PaperOptions
from meshreel.codec.source import CodedMesh, Source
from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import Quality, compare
from meshreel.metrics.nmsve import nmsve_per_frame
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.sted import sted
from meshreel.model.sequence import Faces, MeshSequence, single_segment
from meshreel.paper.analysis import Replacements, n_frequencies
from meshreel.paper.encoder import BASES, PaperBlockCoder
from meshreel.paper.graph_fourier import basis_bytes, graph_fourier_basis
from meshreel.paper.laplacian import uniform_laplacian
from meshreel.paper.stream import PaperBlock, PaperStream, paper_block
from meshreel.paper.stream_rates import StreamRates, rates
from meshreel.paper.variants import METHODS, Basis, Signal, variant_named
from meshreel.runtime.progress import Progress, silent

LaplacianOf = str | csr_array | Callable[[MeshSequence], csr_array]
BasisOf = Callable[[Floats, Floats | None], Floats]
AnchorsOf = float | Sequence[int] | Callable[[MeshSequence], Sequence[int] | Integers]


@dataclass(frozen=True, eq=False)
class Known:
    """What a decoder knows before it reads the coefficients of a block; vertices in given order.

    Values are in units of `PaperStream.scale`, relative to `PaperStream.origin`.
    """

    faces: Faces
    """Integer array of shape (M, 3)."""
    laplacian: csr_array
    """L, of shape (V, V)."""
    anchors: Integers
    """Integer array of shape (A,). Vertices, ascending."""
    basis: Floats
    """float64 array of shape (3, T, K). The decoded eigen-trajectories of the block."""
    anchor_positions: Floats | None
    """float64 array of shape (3, T, A), or None for `v2v`. Decoded."""
    previous: tuple[PaperBlock, ...]
    """The blocks before this one, decoded."""


PredictorOf = Callable[[Known], Floats]


@dataclass(frozen=True, eq=False)
class Experiment:
    """Measurements of a variant, and its arrays."""

    stream: PaperStream
    """Laplacian, anchors, basis and coefficients, as from `read`."""
    vertices: Vertices
    """float array of shape (T, V, 3). Decoded positions, in model units."""
    rates: StreamRates
    """Rates by Eq. 13 and as stored."""
    size_bytes: int
    """Size of a file without vertex order."""
    rate_bpvf: float
    """Bits of the file per vertex and frame: three coordinates, connectivity and headers."""
    quality: Quality
    """KG error, STED, NMSVE per frame, largest error and others."""

    def __repr__(self) -> str:
        return (
            f"<Experiment {self.stream.method}: q_s {self.rates.eq13.q_s:.4g} (Eq. 13), "
            f"{self.rates.stored.q_s:.4g} (stored), {self.rate_bpvf:.4g} bpvf, "
            f"KG error {self.quality.kg_error_percent:.4g} %, STED {self.quality.sted:.4g}, "
            f"NMSVE {self.quality.nmsve_mean:.3g}, "
            f"largest error {self.quality.max_error_percent:.4g} %>"
        )


def experiment(
    sequence: MeshSequence,
    method: str = "pca-qp",
    *,
    laplacian: LaplacianOf | None = None,
    basis: BasisOf | None = None,
    anchors: AnchorsOf | None = None,
    predictor: PredictorOf | None = None,
    progress: Progress = silent,
    **options: Any,
) -> Experiment:
    """Run a variant of the paper with steps of your own, and measure it.

    Without them, rates and positions are those of `meshreel.encode` and `meshreel.decode`.
    Functions receive and return vertices in the given order.

    Parameters
    ----------
    sequence : MeshSequence
        Of one segment; tracks are not coded.
    method : str
        The variant whose other steps are used, one of `METHODS`.
    laplacian : str, csr_array of shape (V, V), or callable, optional
        L of the deltas, or a function that returns it for the sequence; text is the option of
        `meshreel.encode`. Its bits are not counted: a decoder must be able to derive it.
    basis : callable, optional
        ``basis(matrices, previous)`` returns a float array of shape (3, T, K) with orthonormal
        columns for the coordinate matrices A of a block, of shape (3, T, V). `previous` is the
        decoded basis of the previous block if `method` is "blocks" and it has as many frames, else
        None. Not for `gft`.
    anchors : float, sequence of int, or callable, optional
        Share of the vertices, vertices, or a function that returns vertices for the sequence.
    predictor : callable, optional
        ``predictor(known)`` returns predicted coefficients of shape (3, K, V) from what a decoder
        has, a `Known`. Residuals have the quantization step of the coefficients. Not for `gft`.
    progress : callable, optional
        Called with the stage and the completed share.
    options
        Others of `meshreel.encode`: `n_modes`, `bits`, `block_frames`, `choices`, ...

    Returns
    -------
    Experiment

    Raises
    ------
    InvalidInputError
        If an option has no effect, or a step returns an array of the wrong shape, or values that
        are not finite.
    SolverError
        If L and the anchors do not determine the vertices.

    Examples
    --------
    >>> mean = experiment(sequence, n_modes=20, bits=8, laplacian="combinatorial")
    >>> mean.rates.eq13.q_s, mean.quality.kg_error_percent
    """
    steps = Steps(laplacian, basis, anchors, predictor)
    return ExperimentSeries(sequence).run(method, options, steps, progress).measure()


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps that replace those of a variant, as parameters of `experiment`."""

    laplacian: LaplacianOf | None = None
    basis: BasisOf | None = None
    anchors: AnchorsOf | None = None
    predictor: PredictorOf | None = None


class ExperimentSeries:
    """Experiments on a sequence; they share its connectivity, systems and graph Fourier basis."""

    def __init__(self, sequence: MeshSequence) -> None:
        single_segment(sequence, "an experiment")
        self.sequence = sequence
        self._source: Source | None = None

    def run(
        self,
        method: str,
        options: dict[str, Any],
        steps: Steps | None = None,
        progress: Progress = silent,
    ) -> "EncodedExperiment":
        """Encode with a variant; options and errors as of `experiment`."""
        if "order" in options:
            raise InvalidInputError("order has no effect on experiments: files drop it; omit it")
        steps = Steps() if steps is None else steps
        if isinstance(steps.laplacian, str):
            options = {**options, "laplacian": steps.laplacian}
            steps = replace(steps, laplacian=None)
        if steps.anchors is not None:
            chosen = steps.anchors(self.sequence) if callable(steps.anchors) else steps.anchors
            is_share = isinstance(chosen, int | float)
            options = {**options, "anchors": chosen if is_share else np.asarray(chosen).tolist()}
        config = config_of(method, order="drop", **options)
        if not isinstance(config, PaperOptions):
            raise InvalidInputError(
                f"method {method} is not one of the paper's; choose from {', '.join(METHODS)}"
            )
        _check_steps(config, steps)
        if self._source is None:
            self._source = Source(self.sequence, config)
        source = self._source.with_changes(config=config)
        if variant_named(config.method).basis is Basis.GRAPH:
            _share_frequencies(source.mesh, config)
        return EncodedExperiment(self.sequence, source, steps, progress)


def _share_frequencies(mesh: CodedMesh, config: PaperOptions) -> None:
    """Take the graph Fourier basis from a larger one.

    The second time that an experiment needs a larger one, all frequencies are computed, if the
    memory limit allows it: the dense solver computes them anyway.
    """
    n_modes, n_verts = n_frequencies(config.n_modes, mesh.n_verts), mesh.n_verts
    kept: dict[int, Floats] = mesh.derived.setdefault(BASES, {})
    if not kept:
        return  # the mesh model computes the first one
    limit = config.memory_bytes or DEFAULT_LIMIT.limit_bytes
    if max(kept) < n_modes and basis_bytes(n_verts, n_verts) <= limit:
        laplacian = uniform_laplacian(mesh.faces, n_verts)
        kept[n_verts] = graph_fourier_basis(laplacian, n_verts, memory=config.memory)
    if n_modes < max(kept):
        kept[n_modes] = kept[max(kept)][:, :n_modes]


class EncodedExperiment:
    """An encoded sequence: the arrays of its stream, and the size of its file."""

    def __init__(
        self, sequence: MeshSequence, source: Source, steps: Steps, progress: Progress
    ) -> None:
        self._sequence, self._steps, self._progress = sequence, steps, progress
        self._order = source.mesh.order
        self._coder = PaperBlockCoder(
            source.mesh,
            source.frame,
            source.blocks(),
            progress,
            Replacements(
                None if steps.laplacian is None else self._laplacian(),
                None if steps.basis is None else self._basis,
                None if steps.predictor is None else self._prediction,
            ),
        )
        self.stream = PaperStream(
            method=source.config.method,
            faces=sequence.faces,
            blocks=(),
            origin=source.frame.origin,
            scale=source.frame.scale,
            dtype=source.dtype,
            order=inverse_permutation(self._order),
            mesh=self._coder.mesh,
        )
        coded = [self._coded(vertices) for vertices in source.blocks()]
        self.size_bytes = len(source.stream(self._coder.leading_sections(), coded))

    @property
    def rate_bpvf(self) -> float:
        """Bits of the file per vertex and frame."""
        return 8 * self.size_bytes / (self.stream.n_verts * self.stream.n_frames)

    def measure(self) -> Experiment:
        """Decode and compare all frames."""
        self._progress("decoding", 0.0)
        vertices = self.stream.reconstruct()
        decoded = MeshSequence(vertices, self._sequence.faces)
        quality = compare(self._sequence, decoded, progress=self._progress)
        return Experiment(
            self.stream, vertices, rates(self.stream), self.size_bytes, self.rate_bpvf, quality
        )

    def errors_of(self, numbers: Sequence[int]) -> dict[str, float]:
        """KG error, STED and mean NMSVE of some frames, by their names in `Quality`."""
        original, faces = self._sequence.vertices[list(numbers)], self._sequence.faces
        decoded = self.stream.frames(numbers)
        return {
            "kg_error_percent": position_errors(original, decoded).kg_error_percent,
            "sted": sted(original, decoded, faces).sted,
            "nmsve_mean": float(nmsve_per_frame(original, decoded, faces).mean()),
        }

    def _coded(self, vertices: Vertices) -> tuple[int, Sections]:
        """Encode the next block, and append its arrays to those of the stream."""
        start, n_frames = self.stream.n_frames, len(vertices)
        self._progress("encoding", start / self._sequence.n_frames)
        block, reference = self._coder.analyse(vertices)
        isolated = vertices[:, self._coder.mesh.isolated]
        arrays = paper_block(
            self.stream,
            block,
            start,
            n_frames,
            isolated if isolated.size else None,
            is_difference=reference is not None,
        )
        self.stream = replace(self.stream, blocks=(*self.stream.blocks, arrays))
        return n_frames, [*self._coder.write(block, reference, vertices)]

    def _laplacian(self) -> csr_array:
        """L in internal order."""
        given = self._steps.laplacian
        matrix: Any = given(self._sequence) if callable(given) else given
        n_verts, found = self._sequence.n_verts, getattr(matrix, "shape", None)
        if found != (n_verts, n_verts) or not hasattr(matrix, "tocsr"):
            raise InvalidInputError(
                f"laplacian must be a sparse matrix of shape ({n_verts}, {n_verts}); got "
                f"{type(matrix).__name__} of shape {found}"
            )
        in_order = csr_array(matrix).astype(np.float64)[self._order][:, self._order]
        if not np.isfinite(in_order.data).all():
            raise InvalidInputError("laplacian has entries that are not finite")
        return csr_array(in_order)

    def _basis(self, matrices: Floats, previous: Floats | None) -> Floats:
        assert self._steps.basis is not None  # else this function is not a replacement
        n_frames = matrices.shape[1]
        basis = np.asarray(self._steps.basis(matrices[:, :, self.stream.order], previous))
        n_modes = basis.shape[2] if basis.ndim == 3 else 0
        if not 1 <= n_modes <= n_frames:
            raise InvalidInputError(
                f"basis must return an array of shape (3, {n_frames}, K) with K in 1..{n_frames}; "
                f"got {basis.shape}"
            )
        return _checked(basis, (3, n_frames, n_modes), "basis")

    def _prediction(self, basis: Floats, anchor_positions: Floats | None) -> Floats:
        assert self._steps.predictor is not None
        stream = self.stream
        if anchor_positions is not None:
            anchor_positions = anchor_positions[:, :, stream.anchor_order]
        known = Known(
            stream.faces, stream.laplacian, stream.anchors, basis, anchor_positions, stream.blocks
        )
        shape = 3, basis.shape[2], stream.n_verts
        predicted = np.asarray(self._steps.predictor(known))
        return _checked(predicted, shape, "predictor")[:, :, self._order]


def _check_steps(config: PaperOptions, steps: Steps) -> None:
    """Raise InvalidInputError if a step has no effect, or excludes an option."""
    variant = variant_named(config.method)
    if steps.laplacian is not None and variant.signal is not Signal.DELTAS:
        raise InvalidInputError(f"method {variant.name} codes no deltas; omit laplacian")
    for name in ("basis", "predictor"):
        if variant.basis is Basis.GRAPH and getattr(steps, name) is not None:
            raise InvalidInputError(
                f"method {variant.name} projects on graph frequencies, without {name}; omit it, or "
                "choose another method"
            )
    for name in ("n_modes", "energy"):
        if steps.basis is not None and getattr(config, name) is not None:
            raise InvalidInputError(f"{name} has no effect: basis chooses the modes; omit it")


def _checked(values: Floats, shape: tuple[int, ...], name: str) -> Floats:
    """The values of a replaced step; raises InvalidInputError if they do not fit."""
    if values.shape != shape:
        raise InvalidInputError(f"{name} must return an array of shape {shape}; got {values.shape}")
    if not np.isfinite(values).all():
        raise InvalidInputError(f"{name} returned values that are not finite")
    return values.astype(np.float64)
