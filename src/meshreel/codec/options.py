"""All options of encoding, and the class of those of a method."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from functools import cache
from typing import Any

from meshreel.codec.config import DEFAULT_METHOD, EncoderConfig
from meshreel.codec.methods import own_name
from meshreel.codec.option import Option, options_of_fields
from meshreel.codec.paper_options import PAPER, PaperOptions
from meshreel.codec.reel_options import ReelOptions
from meshreel.errors import InvalidInputError

FAMILIES = (ReelOptions, PaperOptions)


@cache
def all_options() -> tuple[Option, ...]:
    """Return the options of all methods, shared ones first."""
    by_name = {option.name: option for row in FAMILIES for option in options_of_fields(row)}
    return tuple(by_name.values())


def option_named(name: str) -> Option:
    """Return the option of this name, which must exist."""
    return next(option for option in all_options() if option.name == name)


def check_names(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise InvalidInputError, with the closest known name, unless all names are known."""
    allowed = list(known)
    for name in names:
        if name not in allowed:
            raise InvalidInputError(f"option {name!r} is unknown; {_advice(name, allowed)}")


def _advice(name: str, allowed: Sequence[str]) -> str:
    for option in all_options():
        if name in option.synonyms:
            return f"its name is {option.name}=" + ", ".join(
                filter(None, ["", option.synonyms[name]])
            )
    near = get_close_matches(name, allowed, 1)
    return f"did you mean {near[0]!r}?" if near else f"choose {', '.join(allowed)}"


def config_of(method: str = DEFAULT_METHOD, **options: Any) -> EncoderConfig:
    """Return the checked options of a method.

    Raises
    ------
    InvalidInputError
        If an option is unknown, out of range or of another method, or two exclude each other.
    """
    check_names(options, (option.name for option in all_options()))
    family = PaperOptions if own_name(method) in PAPER else ReelOptions
    own = {option.name for option in options_of_fields(family)}
    for name in options.keys() - own:
        option = option_named(name)
        option.check(options[name])
        if options[name] != option.default:
            option.check_method(own_name(method))
    return family(method, **{name: options[name] for name in options if name in own})
