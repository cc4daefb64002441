"""All options of encoding, and the class of those of a method."""

from functools import cache
from typing import Any

from meshreel.codec.config import DEFAULT_METHOD, EncoderConfig
from meshreel.codec.method_names import METHOD_NAMES, our_name
from meshreel.codec.option import Option, check_names, options_of_fields
from meshreel.codec.paper_options import PAPER_METHODS, PaperOptions
from meshreel.codec.reel_options import ReelOptions

FAMILIES = (ReelOptions, PaperOptions)
_NAMES = {row: frozenset(option.name for option in options_of_fields(row)) for row in FAMILIES}


@cache
def all_options() -> tuple[Option, ...]:
    """Return the options of all methods, shared ones first."""
    by_name = {option.name: option for row in FAMILIES for option in options_of_fields(row)}
    return tuple(by_name.values())


def option_named(name: str) -> Option:
    """Return the option of this name, which must exist."""
    return next(option for option in all_options() if option.name == name)


def config_of(method: str = DEFAULT_METHOD, **options: Any) -> EncoderConfig:
    """Return the checked options of a method.

    Raises
    ------
    InvalidInputError
        If an option is unknown, out of range or of another method, or two exclude each other.
    """
    names = [option.name for option in all_options()]
    if not options.keys() <= {*names}:
        check_names(options, names, all_options())
    method = method if method in METHOD_NAMES else our_name(method)
    family = PaperOptions if method in PAPER_METHODS else ReelOptions
    supported = _NAMES[family]
    for option in all_options():
        name = option.name
        value = options.get(name, option.default)
        if name not in supported and value is not option.default:
            option.check(value)
            if value != option.default:
                option.check_method(method)
    return family(method, **{name: options[name] for name in options if name in supported})
