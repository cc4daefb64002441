"""Selection of attributes and groups of a surface by name."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, FaceGroups, Kind, Surface

Names = str | Sequence[str]
"""Names of attributes and groups: a list, or text such as "uv,color"; or "all", or "none"."""

ALL, NONE = "all", "none"


def selected(surface: Surface, names: Names) -> Surface:
    """A surface with the attributes and groups of these names, all polygons, hard edges and parts.

    Materials and images are kept with the groups "material".

    Parameters
    ----------
    names : str or sequence of str
        "all", "none", or names; a kind such as "uv" or "color" names all attributes of it.

    Raises
    ------
    InvalidInputError
        If a name does not exist; lists those that do.
    """
    if names == ALL:
        return surface
    if unknown := missing_names(surface, names):
        raise InvalidInputError(describe_missing(surface, unknown))
    return chosen(surface, names)


def chosen(surface: Surface, names: Names) -> Surface:
    """As `selected`, but names that do not exist are ignored."""
    if names == ALL:
        return surface
    wanted = set(listed_names(names))
    attributes = tuple(one for one in surface.attributes if wanted & _names_of(one))
    groups = tuple(one for one in surface.groups if one.name in wanted)
    kept = surface if "material" in wanted else surface.without_materials()
    return replace(kept, attributes=attributes, groups=groups)


def missing_names(surface: Surface, names: Names) -> list[str]:
    """The names that no attribute or group of a surface has."""
    there = {one.name for one in surface.groups}.union(*map(_names_of, surface.attributes))
    return [] if names == ALL else [name for name in listed_names(names) if name not in there]


def describe_missing(surface: Surface, names: Sequence[str]) -> str:
    """A message that these names do not exist, and which do."""
    carried: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    there = [repr(one.name) for one in carried]
    found = f"it carries {', '.join(there)}" if there else "it carries none"
    return f"has no attribute or group {', '.join(map(repr, names))}; {found}"


def listed_names(names: Names) -> list[str]:
    """List of the names; empty for "none".

    Raises
    ------
    InvalidInputError
        If one is empty.
    """
    if names == NONE:
        return []
    found = [name.strip() for name in names.split(",")] if isinstance(names, str) else [*names]
    if not all(found):
        raise InvalidInputError(
            f"attributes takes all, none, or names as in uv,color; got {names!r}"
        )
    return found


def differing_names(first: Surface, other: Surface) -> list[str]:
    """Names of attributes and groups that differ between two surfaces, or "hard edges"."""
    given, found = (dict(_contents(one)) for one in (first, other))
    names = [name for name in {**given, **found} if given.get(name) != found.get(name)]
    return list(dict.fromkeys(name for _, name in names))


def _contents(surface: Surface) -> Iterator[tuple[tuple[str, str], tuple[object, ...]]]:
    """Type and name of each attribute, each kind of groups and hard edges, with what to compare."""
    for one in surface.attributes:
        values = one.per_item()
        yield ("attribute", one.name), (one.domain, values.dtype, values.shape, values.tobytes())
    for groups in surface.groups:
        yield ("groups", groups.name), (groups.labels, groups.numbers.tobytes())
    if surface.hard_edges is not None:
        yield ("edges", "hard edges"), (surface.hard_edges.tobytes(),)


def _names_of(attribute: Attribute) -> set[str]:
    """Names that select an attribute: its own, and its kind unless that is "other"."""
    is_named_by_kind = attribute.kind is not Kind.OTHER
    return {attribute.name, *([str(attribute.kind)] if is_named_by_kind else [])}
