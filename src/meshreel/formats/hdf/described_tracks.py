"""What HDF5 files say of a track: attributes of the dataset of its values."""

from typing import Any

from meshreel.formats.hdf.reading import Dataset
from meshreel.model.tracks import TrackSource

UNIT_NAMES = ("unit", "units")


def describe_track(dataset: Dataset, name: str, track: TrackSource) -> None:
    """Write what a track is beside its values: name, domain, kind and unit."""
    dataset.attrs["name"] = name.encode("utf-8", "replace").decode().replace("\0", "_")
    dataset.attrs["domain"] = str(track.domain)
    dataset.attrs["kind"] = str(track.kind)
    if track.unit:
        dataset.attrs["unit"] = track.unit.encode("utf-8", "replace").decode().replace("\0", "_")


def said_of(dataset: Dataset, name: str) -> str:
    """An attribute of a dataset that is a text; empty if there is none."""
    value: Any = dataset.attrs.get(name, "")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def unit_of(dataset: Dataset) -> str:
    """The unit of the numbers of a dataset, or nothing."""
    return next(filter(None, (said_of(dataset, name) for name in UNIT_NAMES)), "")
