"""Quantities of a mesh that change over time, which scene files sample at arbitrary times."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import StoredTrack, changed_error
from meshreel.formats.scenes.transforms import transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain


@dataclass(frozen=True, eq=False)
class Quantity:
    """Numbers of the vertices, faces or corners of a mesh at any time."""

    name: str
    """Name in the file."""
    domain: Domain | None
    """None if it is not declared."""
    values: Callable[[float], Values | None]
    """Returns the numbers in file order, of shape (N, C), or None if it has none."""
    times: Callable[[], Floats]
    """Returns the times of its samples, ascending."""
    kind: str = ""
    role: str = ""
    unit: str = ""
    """As in a `Field`."""
    is_constant: bool = False
    """Whether a single value applies to all items."""
    to_world: Callable[[Values, Floats], Values] | None = None
    """Transforms the values with the mesh."""

    def item_values(self, time: float, n_items: int) -> Values | None:
        """Return its values at a time, of shape (n_items, C); None if missing or incomplete."""
        values = self.values(time)
        if values is not None and self.is_constant and len(values) == 1:
            values = np.repeat(values, n_items, axis=0)
        return values if values is not None and len(values) == n_items else None


def quantity_tracks(
    path: str,
    quantities: Mapping[Key, Quantity],
    times: Floats,
    sizes: tuple[Mapping[Domain, int], Mapping[Domain, int]],
    rows: Mapping[Domain, Any],
    to_world: Callable[[float], Floats],
    notes: Notes,
    mismatch_label: str,
) -> dict[str, StoredTrack]:
    """Return the quantities of a mesh as tracks.

    Parameters
    ----------
    path : str
        Path of the mesh, for messages.
    times : float64 array
        Times of the frames, whose faces are the same.
    sizes : pair of mappings of Domain to int
        Number of items in the file, and in the mesh.
    rows : mapping of Domain to slice or array
        The items of the mesh among those in the file.
    to_world : function of a time
        Returns the matrix that transforms the mesh, of shape (4, 4).
    mismatch_label : str
        What notes call quantities that fit the mesh in none of the frames.
    """
    file_sizes, mesh_sizes = sizes

    def read_frame(index: int, key: Key) -> Values:
        quantity, time = quantities[key], float(times[index])
        values = quantity.item_values(time, file_sizes[key[0]])
        if values is None:
            raise changed_error(f"{path} (frame {index})")
        if quantity.to_world is not None:
            values = quantity.to_world(values, to_world(time))
        mesh_values: Values = values[rows[key[0]]]
        return mesh_values

    frames = []
    for time in times.tolist():
        fields: dict[Key, Field] = {}
        for key, quantity in quantities.items():
            if (values := quantity.item_values(time, file_sizes[key[0]])) is not None:
                fields[key] = Field(
                    values.dtype, values.shape[1], quantity.role, quantity.kind, quantity.unit
                )
        frames.append(fields)
    missing = (key[1] for key in quantities if not any(key in fields for fields in frames))
    notes.left_out(mismatch_label, missing)
    return field_tracks(frames, mesh_sizes, read_frame, notes)


def note_quantities(
    path: str,
    quantities: Iterable[Quantity],
    frames: Floats,
    tolerance: float,
    notes: Notes,
    *,
    is_transform_animated: bool,
) -> None:
    """Note samples of quantities without a frame, and velocities of animated transforms."""
    names, has_velocities = [], False
    for quantity in quantities:
        times = quantity.times()
        nearest = np.searchsorted(frames, times - tolerance).clip(max=len(frames) - 1)
        n_other = int((np.abs(frames[nearest] - times) > tolerance).sum())
        names += (
            [f"{quantity.name} ({n_other} of {len(times)})"] if n_other and len(times) > 1 else []
        )
        has_velocities = has_velocities or quantity.to_world is transform_vectors
    notes.left_out("samples where positions have no frame", names)
    if has_velocities and is_transform_animated:
        notes.left_out(f"velocity of the transforms above {path}")


def normals_of_corners(
    mesh: PolygonMesh, domain: Domain | None, values: Values | None
) -> npt.NDArray[np.floating]:
    """Return the normals of corners, of shape (C, 3), from those of a domain; 0 if they do not fit.

    Parameters
    ----------
    values : array of shape (N, C) or None
        With corners in the order of the mesh.
    """
    if values is None or domain is None or values.dtype.kind != "f":
        return np.zeros((len(mesh.corners), 3))
    fits = values.shape == (mesh.n_items[domain], 3)
    return values[mesh.items_of_corners(domain)] if fits else np.zeros((len(mesh.corners), 3))
