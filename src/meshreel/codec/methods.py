"""The choices a stream can be made with, and their codes in it."""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from meshreel.errors import InvalidInputError, UnsupportedVersionError


@dataclass(frozen=True)
class Method:
    """A method: a row of the paper's table of variants.

    Attributes
    ----------
    name : str
        What the user calls it.
    code : int
        What the stream calls it.
    summary : str
        One line for `--help` and `info`.
    """

    name: str
    code: int
    summary: str


METHODS = (
    Method(
        "pca-qp",
        0,
        "delta coordinates on the eigen-trajectories, quantised; least squares with anchors",
    ),
)


class Laplacian(IntEnum):
    """Which matrix the delta coordinates are made with."""

    NORMALIZED = 0
    COMBINATORIAL = 1


class Order(IntEnum):
    """What is kept of the order in which vertices and faces came."""

    KEEP = 0
    VERTICES = 1
    DROP = 2


def method_named(name: str) -> Method:
    """The method of this name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    for method in METHODS:
        if method.name == name:
            return method
    raise InvalidInputError(
        f"method {name!r} is unknown; choose {', '.join(method.name for method in METHODS)}"
    )


def method_of_code(code: int) -> Method:
    """The method of a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    for method in METHODS:
        if method.code == code:
            return method
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")


Choice = TypeVar("Choice", bound=IntEnum)


def choice_named(choices: type[Choice], name: str) -> Choice:
    """The member of an enumeration by its lower-case name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    for choice in choices:
        if choice.name.lower() == name:
            return choice
    allowed = ", ".join(choice.name.lower() for choice in choices)
    raise InvalidInputError(f"{choices.__name__.lower()} {name!r} is unknown; choose {allowed}")


def choice_of_code(choices: type[Choice], code: int) -> Choice:
    """The member of an enumeration by its code in a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    if code in list(choices):
        return choices(code)
    raise UnsupportedVersionError(
        f"{choices.__name__.lower()} {code} is unknown to this build; upgrade meshreel"
    )
