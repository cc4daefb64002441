"""Frame numbers in file names, their order, and the times that follow from them."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import gcd
from pathlib import Path

from meshreel.errors import Keyword, Message
from meshreel.formats.sources import WHOLE, have_decimals, natural_order
from meshreel.model.notes import Notes, listed
from meshreel.model.timing import Timing


def timing_by_number(paths: Sequence[Path], fps: float, notes: Notes) -> Timing:
    """Return the timing of frame files; their numbers count frames from the first file on.

    Parameters
    ----------
    fps : float
        Numbers per second; 0 if unknown, which makes the frames consecutive.
    notes : Notes
        Receives a sentence on missing numbers.
    """
    numbers = frame_numbers(paths)
    steps = [after - before for before, after in pairwise(numbers)]
    stride = gcd(*steps) or 1
    missing = [
        range(before + stride, after, stride)
        for before, after in pairwise(numbers)
        if after - before > stride
    ]
    facts = [f"frame numbers are {stride} apart"] if stride > 1 else []
    if missing:
        is_single = len(missing) == 1 and len(missing[0]) == 1
        frames = _listed_ranges(missing)
        facts.append(f"frame {frames} is missing" if is_single else f"frames {frames} are missing")
    if facts:
        condition = () if fps else ("with ", Keyword("fps"), ", ")
        text = Message(f"{' and '.join(facts)}; ", *condition, "times follow the numbers")
        notes.unknown("missing frames", text)
    if not (fps and missing):
        return Timing.of_rate(fps / stride)
    return Timing.of_times([(number - numbers[0]) / fps for number in numbers])


def note_order(paths: Sequence[Path], notes: Notes) -> None:
    """Note the order of files whose names contain decimal numbers, or counts after a point."""
    by_value, by_count = (natural_order(paths, by_value=choice) for choice in (True, False))
    is_by_value = list(paths) == by_value
    if by_value == by_count or not (is_by_value or list(paths) == by_count):
        return  # only one order is possible, or the user gave another one
    pairs = zip(by_value, by_count, strict=True)
    first, second = next((one.name, other.name) for one, other in pairs if one != other)
    if not is_by_value:
        first, second = second, first
    meaning = "decimal numbers" if is_by_value else "numbers after the point"
    text = f"files are in order of {meaning} in their names, {first} before {second}; "
    notes.result("order of files", text + "rename them for another order")


def frame_numbers(paths: Iterable[Path]) -> list[int]:
    """Return the ascending number in which the names of files differ; empty for other names."""
    texts = [str(path).lower() for path in paths]
    names = [WHOLE.split(text) for text in texts]
    if len({len(name) for name in names}) != 1 or have_decimals(texts):
        return []
    differing = [column for column in zip(*names, strict=True) if len({*column}) > 1]
    if len(differing) != 1 or not all(map(str.isdecimal, differing[0])):
        return []
    numbers = [int(text) for text in differing[0]]
    return numbers if all(before < after for before, after in pairwise(numbers)) else []


def _listed_ranges(ranges: Iterable[range]) -> str:
    """List numbers, as in "3, 4 and 7 to 9"; long lists are shortened."""
    texts: list[str] = []
    for numbers in ranges:
        is_long = len(numbers) > 2
        texts += [f"{numbers[0]} to {numbers[-1]}"] if is_long else map(str, numbers)
    if 1 < len(texts) <= 8:
        return f"{', '.join(texts[:-1])} and {texts[-1]}"
    return listed(texts)
