import pytest

from meshreel.documents.cells import number, scientific, significant, size_text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.14472, "0.145"), (12.34, "12.3"), (37314.55, "37300"), (1.2e-5, "0.000012"), (0, "0"),
     (None, "-"), (999.6, "1000"), (50.0, "50")],
)  # fmt: skip
def test_figures_have_three_digits_and_no_exponent(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("size_bytes", "text"),
    [(0, "0 B"), (999, "999 B"), (1000, "1 kB"), (1234567, "1.23 MB"), (999_499, "999 kB"),
     (999_500, "1 MB"), (5.6e9, "5.6 GB"), (7e12, "7e+03 GB")],
)  # fmt: skip
def test_sizes_have_the_unit_that_leaves_few_digits(size_bytes, text):
    assert size_text(size_bytes) == text


@pytest.mark.parametrize(
    ("write", "value", "text"),
    [(number, 1.23456, "1.2346"), (number, None, "-"), (scientific, 12345.0, "1.23e+04"),
     (scientific, None, "-")],
)  # fmt: skip
def test_figures_are_written_as_the_paper_does(write, value, text):
    assert write(value) == text
