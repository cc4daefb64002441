"""Text about the cells, attributes, materials and images of a surface."""

import numpy as np

from meshreel.kernel.cells import cell_sizes
from meshreel.model.materials import Image, Material
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted, plural

_SHAPES = {
    "point": (1,), "line": (3, 21), "triangle": (5, 22, 34), "quad": (9, 23, 28),
    "tetrahedron": (10, 24), "hexahedron": (12, 25, 29, 33), "wedge": (13, 26, 32),
    "pyramid": (14, 27), "pentagonal prism": (15,), "hexagonal prism": (16,),
}  # fmt: skip
_SHAPE_OF_TYPE = {number: shape for shape, numbers in _SHAPES.items() for number in numbers}


SURFACE_TEXTS = ("cells", "attributes", "parts", "materials", "images")
"""Keys of `describe_surface`."""


def describe_surface(surface: Surface) -> dict[str, tuple[str, ...]]:
    """Return lines of text about the cells, attributes, parts, materials and images of a surface.

    Examples are "8 hexahedra", "2 hexahedra of 20 nodes", "uv 'st' of corners", "skin: normal image
    0" and "0: 'shade', image/png, 92 bytes".
    """
    return {
        "cells": _describe_cells(surface),
        "attributes": _describe_attributes(surface),
        "parts": tuple(part.name for part in surface.parts),
        "materials": tuple(map(_describe_material, surface.materials)),
        "images": tuple(_describe_image(*numbered) for numbered in enumerate(surface.images)),
    }


def _describe_cells(surface: Surface) -> tuple[str, ...]:
    """Return the number of cells of each type."""
    if surface.cells is None:
        return ()
    rows = []
    for number, n_cells in zip(*np.unique(surface.cells.types, return_counts=True), strict=True):
        shape, n_nodes = _SHAPE_OF_TYPE[int(number)], cell_sizes()[number]
        is_linear = number == _SHAPES[shape][0]
        text = counted(int(n_cells), shape)
        rows.append(text if is_linear else f"{text} of {n_nodes} nodes")
    return tuple(rows)


def _describe_attributes(surface: Surface) -> tuple[str, ...]:
    """Return a text for each attribute, kind of groups and hard edges."""
    attributes = [
        f"{attribute.kind} {attribute.name!r} of {plural(str(attribute.domain))}"
        for attribute in surface.attributes
    ]
    groups = [
        f"{counted(len(groups.labels), 'group')} {groups.name!r} of faces"
        for groups in surface.groups
    ]
    hard = [] if surface.hard_edges is None else [counted(len(surface.hard_edges), "hard edge")]
    return (*attributes, *groups, *hard)


def _describe_material(material: Material) -> str:
    textures = [
        f"{slot.replace('_', ' ')} image {texture.image}"
        for slot, texture in material.textures.items()
    ]
    return f"{material.name}: {', '.join(textures)}" if textures else material.name


def _describe_image(number: int, image: Image) -> str:
    name = f"{image.name!r}, " if image.name else ""
    return f"{number}: {name}{image.mime_type}, {len(image.data)} bytes"
