"""Names that a command is given, checked against those there are."""

from collections.abc import Iterable, Sequence

from meshreel.errors import InvalidInputError


def checked_names(names: Iterable[str], known: Sequence[str], noun: str) -> tuple[str, ...]:
    """The names in the order of the known ones, each once.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or there is none.
    """
    wanted = set(names)
    unknown = sorted(wanted - set(known))
    if unknown or not wanted:
        what = f"{noun} {unknown[0]!r} is unknown" if unknown else f"no {noun} is named"
        raise InvalidInputError(f"{what}; choose from {', '.join(known)}")
    return tuple(name for name in known if name in wanted)
