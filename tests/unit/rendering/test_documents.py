import pytest

from meshreel.rendering.documents import number, scientific, significant


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.14472, "0.145"), (12.34, "12.3"), (37314.55, "37300"), (1.2e-5, "0.000012"), (0, "0"),
     (None, "-"), (999.6, "1000"), (50.0, "50")],
)  # fmt: skip
def test_significant_has_three_digits_and_no_exponent(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("write", "value", "text"),
    [(number, 1.23456, "1.2346"), (number, None, "-"), (scientific, 12345.0, "1.23e+04"),
     (scientific, None, "-")],
)  # fmt: skip
def test_numbers_are_formatted_as_in_the_paper(write, value, text):
    assert write(value) == text
