"""Data that all segments of a sequence share, for formats that declare data once."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.scenes.merging import MaterialTable
from meshreel.model.notes import Notes, listed, note_unwritten_tracks
from meshreel.model.surface import Attribute, FaceGroups, Surface
from meshreel.model.tracks import TrackSource

Key = tuple[Any, ...]


@dataclass(frozen=True)
class SharedData:
    """Attributes, groups, tracks and parts that all segments of a sequence have.

    Attributes are the same if they agree in name, kind, domain, width and number type; tracks also
    in their unit, and groups in their name.
    """

    attributes: tuple[Key, ...]
    groups: tuple[Key, ...]
    tracks: tuple[Key, ...]
    """Keys of the data of all segments, in the order of the first segment."""
    indexed: frozenset[Key]
    """Keys of attributes that have indices in the first segment, and get them in the others."""
    labels: Mapping[Key, tuple[str, ...]]
    """Labels of all segments, by key of the groups."""
    parts: tuple[str, ...]
    """Names of the parts, if they are the same in all segments, with faces in each."""
    has_hard_edges: bool
    """Whether a segment has hard edges."""
    other_data: tuple[str, ...]
    other_tracks: tuple[str, ...]
    """Names of data that only some segments have."""

    @classmethod
    def of(cls, meshes: Iterable[FrameStream]) -> "SharedData":
        """Compare the segments of a stream."""
        shared: list[dict[Key, None]] = []
        unshared_names: list[dict[str, None]] = [{}, {}, {}]
        labels: dict[Key, dict[str, None]] = {}
        parts: tuple[str, ...] = ()
        indexed: frozenset[Key] = frozenset()
        has_hard_edges = has_empty = False
        for number, mesh in enumerate(meshes):
            attributes, groups, tracks = _data_by_key(mesh)
            mesh_keys = [dict.fromkeys(keys) for keys in (attributes, groups, tracks)]
            for key, group in groups.items():
                labels.setdefault(key, {}).update(dict.fromkeys(group.labels))
            has_hard_edges = has_hard_edges or mesh.surface.hard_edges is not None
            part_names = tuple(part.name for part in mesh.surface.parts)
            if number == 0:
                shared, parts = mesh_keys, part_names
                indexed = frozenset(
                    key for key, attribute in attributes.items() if attribute.indices is not None
                )
            for names, common, keys in zip(unshared_names, shared, mesh_keys, strict=True):
                names.update((str(key[0]), None) for key in sorted(common.keys() ^ keys.keys()))
                for key in common.keys() - keys.keys():
                    del common[key]
            has_empty = has_empty or any(not part.n_faces for part in mesh.surface.parts)
            if part_names != parts or (number and has_empty):
                unshared_names[1]["the names of parts"] = None
                parts = ()
        attribute_keys, group_keys, track_keys = map(tuple, shared)
        return cls(
            attribute_keys,
            group_keys,
            track_keys,
            indexed,
            {key: tuple(labels[key]) for key in group_keys},
            parts,
            has_hard_edges,
            tuple(unshared_names[0] | unshared_names[1]),
            tuple(unshared_names[2]),
        )

    def restrict(self, mesh: FrameStream) -> FrameStream:
        """Return the mesh of a segment without data that other segments lack."""
        attributes, groups, tracks = _data_by_key(mesh)
        surface = replace(
            mesh.surface,
            attributes=tuple(
                _with_indices(attributes[key], is_indexed=key in self.indexed)
                for key in self.attributes
            ),
            groups=tuple(groups[key] for key in self.groups),
            parts=mesh.surface.parts if self.parts else (),
        )
        return replace(
            mesh, surface=surface, tracks={str(key[0]): tracks[key] for key in self.tracks}
        )

    def note_others(self, extension: str, notes: Notes) -> None:
        """Add notes on data that are left out because only some segments have them."""
        if self.other_data:
            text = f"left out, as only some segments have it: {listed(self.other_data)}"
            notes.unwritten("data of some segments", text)
        reason = "those of some segments only"
        note_unwritten_tracks(self.other_tracks, extension, notes, reason)


def share_materials(
    stream: SegmentedStream, visit: Callable[[FrameStream], None] | None = None
) -> tuple[SegmentedStream, SharedData]:
    """Return the stream with the materials and images of all segments in each, and what they share.

    Different materials with the same name are numbered. All of this takes one pass over the meshes,
    in which `visit` is called with each unchanged mesh.
    """
    table = MaterialTable()

    def collect() -> Iterator[FrameStream]:
        for mesh in stream.meshes():
            if visit is not None:
                visit(mesh)
            yield replace(mesh, surface=table.add(mesh.surface)) if has_several else mesh

    def share(mesh: FrameStream) -> FrameStream:
        surface = table.add(mesh.surface)
        surface = replace(surface, materials=table.materials, images=table.images)
        return replace(mesh, surface=surface)

    has_several = stream.n_segments > 1
    shared = SharedData.of(collect())
    return stream.map_segments(share) if has_several else stream, shared


def _with_indices(attribute: Attribute, *, is_indexed: bool) -> Attribute:
    """Return an attribute with or without indices, and the same value of each item."""
    if is_indexed == (attribute.indices is not None):
        return attribute
    indices = np.arange(len(attribute.values), dtype=np.int32) if is_indexed else None
    return replace(attribute, values=attribute.per_item(), indices=indices)


def _data_by_key(
    mesh: FrameStream,
) -> tuple[dict[Key, Attribute], dict[Key, FaceGroups], dict[Key, TrackSource]]:
    """Return attributes, groups and tracks by what they have in common in all segments."""
    groups: dict[Key, FaceGroups] = {(group.name,): group for group in mesh.surface.groups}
    tracks: dict[Key, TrackSource] = {
        (name, track.domain, track.kind, track.shape[2], track.dtype.str, track.unit): track
        for name, track in mesh.tracks.items()
    }
    return _attributes(mesh.surface), groups, tracks


def _attributes(surface: Surface) -> dict[Key, Attribute]:
    counts: Counter[Key] = Counter()
    attributes: dict[Key, Attribute] = {}
    for attribute in surface.attributes:
        key = (
            attribute.name,
            attribute.kind,
            attribute.domain,
            attribute.values.shape[1],
            attribute.values.dtype.str,
        )
        counts[key] += 1
        attributes[(*key, counts[key])] = attribute
    return attributes
