"""Text about the cells, attributes, materials and images of a surface."""

import numpy as np

from meshreel.kernel.cells import cell_sizes
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
    cells: list[str] = []
    types = () if surface.cells is None else surface.cells.types
    for number, n_cells in zip(*np.unique(types, return_counts=True), strict=True):
        shape, n_nodes = _SHAPE_OF_TYPE[int(number)], cell_sizes()[number]
        is_linear = number == _SHAPES[shape][0]
        text = counted(int(n_cells), shape)
        cells.append(text if is_linear else f"{text} of {n_nodes} nodes")

    attributes = [
        f"{attribute.kind} {attribute.name!r} of {plural(str(attribute.domain))}"
        for attribute in surface.attributes
    ]
    attributes += [
        f"{counted(len(groups.labels), 'group')} {groups.name!r} of faces"
        for groups in surface.groups
    ]
    if surface.hard_edges is not None:
        attributes.append(counted(len(surface.hard_edges), "hard edge"))

    materials = []
    for material in surface.materials:
        textures = [
            f"{slot.replace('_', ' ')} image {texture.image}"
            for slot, texture in material.textures.items()
        ]
        materials.append(f"{material.name}: {', '.join(textures)}" if textures else material.name)

    images = []
    for number, image in enumerate(surface.images):
        name = f"{image.name!r}, " if image.name else ""
        images.append(f"{number}: {name}{image.mime_type}, {len(image.data)} bytes")

    return {
        "cells": tuple(cells),
        "attributes": tuple(attributes),
        "parts": tuple(part.name for part in surface.parts),
        "materials": tuple(materials),
        "images": tuple(images),
    }
