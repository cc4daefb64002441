"""HDF5 attributes that describe the track in a dataset."""

from typing import Any

from meshreel.formats.hdf.reading import Dataset
from meshreel.model.tracks import TrackSource

UNIT_NAMES = ("unit", "units")


def describe_track(dataset: Dataset, name: str, track: TrackSource) -> None:
    """Write name, domain, kind and unit of a track as attributes of its dataset."""
    dataset.attrs["name"] = name.encode("utf-8", "replace").decode().replace("\0", "_")
    dataset.attrs["domain"] = str(track.domain)
    dataset.attrs["kind"] = str(track.kind)
    if track.unit:
        dataset.attrs["unit"] = track.unit.encode("utf-8", "replace").decode().replace("\0", "_")


def read_text_attribute(dataset: Dataset, name: str) -> str:
    """Return a text attribute of a dataset; empty if there is none."""
    value: Any = dataset.attrs.get(name, "")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def read_unit(dataset: Dataset) -> str:
    """Return the unit of a dataset; empty if there is none."""
    return next(filter(None, (read_text_attribute(dataset, name) for name in UNIT_NAMES)), "")
