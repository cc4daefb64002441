"""Prediction from decoded values, level after level; both sides run it.

Values stand in levels. Those of a level are predicted from the decoded values of the levels
before, and their residuals are sent, as multiples of a quantisation step. The loop is closed:
every value is as near to the truth as its own rounding, whatever was lost before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Predictor:
    """How a level follows from those before.

    Attributes
    ----------
    rows : integer array of shape (n,)
        Places of the level's values.
    weights : csr_array of shape (n, N)
        Of all values, of which those of earlier levels count.
    """

    rows: Integers
    weights: csr_array


class ClosedLoop:
    """N rows of K columns that become known level after level.

    Both sides go through the levels in order: `predict` one, then `add` its residuals, which one
    side chooses and the other reads.

    Parameters
    ----------
    predictors : sequence of Predictor
        One for each level, in order; together they hold all N rows.
    n_values, n_columns : int
        N and K.
    step : float
        Quantisation step of the residuals.

    Attributes
    ----------
    values : float64 array of shape (N, K)
        Decoded so far; 0 in the levels to come.
    """

    def __init__(
        self, predictors: Sequence[Predictor], n_values: int, n_columns: int, step: float
    ) -> None:
        self.predictors = predictors
        self.values = np.zeros((n_values, n_columns))
        self._step = step

    def predict(self, level: int) -> Floats:
        """The prediction of a level, of shape (n, K), from the levels before."""
        return np.asarray(self.predictors[level].weights @ self.values)

    def add(self, level: int, prediction: Floats, residuals: Integers) -> None:
        """Decode a level: its prediction, and residuals of the same shape in quantisation steps."""
        self.values[self.predictors[level].rows] = prediction + self._step * residuals

    def decode(self, residuals_of: Sequence[Integers]) -> Floats:
        """All values, of shape (N, K), for the residuals of each level, of shape (n, K)."""
        for level, residuals in enumerate(residuals_of):
            self.add(level, self.predict(level), residuals)
        return self.values
