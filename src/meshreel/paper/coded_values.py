"""Values of a block of frames: quantized, as in a stream, and dequantized, as decoders use them."""

from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.paper.basis import expand
from meshreel.paper.quantization import Steps, dequantize, quantize


@dataclass(frozen=True)
class Quantized:
    """Integers of shape (3, rows, columns), and their quantization steps."""

    integers: Integers
    """int64 array of shape (3, rows, columns)."""
    steps: Steps
    """float32 array of shape (1,) or (rows,)."""

    @classmethod
    def of(cls, values: Floats, steps: Steps) -> "Quantized":
        """Quantize values with these steps."""
        return cls(quantize(values, steps), steps)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the integers."""
        return self.integers.shape

    @property
    def values(self) -> Floats:
        """The dequantized values."""
        return dequantize(self.integers, self.steps)


@dataclass(frozen=True)
class Anchors:
    """Anchors of a block: coefficients on its modes, and residuals of their positions.

    Positions are the product of basis and coefficients plus the residuals. One of the two may be
    missing: without residuals only motion within the span of the modes is coded; on graph
    frequencies (`gft`) the positions are not predicted.
    """

    coefficients: Quantized | None
    """Quantized of shape (3, K, A), or None."""
    residuals: Quantized | None
    """Quantized of shape (3, A, T), or None."""


@dataclass(frozen=True, eq=False)
class BlockValues:
    """Dequantized values of a block of frames."""

    basis: Floats | None
    """float64 array of shape (3, T, K), or None. Eigen-trajectories of each axis as columns. None
    on graph frequencies (`gft`).
    """
    coefficients: Floats
    """float64 array of shape (3, K, V), or (3, K, T) on graph frequencies. Possibly fewer rows than
    the basis has columns (`truncated`).
    """
    anchor_coefficients: Floats | None
    """float64 array of shape (3, K, A), or None. Coefficients of the anchors on the leading modes.
    """
    anchor_residuals: Floats | None
    """float64 array of shape (3, A, T), or None. Anchor positions less their prediction from the
    coefficients.
    """

    @property
    def n_modes(self) -> int:
        """Number of modes of each axis, or of graph frequencies, K."""
        return int(self.coefficients.shape[1])

    @property
    def anchor_positions(self) -> Floats | None:
        """Decoded positions of the anchors (Eq. 12), of shape (3, T, A); None without anchors."""
        predicted: Floats | float = 0.0
        if self.anchor_coefficients is not None:
            assert self.basis is not None  # the coefficients refer to its modes
            n_modes = self.anchor_coefficients.shape[1]
            predicted = expand(self.basis[:, :, :n_modes], self.anchor_coefficients)
        elif self.anchor_residuals is None:
            return None
        if self.anchor_residuals is None:
            return np.asarray(predicted)
        return np.asarray(predicted + np.swapaxes(self.anchor_residuals, 1, 2))

    def truncated(self, n_modes: int) -> "BlockValues":
        """The block with the first rows of coefficients only (the paper's k_l).

        Anchors with coded positions keep all of their motion; others keep the coefficients of the
        same modes.
        """
        anchors = self.anchor_coefficients
        if anchors is not None and self.anchor_residuals is None:
            anchors = anchors[:, :n_modes]
        return replace(
            self, coefficients=self.coefficients[:, :n_modes], anchor_coefficients=anchors
        )


@dataclass(frozen=True)
class CodedBlock:
    """Integers of a block of frames: its stored data except isolated vertices.

    On eigen-trajectories a row belongs to a mode. On graph frequencies (`gft`) a row of
    coefficients is a frequency over time.
    """

    basis: Quantized | None
    """Quantized of shape (3, K, T), or None. The dictionary: a row for each eigen-trajectory of
    each axis. None on graph frequencies.
    """
    anchors: Anchors | None
    coefficients: Quantized
    """Quantized of shape (3, K, V), or (3, K, T) on graph frequencies."""
    prediction: Floats | None = None
    """float64 array of the same shape, or None. Prediction of the coefficients in an experiment;
    `coefficients` are then the residual.
    """

    @property
    def n_modes(self) -> int:
        """Modes of each axis, or graph frequencies, K."""
        return int(self.coefficients.integers.shape[1])

    @property
    def values(self) -> BlockValues:
        """The dequantized values."""
        coefficients = residuals = None
        if self.anchors is not None and self.anchors.coefficients is not None:
            coefficients = self.anchors.coefficients.values
        if self.anchors is not None and self.anchors.residuals is not None:
            residuals = self.anchors.residuals.values
        basis = None if self.basis is None else basis_columns(self.basis)
        decoded = self.coefficients.values
        if self.prediction is not None:
            decoded = decoded + self.prediction
        return BlockValues(basis, decoded, coefficients, residuals)


def basis_columns(basis: Quantized) -> Floats:
    """The basis vectors of a dictionary as columns, of shape (3, T, K)."""
    return np.swapaxes(basis.values, 1, 2)
