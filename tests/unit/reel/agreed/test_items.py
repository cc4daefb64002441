import numpy as np
import pytest

from meshreel.reel.agreed.graphs import ItemGraph
from meshreel.reel.agreed.items import StoredItems

GRAPH = ItemGraph(np.zeros((0, 3), np.int32), 10)


@pytest.mark.parametrize(
    ("n_corners", "most_items"), [(None, 10), (9, 10), (10, 10), (11, 11), (60, 60)]
)
def test_corners_count_where_they_share_fewer_values(n_corners, most_items):
    spread = None if n_corners is None else np.zeros(n_corners, np.int64)
    assert StoredItems(GRAPH, np.arange(10), spread).most_items == most_items
