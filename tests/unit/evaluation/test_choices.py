import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.choices import checked_names

KNOWN = ("pca", "v2v", "gft")


def test_names_are_returned_in_the_order_of_known_names():
    assert checked_names(["gft", "pca", "gft"], KNOWN, "method") == ("pca", "gft")


@pytest.mark.parametrize(
    ("names", "problem"),
    [(["pcaqp"], "method 'pcaqp' is unknown"), ([], "name at least one method")],
)
def test_error_for_an_unknown_or_missing_name_lists_the_names(names, problem):
    with pytest.raises(InvalidInputError, match=f"{problem}; choose from pca, v2v, gft"):
        checked_names(names, KNOWN, "method")
