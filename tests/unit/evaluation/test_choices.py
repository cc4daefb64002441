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
def test_known_names_are_listed_when_a_name_is_wrong_or_missing(names, problem):
    with pytest.raises(InvalidInputError, match=f"{problem}; choose from pca, v2v, gft"):
        checked_names(names, KNOWN, "method")
