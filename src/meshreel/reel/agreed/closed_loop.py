"""Prediction from what is decoded, level after level; both sides run it.

Values stand in levels. Those of a level are predicted from the decoded values of the levels
before, and what is sent are whole steps that they lie away from their prediction. The loop is
closed: every value is as near to the truth as its own rounding, whatever was lost before it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.runtime.profiling import staged

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


StepsOf = Callable[[int, Floats], Integers]
"""Whole steps of shape (n, K) between a level (by its number) and its prediction of that shape."""


@staged("levels")
def reconstruct_levels(
    predictors: Sequence[Predictor], n_values: int, n_columns: int, step: float, steps_of: StepsOf
) -> Floats:
    """Decoded values of shape (N, K).

    Parameters
    ----------
    predictors : sequence of Predictor
        One for each level, in order; together they hold all N rows.
    n_values, n_columns : int
        N and K.
    step : float
    steps_of : callable
        Reads, or chooses, what is sent.
    """
    values = np.zeros((n_values, n_columns))
    for number, predictor in enumerate(predictors):
        if len(predictor.rows):
            prediction = np.asarray(predictor.weights @ values)
            values[predictor.rows] = prediction + step * steps_of(number, prediction)
    return values
