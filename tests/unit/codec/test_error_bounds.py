"""Parsing of error bounds."""

import pytest

from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.errors import InvalidInputError


@pytest.mark.parametrize("given", [0.1, "0.1", "0.1%", " .1 % ", "1e-1"])
def test_bound_without_a_unit_is_percent_of_the_diagonal(given):
    assert bound_of(given) == ErrorBound(0.1)
    assert bound_of(given).percent(7.0) == 0.1
    assert bound_of(given).share(7.0) == 0.1 / 100


def test_bound_in_model_units_is_converted_to_percent_of_the_diagonal():
    assert bound_of("0.5u") == ErrorBound(0.5, is_length=True)
    assert bound_of("0.5u").share(10.0) == 0.05
    assert bound_of("0.5 U").percent(10.0) == 5.0


@pytest.mark.parametrize(
    ("given", "unit", "in_units"),
    [
        ("0.5mm", "mm", 0.5),
        ("0.5mm", "cm", 0.05),
        ("2cm", "m", 0.02),
        ("1in", "cm", 2.54),
        ("1ft", "in", 12.0),
        ("1ft", "mm", 304.8),
        ("2m", "km", 0.002),
        ("1km", "m", 1000.0),
    ],
)
def test_length_is_converted_for_a_model_with_a_known_unit(given, unit, in_units):
    bound = bound_of(given, unit)
    assert bound.is_length
    assert bound.amount == pytest.approx(in_units, rel=1e-15)


@pytest.mark.parametrize("given", [0.1, "0.1%", "0.5u", "3e-7u"])
def test_canonical_form_is_parsed_to_the_same_bound(given):
    assert bound_of(bound_of(given).plain) == bound_of(given)


@pytest.mark.parametrize(
    ("given", "unit", "message"),
    [
        ("0.5mm", None, "has no length unit.* unit .*or use model units"),
        ("0.5mm", "px", "unit is one of mm, cm, m, km, in, ft; got 'px'"),
        ("0.5px", None, "has no unit 'px'"),
        ("small", None, "takes percent of the diagonal"),
        ("", None, "takes percent of the diagonal"),
        ("0", None, "above 0"),
        ("-1", None, "takes percent"),
        (float("nan"), None, "above 0"),
        (float("inf"), None, "above 0"),
        ("1e999", None, "above 0"),
        ("0.1%", "mm", "unit has no effect on 0.1%"),
        ("0.5u", "mm", "unit has no effect on 0.5u"),
        (0.1, "mm", "unit has no effect on 0.1"),
    ],
)
def test_ambiguous_bound_is_refused(given, unit, message):
    with pytest.raises(InvalidInputError, match=message):
        bound_of(given, unit)
