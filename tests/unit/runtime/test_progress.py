import pytest

from meshreel.runtime.progress import Count


def test_count_equals_its_share_and_stores_both_numbers():
    count = Count(3, 12, "frames")
    assert count == 0.25
    assert (count.done, count.total, count.unit) == (3, 12, "frames")


@pytest.mark.parametrize(("done", "total", "share"), [(0, 5, 0.0), (5, 5, 1.0), (0, 0, 1.0)])
def test_count_is_between_zero_and_one(done, total, share):
    assert Count(done, total, "inputs") == share
