"""Materials of several meshes as those of one, with what is the same only once."""

from collections.abc import Sequence
from dataclasses import replace

from meshreel.materials import Image, Material, renumbered
from meshreel.surface import FaceGroups, Surface


def shared_look(
    surfaces: Sequence[Surface],
) -> tuple[list[Surface], tuple[Material, ...], tuple[Image, ...]]:
    """The surfaces, and the materials and images of all of them.

    Where two materials of one name differ, the second gets a number behind its name, and so do
    the labels of its faces.
    """
    images: dict[Image, int] = {}
    materials: dict[str, Material] = {}
    relabelled = []
    for surface in surfaces:
        numbers = {
            number: images.setdefault(image, len(images))
            for number, image in enumerate(surface.images)
        }
        names = {
            one.name: _taken_in(renumbered(one, numbers), materials) for one in surface.materials
        }
        groups = tuple(_renamed(one, names) for one in surface.groups)
        relabelled.append(replace(surface, groups=groups))
    return relabelled, tuple(materials.values()), tuple(images)


def _taken_in(material: Material, materials: dict[str, Material]) -> str:
    """The name under which a material is among the others from now on."""
    found, number = material, 2
    while materials.setdefault(found.name, found) != found:
        found, number = replace(material, name=f"{material.name}_{number}"), number + 1
    return found.name


def _renamed(groups: FaceGroups, names: dict[str, str]) -> FaceGroups:
    if groups.name != "material":
        return groups
    return replace(groups, labels=tuple(names.get(one, one) for one in groups.labels))
