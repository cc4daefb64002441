"""Merging of several animated meshes and their tracks into one mesh of parts."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from meshreel.arrays import Floats, Values
from meshreel.formats.frames.stored_frames import StoredTrack
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import (
    Intervals,
    blend,
    neighbors,
    neighbors_of_times,
    unite_times,
)
from meshreel.formats.surfaces.cells import join_cells
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.colors import unit_colors, white
from meshreel.model.geometry.hard_edges import merged_edges
from meshreel.model.materials import Image, Material, renumber_images
from meshreel.model.notes import Notes, listed
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.model.tracks import KIND_ROWS, TrackKind, TrackSource, error_bound_of

BLENDED = [kind for kind, row in KIND_ROWS.items() if row.has_unit]
"""Kinds whose float values are interpolated linearly between frames."""


def merge_meshes(
    meshes: Sequence[SceneMesh], name: str, notes: Notes, times_s: Floats | None = None
) -> SceneMesh:
    """Merge meshes into one whose parts have their names; a single mesh has no parts.

    Its frames are at the given times, by default at all times of the moving meshes. A mesh without
    a frame at such a time is interpolated linearly between its neighboring frames, and held before
    its first and after its last one; so are its float tracks.

    Parameters
    ----------
    name : str
        Name of the merged mesh.
    notes : Notes
        Receives a sentence for each attribute that only some of the meshes have.
    """
    times = unite_times([mesh.times_s for mesh in meshes]) if times_s is None else times_s

    def frame(index: int) -> PolygonMesh:
        intervals = [neighbors(mesh.times_s, times[index]) for mesh in meshes]
        pairs = [*zip(meshes, intervals, strict=True)]
        before = [mesh.frame(interval.before) for mesh, interval in pairs]
        after = [
            mesh.frame(interval.after) if interval.after != interval.before else first
            for (mesh, interval), first in zip(pairs, before, strict=True)
        ]
        return _join_frames(
            [
                replace(first, vertices=blend(first.vertices, second.vertices, interval.share))
                if second is not first and second.has_faces_of(first)
                else first
                for first, second, interval in zip(before, after, intervals, strict=True)
            ]
        )

    readers = [mesh.positions for mesh in meshes if mesh.positions is not None]

    def positions(start: int, stop: int) -> Vertices:
        intervals = [neighbors_of_times(mesh.times_s, times[start:stop]) for mesh in meshes]
        parts = []
        for read, (before, after, shares) in zip(readers, intervals, strict=True):
            block = read(before[0], after[-1] + 1)
            first = block[before - before[0]]
            if shares.any():
                second, shares = block[after - before[0]], shares[:, np.newaxis, np.newaxis]
                first = np.where(shares, blend(first, second, shares), first)
            parts.append(first)
        return np.concatenate(parts, axis=1)

    def surface(index: int) -> Surface:
        numbers = [int(np.searchsorted(mesh.times_s, times[index], "right")) - 1 for mesh in meshes]
        numbers = [max(0, number) for number in numbers]
        frames = [mesh.frame(number) for mesh, number in zip(meshes, numbers, strict=True)]
        surfaces = [mesh.surface(number) for mesh, number in zip(meshes, numbers, strict=True)]
        return merge_surfaces([mesh.name for mesh in meshes], surfaces, frames, notes)

    def tracks(frames: range) -> Mapping[str, TrackSource]:
        frame_times_s = times[frames.start : frames.stop]
        intervals = [neighbors_of_times(mesh.times_s, frame_times_s) for mesh in meshes]
        return merge_tracks(meshes, intervals, notes)

    rates = {mesh.fps for mesh in meshes if mesh.fps}
    fps = rates.pop() if len(rates) == 1 else None
    read_positions = positions if len(readers) == len(meshes) else None

    def note_unread() -> None:
        for note in dict.fromkeys(mesh.note_unread for mesh in meshes):
            note()

    return SceneMesh(
        name, times, frame, surface, fps, tracks, read_positions, note_unread=note_unread,
        error_bound=error_bound_of(*meshes),
    )  # fmt: skip


def _join_frames(frames: Sequence[PolygonMesh]) -> PolygonMesh:
    starts = np.cumsum([0] + [len(frame.vertices) for frame in frames])
    corners = [frame.corners + start for frame, start in zip(frames, starts, strict=False)]
    return PolygonMesh(
        np.concatenate([frame.vertices for frame in frames]),
        np.concatenate([frame.counts for frame in frames]),
        np.concatenate(corners).astype(np.int32),
        join_cells([frame.cells for frame in frames], starts),
    )


def merge_tracks(
    meshes: Sequence[SceneMesh], intervals: Sequence[Intervals], notes: Notes
) -> dict[str, TrackSource]:
    """Return the tracks of several meshes that are merged into one.

    A track that only some meshes have is NaN in the others; integers become float64 then. Tracks
    whose domain, kind, unit or width differ are left out. Notes report both.

    Parameters
    ----------
    places : sequence of Places
        For each mesh, its frames at or around the times of the merged frames.
    """
    starts = [int(before.min()) for before, _, _ in intervals]
    mesh_tracks = [
        mesh.tracks(range(start, int(after.max()) + 1))
        for mesh, start, (_, after, _) in zip(meshes, starts, intervals, strict=True)
    ]
    if not any(mesh_tracks):
        return {}
    sizes = [mesh.frame(start).n_items for mesh, start in zip(meshes, starts, strict=True)]
    names = dict.fromkeys(name for tracks in mesh_tracks for name in tracks)
    merged = {name: _merge(name, mesh_tracks, starts, intervals, sizes, notes) for name in names}
    return {name: track for name, track in merged.items() if track is not None}


def _merge(
    name: str,
    mesh_tracks: Sequence[Mapping[str, TrackSource]],
    starts: Sequence[int],
    intervals: Sequence[Intervals],
    sizes: Sequence[Mapping[Domain, int]],
    notes: Notes,
) -> StoredTrack | None:
    candidates = [tracks.get(name) for tracks in mesh_tracks]
    tracks = [track for track in candidates if track is not None]
    if len({(track.domain, track.kind, track.unit, track.shape[2]) for track in tracks}) > 1:
        notes.left_out(f"tracks that differ between meshes: {listed([name])}")
        return None
    domain, kind = tracks[0].domain, tracks[0].kind
    dtype = np.result_type(*(track.dtype for track in tracks))
    if len(tracks) < len(candidates):
        dtype = dtype if dtype.kind == "f" else np.dtype(np.float64)
        notes.changed(
            f"track {name!r} is in {len(tracks)} of {len(candidates)} meshes, and NaN in the others"
        )
    is_blended = kind in BLENDED and dtype.kind == "f"
    n_columns = tracks[0].shape[2]

    def read_part(part: int, index: int) -> Values:
        track, (before, after, shares) = candidates[part], intervals[part]
        if track is None:
            return np.full((sizes[part][domain], n_columns), np.nan, dtype)
        row, next_row = before[index] - starts[part], after[index] - starts[part]
        values = track.read(row, row + 1)[0]
        is_unit_color = kind is TrackKind.COLOR and dtype.kind == "f"
        values = (unit_colors(values) if is_unit_color else values).astype(dtype)
        if not is_blended or next_row == row:
            return values
        return blend(values, track.read(next_row, next_row + 1)[0], shares[index])

    def read_range(start: int, stop: int) -> Values:
        values: Values = np.empty((stop - start, *shape[1:]), dtype)
        for index in range(start, stop):
            parts = [read_part(part, index) for part in range(len(intervals))]
            values[index - start] = np.concatenate(parts)
        return values

    shape = len(intervals[0][0]), sum(size[domain] for size in sizes), n_columns
    return StoredTrack(domain, kind, tracks[0].unit, dtype, shape, read_range)


Signature = tuple[str, str, int]


def merge_surfaces(
    names: Sequence[str],
    surfaces: Sequence[Surface],
    frames: Sequence[PolygonMesh],
    notes: Notes,
) -> Surface:
    """Return the merged surface of several meshes, each of which becomes a named part.

    The surface of a single mesh is unchanged.

    Parameters
    ----------
    surfaces : sequence of Surface
        Surface of each mesh, without face sizes.
    frames : sequence of PolygonMesh
        The mesh of each surface.
    notes : Notes
        Receives a sentence for each attribute that only some of the meshes have.
    """
    if len(surfaces) == 1:
        return surfaces[0]
    parts = tuple(
        Part(name, len(frame.vertices), len(frame.counts))
        for name, frame in zip(names, frames, strict=True)
    )
    table = MaterialTable()
    surfaces = [table.add(surface) for surface in surfaces]
    attributes = _merge_attributes(unify_domains(surfaces, frames), frames, notes)
    groups = _merge_groups(surfaces, frames)
    hard_edges = merged_edges(
        [surface.hard_edges for surface in surfaces], [len(frame.vertices) for frame in frames]
    )
    return Surface(None, attributes, groups, parts, table.materials, table.images, hard_edges)


def unify_domains(surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]) -> list[Surface]:
    """Move attributes that are the same in all meshes to one domain.

    Attributes with the same kind, name and width but different domains, such as texture coordinates
    with and without seams, become corner attributes. Attributes that a mesh has twice stay.

    Parameters
    ----------
    frames : sequence of PolygonMesh
        The mesh of each surface.
    """
    domains: dict[Signature, set[Domain]] = {}
    twice: set[Signature] = set()
    for surface in surfaces:
        matches = [_signature(attribute) for attribute in surface.attributes]
        twice |= {signature for signature in matches if matches.count(signature) > 1}
        for signature, attribute in zip(matches, surface.attributes, strict=True):
            domains.setdefault(signature, set()).add(attribute.domain)
    mixed = {signature for signature, values in domains.items() if len(values) > 1} - twice

    def unify(attribute: Attribute, frame: PolygonMesh) -> Attribute:
        if attribute.domain is Domain.CORNER or _signature(attribute) not in mixed:
            return attribute
        items = frame.items_of_corners(attribute.domain)
        rows = items if attribute.indices is None else attribute.indices[items]
        return replace(attribute, domain=Domain.CORNER, indices=rows.astype(np.int32))

    return [
        replace(
            surface, attributes=tuple(unify(attribute, frame) for attribute in surface.attributes)
        )
        for surface, frame in zip(surfaces, frames, strict=True)
    ]


def _signature(attribute: Attribute) -> Signature:
    return attribute.kind, attribute.name, attribute.values.shape[1]


def _merge_attributes(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh], notes: Notes
) -> tuple[Attribute, ...]:
    """Merge attributes by kind, name, domain and width; white or 0 where a mesh lacks one."""
    keys = {_key(attribute): attribute for surface in surfaces for attribute in surface.attributes}
    merged = []
    for key, sample in keys.items():
        matches = [
            next((attribute for attribute in surface.attributes if _key(attribute) == key), None)
            for surface in surfaces
        ]
        if any(match_ is None for match_ in matches):
            fill = "white" if sample.kind is Kind.COLOR else "0"
            notes.changed(f"{sample.kind} {sample.name!r} is {fill} in meshes without it")
        merged.append(_concatenate(sample, matches, frames))
    return tuple(merged)


def _key(attribute: Attribute) -> tuple[str, str, str, int, bool]:
    width, is_byte = attribute.values.shape[1], attribute.values.dtype.kind in "iu"
    return attribute.kind, attribute.name, attribute.domain, width, is_byte


def _concatenate(
    sample: Attribute, matches: Sequence[Attribute | None], frames: Sequence[PolygonMesh]
) -> Attribute:
    width, start = sample.values.shape[1], 0
    is_indexed = any(match_ is not None and match_.indices is not None for match_ in matches)
    dtype = np.result_type(*(match_.values.dtype for match_ in matches if match_ is not None))
    fill = white(dtype) if sample.kind is Kind.COLOR else 0
    tables, rows = [], []
    for match_, frame in zip(matches, frames, strict=True):
        n_items = frame.n_items[sample.domain]
        if match_ is not None:
            table, indices = match_.values, match_.indices
        else:  # unindexed attributes need a row per item; indexed ones share a single row
            table = np.full((1 if is_indexed else n_items, width), fill, dtype)
            indices = np.zeros(n_items, np.int32)
        tables.append(table)
        rows.append((np.arange(n_items) if indices is None else indices) + start)
        start += len(table)
    values = np.concatenate(tables).astype(dtype, copy=False)
    joined = np.concatenate(rows).astype(np.int32) if is_indexed else None
    return replace(sample, values=values, indices=joined)


def _merge_groups(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]
) -> tuple[FaceGroups, ...]:
    names = dict.fromkeys(groups.name for surface in surfaces for groups in surface.groups)
    merged = []
    for name in names:
        labels: dict[str, int] = {}
        numbers = []
        for surface, frame in zip(surfaces, frames, strict=True):
            matches = next((group for group in surface.groups if group.name == name), None)
            if matches is None:
                numbers.append(np.full(len(frame.counts), -1, np.int32))
                continue
            new_numbers = [labels.setdefault(label, len(labels)) for label in matches.labels]
            numbers.append(np.array([*new_numbers, -1], np.int32)[matches.numbers])
        merged.append(FaceGroups(name, tuple(labels), np.concatenate(numbers)))
    return tuple(merged)


class MaterialTable:
    """The materials and images of several surfaces.

    If two different materials share a name, the second one and the labels of its faces get a
    numbered name.
    """

    def __init__(self) -> None:
        self._images: dict[Image, int] = {}
        self._materials: dict[str, Material] = {}

    @property
    def materials(self) -> tuple[Material, ...]:
        """All materials added so far, with unique names."""
        return tuple(self._materials.values())

    @property
    def images(self) -> tuple[Image, ...]:
        """Their images."""
        return tuple(self._images)

    def add(self, surface: Surface) -> Surface:
        """Add the materials of a surface; return it with the labels of its faces renamed."""
        numbers = {
            number: self._images.setdefault(image, len(self._images))
            for number, image in enumerate(surface.images)
        }
        names = {}
        for material in surface.materials:
            unique, number = renumber_images(material, numbers), 2
            while self._materials.setdefault(unique.name, unique) != unique:
                unique, number = replace(unique, name=f"{material.name}_{number}"), number + 1
            names[material.name] = unique.name
        groups = tuple(
            replace(group, labels=tuple(names.get(label, label) for label in group.labels))
            if group.name == "material"
            else group
            for group in surface.groups
        )
        return replace(surface, groups=groups)
