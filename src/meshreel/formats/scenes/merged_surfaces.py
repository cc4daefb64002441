"""Merging of the attributes, groups, parts and materials of several meshes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.geometry.hard_edges import merged_edges
from meshreel.model.materials import Image, Material, renumbered
from meshreel.model.surface import Attribute, Domain, FaceGroups, Part, Surface

Meaning = tuple[str, str, int]


def merge_surfaces(
    names: Sequence[str],
    surfaces: Sequence[Surface],
    frames: Sequence[PolygonMesh],
    notes: list[str],
) -> Surface:
    """Return the merged surface of several meshes, each of which becomes a named part.

    Parameters
    ----------
    names : sequence of str
    surfaces : sequence of Surface
        Surface of each mesh, without face sizes.
    frames : sequence of PolygonMesh
        The mesh of each surface.
    notes : list of str
        Receives a sentence for each attribute that only some of the meshes have.
    """
    parts = tuple(
        Part(name, len(frame.vertices), len(frame.counts))
        for name, frame in zip(names, frames, strict=True)
    )
    surfaces, materials, images = merge_materials(surfaces)
    attributes = _merged_attributes(unify_domains(surfaces, frames), frames, notes)
    groups = _merged_groups(surfaces, frames)
    hard_edges = merged_edges(
        [one.hard_edges for one in surfaces], [len(frame.vertices) for frame in frames]
    )
    return Surface(None, attributes, groups, parts, materials, images, hard_edges)


def unify_domains(surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]) -> list[Surface]:
    """Move attributes that are the same in all meshes to one domain.

    Attributes with the same kind, name and width but different domains, such as texture coordinates
    with and without seams, become corner attributes. Attributes that a mesh has twice stay.

    Parameters
    ----------
    surfaces : sequence of Surface
    frames : sequence of PolygonMesh
        The mesh of each.
    """
    domains: dict[Meaning, set[Domain]] = {}
    twice: set[Meaning] = set()
    for surface in surfaces:
        matches = [_meaning(one) for one in surface.attributes]
        twice |= {meaning for meaning in matches if matches.count(meaning) > 1}
        for meaning, one in zip(matches, surface.attributes, strict=True):
            domains.setdefault(meaning, set()).add(one.domain)
    mixed = {meaning for meaning, found in domains.items() if len(found) > 1} - twice
    return [
        replace(surface, attributes=_of_corners(surface.attributes, mixed, frame))
        for surface, frame in zip(surfaces, frames, strict=True)
    ]


def _meaning(attribute: Attribute) -> Meaning:
    return attribute.kind, attribute.name, attribute.values.shape[1]


def _of_corners(
    attributes: Sequence[Attribute], mixed: set[Meaning], frame: PolygonMesh
) -> tuple[Attribute, ...]:
    return tuple(_spread(one, frame) if _meaning(one) in mixed else one for one in attributes)


def _spread(attribute: Attribute, frame: PolygonMesh) -> Attribute:
    """Return the attribute as an indexed corner attribute with the same values."""
    if attribute.domain is Domain.CORNER:
        return attribute
    item_of: npt.NDArray[np.integer] = frame.corners
    if attribute.domain is Domain.FACE:
        item_of = np.repeat(np.arange(len(frame.counts)), frame.counts)
    rows = item_of if attribute.indices is None else attribute.indices[item_of]
    return replace(attribute, domain=Domain.CORNER, indices=rows.astype(np.int32))


def _n_items(frame: PolygonMesh, domain: Domain) -> int:
    return {
        Domain.VERTEX: len(frame.vertices),
        Domain.FACE: len(frame.counts),
        Domain.CORNER: len(frame.corners),
    }[domain]


def _merged_attributes(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh], notes: list[str]
) -> tuple[Attribute, ...]:
    """Merge attributes by kind, name, domain and width; zeros where a mesh lacks one."""
    keys = {_key(one): one for surface in surfaces for one in surface.attributes}
    merged = []
    for key, sample in keys.items():
        matches = [
            next((one for one in surface.attributes if _key(one) == key), None)
            for surface in surfaces
        ]
        if any(one is None for one in matches):
            note = f"{sample.kind} {sample.name!r} is 0 in meshes without it"
            if note not in notes:
                notes.append(note)
        dtype = np.result_type(*(one.values.dtype for one in matches if one is not None))
        merged.append(_concatenate(sample, matches, frames, dtype))
    return tuple(merged)


def _key(attribute: Attribute) -> tuple[str, str, str, int, bool]:
    width, is_byte = attribute.values.shape[1], attribute.values.dtype.kind in "iu"
    return attribute.kind, attribute.name, attribute.domain, width, is_byte


def _concatenate(
    sample: Attribute,
    matches: Sequence[Attribute | None],
    frames: Sequence[PolygonMesh],
    dtype: np.dtype[np.generic],
) -> Attribute:
    width, start = sample.values.shape[1], 0
    is_indexed = any(one is not None and one.indices is not None for one in matches)
    values, indices = [], []
    for one, frame in zip(matches, frames, strict=True):
        n_items = _n_items(frame, sample.domain)
        if one is None:
            # Unindexed attributes need a row per item; indexed ones share a single row.
            table = np.zeros((1 if is_indexed else n_items, width), dtype)
            rows = np.zeros(n_items, np.int32)
        else:
            table = one.values.astype(dtype, copy=False)
            rows = np.arange(n_items, dtype=np.int32) if one.indices is None else one.indices
        values.append(table)
        indices.append(rows + np.int32(start))
        start += len(table)
    joined = np.concatenate(indices).astype(np.int32) if is_indexed else None
    return Attribute(sample.name, sample.kind, sample.domain, np.concatenate(values), joined)


def _merged_groups(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]
) -> tuple[FaceGroups, ...]:
    names = dict.fromkeys(groups.name for surface in surfaces for groups in surface.groups)
    merged = []
    for name in names:
        labels: dict[str, int] = {}
        numbers = []
        for surface, frame in zip(surfaces, frames, strict=True):
            matches = next((one for one in surface.groups if one.name == name), None)
            if matches is None:
                numbers.append(np.full(len(frame.counts), -1, np.int32))
                continue
            new = [labels.setdefault(label, len(labels)) for label in matches.labels]
            numbers.append(np.array([*new, -1], np.int32)[matches.numbers])
        merged.append(FaceGroups(name, tuple(labels), np.concatenate(numbers)))
    return tuple(merged)


def merge_materials(
    surfaces: Sequence[Surface],
) -> tuple[list[Surface], tuple[Material, ...], tuple[Image, ...]]:
    """Return relabeled surfaces, and the materials and images of all, as `MaterialTable` does."""
    table = MaterialTable()
    relabelled = [table.add(surface) for surface in surfaces]
    return relabelled, table.materials, table.images


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
        names = {
            one.name: _add_material(renumbered(one, numbers), self._materials)
            for one in surface.materials
        }
        return replace(surface, groups=tuple(_rename_labels(one, names) for one in surface.groups))


def _add_material(material: Material, materials: dict[str, Material]) -> str:
    """Add a material under a unique name; return that name."""
    found, number = material, 2
    while materials.setdefault(found.name, found) != found:
        found, number = replace(material, name=f"{material.name}_{number}"), number + 1
    return found.name


def _rename_labels(groups: FaceGroups, names: dict[str, str]) -> FaceGroups:
    if groups.name != "material":
        return groups
    return replace(groups, labels=tuple(names.get(one, one) for one in groups.labels))
