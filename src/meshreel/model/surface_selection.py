"""Selection of attributes and groups of a surface by name."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, FaceGroups, Kind, Surface

Names = str | Sequence[str]
"""Names of attributes and groups: a list, text such as "uv,color", "all" or "none"."""

ALL, NONE = "all", "none"


def select(surface: Surface, names: Names, *, ignore_missing: bool = False) -> Surface:
    """Return a surface with only the attributes and groups of these names.

    Polygons, hard edges and parts are kept; materials and images only with the groups "material".

    Parameters
    ----------
    names : str or sequence of str
        "all", "none", or names; a kind such as "uv" or "color" selects all its attributes.
    ignore_missing : bool, default False
        Whether to ignore names that do not exist.

    Raises
    ------
    InvalidInputError
        If a name does not exist; the message lists existing names.
    """
    if names == ALL:
        return surface
    if not ignore_missing and (missing := missing_names(surface, names)):
        raise InvalidInputError(describe_missing(surface, missing))
    selected = set(listed_names(names))
    attributes = tuple(
        attribute for attribute in surface.attributes if selected & _names_of(attribute)
    )
    groups = tuple(groups for groups in surface.groups if groups.name in selected)
    base = surface if "material" in selected else surface.without_materials()
    return replace(base, attributes=attributes, groups=groups)


def missing_names(surface: Surface, names: Names) -> list[str]:
    """The names that no attribute or group of a surface has."""
    if names == ALL:
        return []
    existing = {groups.name for groups in surface.groups}.union(*map(_names_of, surface.attributes))
    return [name for name in listed_names(names) if name not in existing]


def missing_everywhere(surfaces: Sequence[Surface], names: Names) -> list[str]:
    """Return the names that no attribute or group of any surface has."""
    first, *others = (missing_names(surface, names) for surface in surfaces)
    return [name for name in first if all(name in missing for missing in others)]


def describe_missing(surface: Surface, names: Sequence[str]) -> str:
    """A message with names that do not exist, and the existing names."""
    contents: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    existing = ", ".join(repr(content.name) for content in contents) or "none"
    return f"has no attribute or group {', '.join(map(repr, names))}; it has {existing}"


def listed_names(names: Names) -> list[str]:
    """The names as a list; empty for "none".

    Raises
    ------
    InvalidInputError
        If a name is empty.
    """
    if names == NONE:
        return []
    items = [name.strip() for name in names.split(",")] if isinstance(names, str) else [*names]
    if not all(items):
        raise InvalidInputError(
            f"attributes takes all, none, or names such as uv,color; got {names!r}"
        )
    return items


def differing_names(first: Surface, second: Surface) -> list[str]:
    """Names of attributes, groups and materials that differ, or "hard edges"."""
    a, b = dict(_contents(first)), dict(_contents(second))
    differing = [key for key in {**a, **b} if a.get(key) != b.get(key)]
    return list(dict.fromkeys(name for _, name in differing))


def _contents(surface: Surface) -> Iterator[tuple[tuple[str, str], tuple[object, ...]]]:
    """Yield a key for each attribute, groups, material and hard edges, with values to compare."""
    for attribute in surface.attributes:
        values = attribute.per_item()
        key = ("attribute", attribute.name)
        yield key, (attribute.domain, values.dtype, values.shape, values.tobytes())
    for groups in surface.groups:
        yield ("groups", groups.name), (groups.labels, groups.numbers.tobytes())
    for material in surface.materials:
        yield ("material", material.name), (material,)
    if surface.hard_edges is not None:
        yield ("edges", "hard edges"), (surface.hard_edges.tobytes(),)


def _names_of(attribute: Attribute) -> set[str]:
    """Names that select an attribute: its own, and its kind unless that is "other"."""
    return {attribute.name} | ({str(attribute.kind)} - {str(Kind.OTHER)})
