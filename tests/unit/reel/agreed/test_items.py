import numpy as np
import pytest

from meshreel.reel.agreed.graphs import ItemGraph
from meshreel.reel.agreed.items import StoredItems

GRAPH = ItemGraph(np.zeros((0, 3), np.int32), 10)


@pytest.mark.parametrize(
    ("n_corners", "n_counted"), [(None, 10), (79, 10), (80, 10), (81, 11), (88, 11), (89, 12)]
)
def test_a_block_needs_bytes_for_every_eighth_corner_when_they_share_values(n_corners, n_counted):
    spread = None if n_corners is None else np.zeros(n_corners, np.int64)
    assert StoredItems(GRAPH, np.arange(10), spread).n_counted == n_counted
