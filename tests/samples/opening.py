"""Sequences whose frames stay in their files, as `encode` and `info` open them."""

from pathlib import Path

from meshreel.formats.load import open_found
from meshreel.formats.options import ReadOptions
from meshreel.formats.sources import find_files


def open_source(source, *, topology=None, max_loaded_bytes=0, **options):
    """The sequence that `load` gives, with at most these bytes of positions loaded."""
    topology = None if topology is None else Path(topology)
    reading = ReadOptions(topology=topology, max_loaded_bytes=max_loaded_bytes, **options)
    return open_found(find_files(source), reading)
