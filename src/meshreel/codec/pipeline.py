"""The method itself: frames to integers and back, one call a line."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.config import EncoderConfig
from meshreel.codec.mesh_model import MeshModel
from meshreel.geometry.laplacian import delta_coordinates
from meshreel.quantization.uniform import dequantize, quantize, uniform_step
from meshreel.subspace.basis import project
from meshreel.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.subspace.rank import modes_for_energy

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

BASIS_BITS = 16
ANCHOR_BITS = 16


@dataclass(frozen=True)
class Quantized:
    """Integers and the step that makes them values again."""

    integers: Integers
    step: np.float32

    @classmethod
    def from_values(cls, values: Floats, bits: int) -> "Quantized":
        """The values, with a step that gives the largest of them `bits` bits."""
        step = uniform_step(values, bits)
        return cls(quantize(values, step), step)

    @property
    def values(self) -> Floats:
        """What the decoder sees of the values."""
        return dequantize(self.integers, self.step)


@dataclass(frozen=True)
class CodedBlock:
    """A block of frames as integers: all that is stored of it, apart from isolated vertices.

    Attributes
    ----------
    basis : Quantized, shape (3, K, T)
        The dictionary: a row for each eigen-trajectory of each axis.
    anchors : Quantized, shape (3, K, A)
        Coefficients of the anchors' trajectories.
    coefficients : Quantized, shape (3, K, V)
        Coefficients of the delta coordinates.
    """

    basis: Quantized
    anchors: Quantized
    coefficients: Quantized

    @property
    def n_modes(self) -> int:
        """Modes of each axis, K."""
        return int(self.basis.integers.shape[1])


def analyse(matrices: Floats, mesh: MeshModel, config: EncoderConfig) -> CodedBlock:
    """A block of frames as integers.

    Parameters
    ----------
    matrices : float64 array of shape (3, T, V)
        Coordinate matrices A, in internal vertex order (`subspace.trajectories`).
    mesh : MeshModel
    config : EncoderConfig
    """
    trajectories = _leading_trajectories(matrices, config)
    basis = Quantized.from_values(np.swapaxes(trajectories, 1, 2), BASIS_BITS)
    # Onto the dictionary as the decoder will have it, rounding included.
    projected = project(np.swapaxes(basis.values, 1, 2), matrices)
    deltas = np.stack([delta_coordinates(mesh.laplacian, axis.T).T for axis in projected])
    return CodedBlock(
        basis=basis,
        # Deviation from Eq. 12: the anchors' K coefficients are sent, not their T positions:
        # what lies outside the span of the K modes has no effect on the solution.
        anchors=Quantized.from_values(projected[:, :, mesh.anchors], ANCHOR_BITS),
        coefficients=Quantized.from_values(deltas, config.bits),
    )


def synthesise(block: CodedBlock, mesh: MeshModel) -> tuple[Floats, Floats]:
    """Basis of shape (3, T, K) and vertex coefficients of shape (3, K, V).

    Their product (`subspace.basis.expand`) is the coordinate matrices. The system is solved for
    the K columns of each axis and never for frames: the Laplacian acts on vertices and the basis
    on frames, so that the order of the two does not matter.
    """
    deltas, anchors = block.coefficients.values, block.anchors.values
    n_modes, n_verts = deltas.shape[1:]
    columns = mesh.reconstruct(
        deltas.reshape(-1, n_verts).T, anchors.reshape(3 * n_modes, len(mesh.anchors)).T
    )
    coefficients = columns.T.reshape(3, n_modes, n_verts)
    return np.swapaxes(block.basis.values, 1, 2), coefficients


def _leading_trajectories(matrices: Floats, config: EncoderConfig) -> Floats:
    """Eigen-trajectories of shape (3, T, K), as many as the configuration asks for."""
    n_frames = matrices.shape[1]
    correlation = autocorrelation(matrices)
    eigenvalues, basis = eigen_trajectories(correlation, n_frames)
    if config.n_modes is not None:
        return basis[:, :, : config.n_modes]
    total = float(np.trace(correlation, axis1=1, axis2=2).sum())
    centred = matrices - matrices.mean(axis=2, keepdims=True)
    shape_energy = float(np.vdot(centred, centred))
    return basis[:, :, : modes_for_energy(eigenvalues, total, shape_energy, config.energy_share)]
