"""Tracks as a Dataset of xarray, with named dimensions, times and units."""

from collections.abc import Mapping
from typing import Any

from meshreel.arrays import Floats
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource, error_bound_of
from meshreel.runtime.extras import XARRAY


def track_dataset(tracks: Mapping[str, TrackSource], times_s: Floats | None) -> Any:
    """Return tracks as `MeshSequence.to_xarray` does, with the time of each frame if it is known.

    Raises
    ------
    InvalidInputError
        If xarray is not installed.
    """
    variables = {}
    for name, track in tracks.items():
        n_frames, _, n_columns = track.shape
        values = track.read(0, n_frames)
        domain = "node" if track.domain is Domain.VERTEX else track.domain.value
        component = {1: [], 3: ["component"]}.get(n_columns, [f"component_{n_columns}"])
        facts = {
            "units": track.unit,
            "kind": track.kind.value,
            "error_bound": error_bound_of(track),
        }
        attributes = {key: fact for key, fact in facts.items() if fact not in ("", None)}
        values = values if component else values[..., 0]
        variables[name] = ["time", domain, *component], values, attributes
    coordinates = {} if times_s is None else {"time": ("time", times_s, {"units": "s"})}
    return XARRAY.load().Dataset(variables, coordinates)
