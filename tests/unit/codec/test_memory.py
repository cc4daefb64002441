"""Parsing of sizes in bytes."""

import pytest

from meshreel.codec.memory import bytes_of
from meshreel.errors import InvalidInputError


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (100000, 100000),
        ("100000", 100000),
        ("100kB", 100000),
        ("100 KB", 100000),
        ("1MiB", 1 << 20),
        ("1.5mb", 1.5e6),
        (".5GiB", 1 << 29),
        ("1e5", 100000),
        ("12B", 12),
        ("15k", 15000),
        ("2M", 2e6),
    ],
)
def test_sizes_are_parsed_to_bytes(given, expected):
    assert bytes_of(given, "size") == expected


@pytest.mark.parametrize(
    "given", ["", "kB", "100 apples", "-5kB", "1..2", "nan", "0x10", "10kb2", "10K3"]
)
def test_text_that_is_not_a_size_is_refused(given):
    with pytest.raises(InvalidInputError, match="size takes a size such as 100kB or 1GiB"):
        bytes_of(given, "size")


@pytest.mark.parametrize("given", [0, "0kB", -1, float("nan"), float("inf"), "1e999"])
def test_size_not_above_0_is_refused(given):
    with pytest.raises(InvalidInputError, match="memory must be above 0"):
        bytes_of(given, "memory")
