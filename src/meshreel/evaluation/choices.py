"""Validation of lists of names, such as codecs on the command line."""

from collections.abc import Iterable, Sequence

from meshreel.errors import InvalidInputError


def checked_names(names: Iterable[str], known: Sequence[str], noun: str) -> tuple[str, ...]:
    """Return the distinct names in the order of `known`.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    selected = set(names)
    unknown = sorted(selected - set(known))
    if unknown or not selected:
        problem = f"{noun} {unknown[0]!r} is unknown" if unknown else f"name at least one {noun}"
        raise InvalidInputError(f"{problem}; choose from {', '.join(known)}")
    return tuple(name for name in known if name in selected)
