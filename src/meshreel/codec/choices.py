"""Choices that a stream is made with, whatever its method, and their codes in it."""

from enum import Enum, IntEnum
from typing import TypeVar

from meshreel.errors import InvalidInputError, UnsupportedVersionError


class Laplacian(IntEnum):
    """Which matrix the delta coordinates are made with."""

    NORMALIZED = 0
    COMBINATORIAL = 1


class Order(IntEnum):
    """What is kept of the order in which vertices and faces came."""

    KEEP = 0
    VERTICES = 1
    DROP = 2


Choice = TypeVar("Choice", bound=Enum)


CodedChoice = TypeVar("CodedChoice", bound=IntEnum)


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


def choice_of_code(choices: type[CodedChoice], code: int) -> CodedChoice:
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
