"""The paper's seven variants, for experiments: streams as arrays, and the steps of the method.

    import meshreel

    data = meshreel.encode(sequence, "pca-qp", n_modes=20)
    stream = meshreel.paper.read(data)
    vertices = stream.reconstruct()

METHODS               the names of the seven variants
read                  a stream as arrays: PaperStream, PaperBlock
rates                 bits of a stream in the count of Table I (Eq. 13): StreamRates, RateParts
experiment            a variant with steps of your own, measured: Experiment; Known for predictors
PaperChoices          choices that the paper leaves open, for `meshreel.encode(choices=)`
bounding_frame        the units of the coordinate matrices: BoundingFrame
to_matrices           positions to coordinate matrices A; from_matrices inverts it
adjacency_matrix      C, 1 for neighbors (Eq. 2)
uniform_laplacian     L = D - C, or its rows divided by the degrees (Eqs. 1 to 3)
cotangent_laplacian   L with cotangent weights
delta_coordinates     L applied to columns (Eqs. 4 and 8)
autocorrelation       R = A A^T (Eq. 7)
eigen_trajectories    the leading eigenvectors of R (Eq. 5)
advance_basis         orthogonal iterations (Alg. 1); then ritz_vectors, align_basis
graph_fourier_basis   low-frequency eigenvectors of a Laplacian, the basis of gft (Eq. 6)
project               U^T A (Eqs. 6 and 9); expand inverts it
step_for_all_rows     quantization steps of coefficients (Eq. 10); steps_for_each_row
quantize              integers of coefficients (Eq. 10); dequantize inverts it
choose_anchors        farthest-point or random anchors
ReconstructionSystem  least squares with anchors (Eqs. 11 and 12)

They need the extra [paper].
"""

from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import (
    BoundingFrame,
    bounding_frame,
    from_matrices,
    to_matrices,
)
from meshreel.paper.anchors import choose_anchors
from meshreel.paper.basis import advance_basis, align_basis, expand, project, ritz_vectors
from meshreel.paper.choices import PaperChoices
from meshreel.paper.experiment import Experiment, Known, experiment
from meshreel.paper.graph_fourier import graph_fourier_basis
from meshreel.paper.laplacian import (
    adjacency_matrix,
    cotangent_laplacian,
    delta_coordinates,
    uniform_laplacian,
)
from meshreel.paper.quantization import dequantize, quantize, step_for_all_rows, steps_for_each_row
from meshreel.paper.reconstruction_system import ReconstructionSystem
from meshreel.paper.stream import PaperBlock, PaperStream, read
from meshreel.paper.stream_rates import RateParts, StreamRates, rates
from meshreel.paper.variants import METHODS

__all__ = [
    "METHODS",
    "BoundingFrame",
    "Experiment",
    "Known",
    "PaperBlock",
    "PaperChoices",
    "PaperStream",
    "RateParts",
    "ReconstructionSystem",
    "StreamRates",
    "adjacency_matrix",
    "advance_basis",
    "align_basis",
    "autocorrelation",
    "bounding_frame",
    "choose_anchors",
    "cotangent_laplacian",
    "delta_coordinates",
    "dequantize",
    "eigen_trajectories",
    "expand",
    "experiment",
    "from_matrices",
    "graph_fourier_basis",
    "project",
    "quantize",
    "rates",
    "read",
    "ritz_vectors",
    "step_for_all_rows",
    "steps_for_each_row",
    "to_matrices",
    "uniform_laplacian",
]


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
