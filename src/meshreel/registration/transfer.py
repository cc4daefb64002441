"""Values of raw frames at points of registered surfaces: tracks, colors, texture coordinates."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats, Integers, Values
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.geometry.normals import unit
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind
from meshreel.model.tracks import KIND_ROWS, Track, TrackKind, concatenate_tracks, default_kind
from meshreel.registration.cleaning import CleanMesh
from meshreel.registration.triangle_mesh import TriangleMesh


class SurfacePoints(NamedTuple):
    """N points on the triangles of a raw frame.

    Attributes
    ----------
    triangles : int64 array of shape (N,)
    weights : float64 array of shape (N, 3)
        Barycentric coordinates.
    """

    triangles: Integers
    weights: Floats


@dataclass(frozen=True, eq=False)
class RawFrame:
    """A raw frame, whose values are interpolated at the closest points of its cleaned surface.

    Attributes
    ----------
    frame : MeshSequence
        One frame.
    cleaned : CleanMesh
    mesh : TriangleMesh
        The cleaned surface, in longest sides of the box.
    """

    frame: MeshSequence
    cleaned: CleanMesh
    mesh: TriangleMesh

    def closest(self, points: Floats) -> SurfacePoints:
        """Return the closest surface points of points in longest sides of the box, (N, 3)."""
        closest = self.mesh.closest(points)
        weights = self.cleaned.reordered(closest.weights)
        return SurfacePoints(self.cleaned.raw_faces[closest.faces], weights)


def attributes_of(frame: MeshSequence) -> tuple[Attribute, ...]:
    """Return the attributes of a single frame.

    Texture coordinates that change between frames of equal faces are tracks of these.
    """
    uv_tracks = (
        Attribute(name, Kind.UV, track.domain, track[0])
        for name, track in frame.tracks.items()
        if track.kind is TrackKind.UV
    )
    return (*frame.surface.attributes, *uv_tracks)


def items_at_corners(frame: MeshSequence, domain: Domain) -> Integers:
    """Return the vertex, corner or polygon at each corner of each triangle, of shape (M, 3)."""
    if domain is Domain.VERTEX:
        return frame.faces.astype(np.int64)
    sizes = frame.surface.sizes(len(frame.faces))
    if domain is Domain.CORNER:
        return triangle_corners(sizes, frame.faces).astype(np.int64)
    polygons = np.repeat(np.arange(len(sizes)), sizes - 2)
    return np.repeat(polygons[:, None], 3, axis=1)


def interpolated(values: Values, items: Integers, points: SurfacePoints) -> Values:
    """Return values at surface points, in the number type of the values.

    Floats and bytes are interpolated. Wider integers, such as labels, are those of the nearest
    corner.

    Parameters
    ----------
    values : array of shape (n_items, C)
    items : int64 array of shape (M, 3)
        As `items_at_corners`.
    points : SurfacePoints
    """
    corners = items[points.triangles]
    if values.dtype.kind != "f" and values.dtype != np.uint8:
        nearest = points.weights.argmax(axis=1)
        return np.asarray(values[corners[np.arange(len(corners)), nearest]])
    means = np.einsum("nk,nkc->nc", points.weights, values[corners].astype(np.float64))
    return np.asarray((means if values.dtype.kind == "f" else np.rint(means)).astype(values.dtype))


def transferred_tracks(frames: Iterable[RawFrame], positions: Iterable[Floats]) -> dict[str, Track]:
    """Return tracks and colors of the raw frames of a segment as tracks of its vertices.

    Only values that all frames have, with the same kind, unit and number type, are transferred.

    Parameters
    ----------
    frames : iterable of RawFrame
    positions : iterable of float64 arrays of shape (V, 3)
        The registered vertices of each frame, in longest sides of the box.
    """
    transferred: list[dict[str, Track]] = []
    for frame, points in zip(frames, positions, strict=True):
        candidates = transferable(frame.frame)
        if transferred:
            # Values have the number type and the columns of those of the frame before.
            candidates = {
                name: track
                for name, before in transferred[-1].items()
                if (track := candidates.get(name)) is not None
                and (track.dtype, track.shape[2]) == (before.dtype, before.shape[2])
            }
        if not candidates:
            return {}
        closest = frame.closest(points)
        tracks: dict[str, Track] = {}
        for name, track in candidates.items():
            items = items_at_corners(frame.frame, track.domain)
            values = interpolated(track[0], items, closest)
            if KIND_ROWS[track.kind].is_direction:
                values = unit(values)
            tracks[name] = Track(values[None], Domain.VERTEX, track.kind, track.unit)
        transferred.append(tracks)
    return concatenate_tracks(
        [{name: tracks[name] for name in transferred[-1]} for tracks in transferred]
    )


def transferable(frame: MeshSequence) -> dict[str, Track]:
    """Return the values of the vertices of a frame, other than texture coordinates, as tracks.

    Formats return the values of a single frame as attributes. Colors of corners count as colors of
    vertices.
    """
    attributes = {
        attribute.name: Track(attribute.per_item()[None], attribute.domain, _kind(attribute))
        for attribute in frame.surface.attributes
        if attribute.domain is Domain.VERTEX
        or (attribute.domain, attribute.kind) == (Domain.CORNER, Kind.COLOR)
        if attribute.kind is not Kind.UV
    }
    return attributes | {
        name: track
        for name, track in frame.tracks.items()
        if track.domain is Domain.VERTEX and track.kind is not TrackKind.UV
    }


def _kind(attribute: Attribute) -> TrackKind:
    width = attribute.values.shape[1]
    is_color = attribute.kind is Kind.COLOR and width in KIND_ROWS[TrackKind.COLOR].columns
    return TrackKind.COLOR if is_color else default_kind(width)
