import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.choices import checked_names

KNOWN = ("pca", "v2v", "gft")


def test_names_are_in_the_order_of_the_known_when_given_otherwise():
    assert checked_names(["gft", "pca", "gft"], KNOWN, "method") == ("pca", "gft")


@pytest.mark.parametrize(
    ("names", "what"), [(["pcaqp"], "method 'pcaqp' is unknown"), ([], "no method is named")]
)
def test_known_names_are_listed_when_a_name_is_wrong_or_none_is_given(names, what):
    with pytest.raises(InvalidInputError, match=f"{what}; choose from pca, v2v, gft"):
        checked_names(names, KNOWN, "method")
