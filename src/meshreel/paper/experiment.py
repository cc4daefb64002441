"""Experiments with the paper's method: steps of one's own, measured like the variants."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, issparse

from meshreel.arrays import Floats, Integers, Vertices
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
from meshreel.paper.stream_rates import StreamRates, rates, rates_of
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
    quality: Quality
    """KG error, STED, NMSVE per frame, largest error and others."""

    @property
    def rate_bpvf(self) -> float:
        """Bits of the file per vertex and frame: three coordinates, connectivity and headers."""
        return 8 * self.size_bytes / (self.stream.n_verts * self.stream.n_frames)

    def __repr__(self) -> str:
        return (
            f"<Experiment {self.stream.method}: q_s {self.rates.eq13.q_s:.4g} (Eq. 13), "
            f"{self.rates.stored.q_s:.4g} (stored), {self.rate_bpvf:.4g} bpvf, "
            f"KG error {self.quality.kg_error_percent:.4g} %, STED {self.quality.sted:.4g}, "
            f"NMSVE {self.quality.nmsve_mean:.3g}, "
            f"largest error {self.quality.max_error_percent:.4g} %>"
        )


@dataclass(frozen=True, eq=False)
class Sample:
    """Rates of a variant, and errors of some frames."""

    rates: StreamRates
    rate_bpvf: float
    """Of all frames, as in `Experiment`."""
    errors: dict[str, float]
    """"kg_error_percent", "sted" and "nmsve_mean"; each frame counts its own as in `Quality`."""


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
    series = ExperimentSeries(sequence)
    return series.run(
        method,
        laplacian=laplacian,
        basis=basis,
        anchors=anchors,
        predictor=predictor,
        progress=progress,
        **options,
    )


class ExperimentSeries:
    """Experiments on a sequence; they share its connectivity, systems and graph Fourier basis."""

    def __init__(self, sequence: MeshSequence) -> None:
        single_segment(sequence, "an experiment")
        self._sequence = sequence
        self._source: Source | None = None

    @property
    def n_frames(self) -> int:
        """Number of frames of the sequence."""
        return self._sequence.n_frames

    def run(
        self,
        method: str,
        *,
        laplacian: LaplacianOf | None = None,
        basis: BasisOf | None = None,
        anchors: AnchorsOf | None = None,
        predictor: PredictorOf | None = None,
        progress: Progress = silent,
        **options: Any,
    ) -> Experiment:
        """Run one experiment, as `experiment`."""
        return self._run(
            method,
            laplacian=laplacian,
            basis=basis,
            anchors=anchors,
            predictor=predictor,
            progress=progress,
            **options,
        ).measure()

    def sample(self, method: str, numbers: Sequence[int], **options: Any) -> Sample:
        """Rates of an experiment, and errors of the frames with these numbers, much faster.

        Parameters
        ----------
        options
            As for `run`.
        """
        return self._run(method, **options).sample(numbers)

    def _run(
        self,
        method: str,
        *,
        laplacian: LaplacianOf | None = None,
        basis: BasisOf | None = None,
        anchors: AnchorsOf | None = None,
        predictor: PredictorOf | None = None,
        progress: Progress = silent,
        **options: Any,
    ) -> "_Run":
        if "order" in options:
            raise InvalidInputError("order has no effect on experiments: files drop it; omit it")
        if isinstance(laplacian, str):
            options["laplacian"], laplacian = laplacian, None
        if anchors is not None:
            chosen = anchors(self._sequence) if callable(anchors) else anchors
            options["anchors"] = chosen if isinstance(chosen, int | float) else [*map(int, chosen)]
        config = config_of(method, order="drop", **options)
        if not isinstance(config, PaperOptions):
            raise InvalidInputError(
                f"method {method} is not one of the paper's; choose from {', '.join(METHODS)}"
            )
        _check_replaced(config, laplacian, basis, predictor)
        if self._source is None:
            self._source = Source(self._sequence, config)
        source = self._source.with_changes(config=config)
        if variant_named(config.method).basis is Basis.GRAPH:
            self._share_frequencies(source.mesh, config)
        return _Run(self._sequence, source, laplacian, basis, predictor, progress)

    def _share_frequencies(self, mesh: CodedMesh, config: PaperOptions) -> None:
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


class _Run:
    """One experiment: the coder with replaced steps, and the arrays of its stream."""

    def __init__(
        self,
        sequence: MeshSequence,
        source: Source,
        laplacian: csr_array | Callable[[MeshSequence], csr_array] | None,
        basis: BasisOf | None,
        predictor: PredictorOf | None,
        progress: Progress,
    ) -> None:
        self._sequence, self._source, self._progress = sequence, source, progress
        self._basis, self._predictor = basis, predictor
        self._order = source.mesh.order
        self._coder = PaperBlockCoder(
            source.mesh,
            source.frame,
            source.blocks(),
            progress,
            Replacements(
                None if laplacian is None else self._own_laplacian(laplacian),
                None if basis is None else self._own_basis,
                None if predictor is None else self._predicted,
            ),
        )
        self._stream = PaperStream(
            method=source.config.method,
            faces=sequence.faces,
            blocks=(),
            origin=source.frame.origin,
            scale=source.frame.scale,
            dtype=source.dtype,
            order=inverse_permutation(self._order),
            mesh=self._coder.mesh,
        )

    def measure(self) -> Experiment:
        """Encode, decode and compare."""
        size_bytes = self._encode()
        self._progress("decoding", 0.0)
        vertices = self._stream.reconstruct()
        decoded = MeshSequence(vertices, self._sequence.faces)
        quality = compare(self._sequence, decoded, progress=self._progress)
        return Experiment(self._stream, vertices, rates(self._stream), size_bytes, quality)

    def sample(self, numbers: Sequence[int]) -> Sample:
        """Encode all frames, and decode and compare some."""
        size_bytes = self._encode()
        original, faces = self._sequence.vertices[list(numbers)], self._sequence.faces
        decoded = self._stream.frames(numbers)
        bpvf = 8 * size_bytes / (self._stream.n_verts * self._stream.n_frames)
        errors = {
            "kg_error_percent": position_errors(original, decoded).kg_error_percent,
            "sted": sted(original, decoded, faces).sted,
            "nmsve_mean": float(nmsve_per_frame(original, decoded, faces).mean()),
        }
        return Sample(rates_of(self._stream, has_coded_rows=False), bpvf, errors)

    def _encode(self) -> int:
        """Encode all blocks, and return the size of the file without vertex order."""
        source, start, coded = self._source, 0, []
        for vertices in source.blocks():
            self._progress("encoding", start / source.n_frames)
            block, reference = self._coder.analyse(vertices)
            n_frames = len(vertices)
            coded.append((n_frames, [*self._coder.write(block, reference, vertices)]))
            isolated = vertices[:, self._coder.mesh.isolated]
            arrays = paper_block(
                self._stream,
                block,
                start,
                n_frames,
                isolated if isolated.size else None,
                is_difference=reference is not None,
            )
            self._stream = replace(self._stream, blocks=(*self._stream.blocks, arrays))
            start += n_frames
        return len(source.stream(self._coder.leading_sections(), coded))

    def _own_laplacian(
        self, laplacian: csr_array | Callable[[MeshSequence], csr_array]
    ) -> csr_array:
        """L in internal order."""
        matrix = laplacian(self._sequence) if callable(laplacian) else laplacian
        n_verts = self._sequence.n_verts
        if not issparse(matrix) or matrix.shape != (n_verts, n_verts):
            raise InvalidInputError(
                f"laplacian must be a sparse matrix of shape ({n_verts}, {n_verts}); got "
                f"{type(matrix).__name__} of shape {getattr(matrix, 'shape', None)}"
            )
        in_order = csr_array(matrix).astype(np.float64)[self._order][:, self._order]
        if not np.isfinite(in_order.data).all():
            raise InvalidInputError("laplacian has entries that are not finite")
        return csr_array(in_order)

    def _own_basis(self, matrices: Floats, previous: Floats | None) -> Floats:
        assert self._basis is not None  # else this function is not a replacement
        n_frames = matrices.shape[1]
        basis = np.asarray(self._basis(matrices[:, :, self._stream.order], previous), np.float64)
        n_modes = basis.shape[2] if basis.ndim == 3 else 0
        if not 1 <= n_modes <= n_frames:
            raise InvalidInputError(
                f"basis must return an array of shape (3, {n_frames}, K) with K in 1..{n_frames}; "
                f"got {basis.shape}"
            )
        return _checked(basis, (3, n_frames, n_modes), "basis")

    def _predicted(self, basis: Floats, anchor_positions: Floats | None) -> Floats:
        assert self._predictor is not None
        stream = self._stream
        if anchor_positions is not None:
            anchor_positions = anchor_positions[:, :, stream.anchor_order]
        known = Known(
            stream.faces,
            stream.laplacian,
            stream.anchors,
            basis,
            anchor_positions,
            stream.blocks,
        )
        shape = 3, basis.shape[2], stream.n_verts
        predicted = np.asarray(self._predictor(known), np.float64)
        return _checked(predicted, shape, "predictor")[:, :, self._order]


def _check_replaced(
    config: PaperOptions,
    laplacian: object,
    basis: BasisOf | None,
    predictor: PredictorOf | None,
) -> None:
    """Raise InvalidInputError if a replaced step has no effect or excludes an option."""
    variant = variant_named(config.method)
    if laplacian is not None and variant.signal is not Signal.DELTAS:
        raise InvalidInputError(f"method {variant.name} codes no deltas; omit laplacian")
    if variant.basis is Basis.GRAPH:
        for name, step in (("basis", basis), ("predictor", predictor)):
            if step is not None:
                raise InvalidInputError(
                    f"method {variant.name} projects on graph frequencies, without {name}; omit "
                    "it, or choose another method"
                )
    for name in ("n_modes", "energy"):
        if basis is not None and getattr(config, name) is not None:
            raise InvalidInputError(f"{name} has no effect: basis chooses the modes; omit it")


def _checked(values: Floats, shape: tuple[int, ...], name: str) -> Floats:
    """The values of a replaced step; raises InvalidInputError if they do not fit."""
    if values.shape != shape:
        raise InvalidInputError(f"{name} must return an array of shape {shape}; got {values.shape}")
    if not np.isfinite(values).all():
        raise InvalidInputError(f"{name} returned values that are not finite")
    return values
