"""Rates and errors of streams with all combinations of option values, as a Markdown table.

    python bench/variations.py samba.npz cow.npz --set bits=8,9,10 --set anchors=0.01,0.03

Rates are of the whole file with and without vertex order; errors and seconds with it.
"""

import argparse
import itertools
from collections.abc import Iterator
from functools import partial
from typing import Any

import meshreel
from measuring import start_table
from meshreel.studies.timing import timed_once


def parse(text: str) -> tuple[str, list[Any]]:
    """Parse the name and values of an option, such as 'bits=8,9'."""
    name, _, values = text.partition("=")
    return name, [number(value) for value in values.split(",")]


def number(text: str) -> Any:
    """Convert text to int or float if possible."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def combinations(options: list[tuple[str, list[Any]]]) -> Iterator[dict[str, Any]]:
    """Yield all combinations of one value for each option."""
    names = [name for name, _ in options]
    for values in itertools.product(*(values for _, values in options)):
        yield dict(zip(names, values, strict=True))


def row(sequence: meshreel.MeshSequence, options: dict[str, Any]) -> list[str]:
    """The cells of one line of the table."""
    data, encoding = timed_once(partial(meshreel.encode, sequence, **options))
    decoded, decoding = timed_once(partial(meshreel.decode, data))
    quality = meshreel.compare(sequence, decoded)
    smallest = meshreel.info(meshreel.encode(sequence, **options, order="drop"))
    return [
        sequence.name,
        *map(str, options.values()),
        str(max(smallest.n_modes)),
        f"{meshreel.info(data).ratio:.0f}",
        f"{meshreel.info(data).rate_bpvf:.3f}",
        f"{smallest.rate_bpvf:.3f}",
        f"{quality.kg_error_percent:.3f}",
        f"{quality.sted:.4f}",
        f"{quality.max_error_percent:.3f}",
        f"{encoding.wall:.2f}",
        f"{decoding.wall:.2f}",
    ]


def main() -> None:
    """Print the rows of the table as they are measured."""
    parser = argparse.ArgumentParser(description="Rate and error for combinations of options.")
    parser.add_argument("inputs", nargs="+", help="sequences")
    parser.add_argument("--set", dest="options", action="append", type=parse, default=[])
    arguments = parser.parse_args()
    header = ["sequence", *(name for name, _ in arguments.options), "modes", "ratio",
              "bpvf", "bpvf, drop", "KG %", "STED", "max %", "encode s", "decode s"]  # fmt: skip
    print_row = start_table(*header)
    for source in arguments.inputs:
        sequence = meshreel.load(source)
        for options in combinations(arguments.options):
            print_row(*row(sequence, options))


if __name__ == "__main__":
    main()
