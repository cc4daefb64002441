"""Inputs and outputs of commands: local files or addresses."""

from collections.abc import Sequence
from pathlib import Path

from meshreel.runtime.stores.address import is_remote, name_of, without_query


def given_source(inputs: Sequence[str]) -> "str | list[Path] | list[str]":
    """The only input, or all of them in natural order."""
    from meshreel.formats.sources import natural_order

    if len(inputs) == 1:
        return inputs[0]
    if not any(map(is_remote, inputs)):
        return natural_order(map(Path, inputs))
    by_path = {Path(given): given for given in inputs}
    return [by_path[path] for path in natural_order(by_path)]


def output_stem(source: str) -> str:
    """The name of the output for an input: the stem of a file, the folder name for a glob."""
    path = Path(name_of(source)) if is_remote(source) else Path(source).resolve()
    if any(mark in path.name for mark in "*?["):
        return Path(source).resolve().parent.name
    return path.name if path.is_dir() else path.stem


def holds_stream(given: str) -> bool:
    """Whether a file is a .reel stream, by its name or its first bytes."""
    from meshreel.codec.bitstream.layout import MAGIC

    path = Path(without_query(given))
    if path.suffix.lower() == ".reel":
        return True
    if is_remote(given) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
