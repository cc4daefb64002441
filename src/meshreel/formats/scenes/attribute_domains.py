"""Attributes of several meshes, those that are the same of vertices, faces or corners alike."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.surface import Attribute, Domain, Surface

Meaning = tuple[str, str, int]


def in_one_domain(surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]) -> list[Surface]:
    """The surfaces, whose attributes of one kind, name and width are of the same domain.

    Where they are not, as texture coordinates with and without seams, all become those of corners.
    What a mesh has twice stays as it is.

    Parameters
    ----------
    surfaces : sequence of Surface
    frames : sequence of PolygonMesh
        The mesh of each.
    """
    domains: dict[Meaning, set[Domain]] = {}
    twice: set[Meaning] = set()
    for surface in surfaces:
        own = [_meaning(one) for one in surface.attributes]
        twice |= {meaning for meaning in own if own.count(meaning) > 1}
        for meaning, one in zip(own, surface.attributes, strict=True):
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
    """The attribute as one of corners; its values stay, and are referred to."""
    if attribute.domain is Domain.CORNER:
        return attribute
    item_of: npt.NDArray[np.integer] = frame.corners
    if attribute.domain is Domain.FACE:
        item_of = np.repeat(np.arange(len(frame.counts)), frame.counts)
    rows = item_of if attribute.indices is None else attribute.indices[item_of]
    return replace(attribute, domain=Domain.CORNER, indices=rows.astype(np.int32))
