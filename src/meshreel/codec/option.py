"""One option of encoding: its name, type, default, range and help, written once.

The rows are in `codec.options` and, for what only some methods take, in the `options` module of a
method's own room. The API, the command line and the documentation are made from them.
"""

import math
from dataclasses import dataclass
from typing import Any, get_args, get_origin

from meshreel.errors import InvalidInputError


@dataclass(frozen=True)
class Range:
    """The numbers that are allowed.

    Parameters
    ----------
    low, high : float
    is_open : bool, default False
        Whether `low` itself is refused.
    is_whole : bool, default False
        Whether only whole numbers are allowed.
    """

    low: float
    high: float = math.inf
    is_open: bool = False
    is_whole: bool = False

    def __contains__(self, number: float) -> bool:
        if not self.low <= number <= self.high or not math.isfinite(number):
            return False
        if self.is_open and number == self.low:
            return False
        return not self.is_whole or int(number) == number

    def __str__(self) -> str:
        kind = "a whole number of " if self.is_whole else ""
        if self.high == math.inf:
            return f"above {self.low:g}" if self.is_open else f"{kind}at least {self.low:g}"
        if self.is_open:
            return f"above {self.low:g} and up to {self.high:g}"
        return f"{self.low:g}..{self.high:g}"

    @property
    def words(self) -> str:
        """The same inside of a sentence, for a range with two ends: "1 to 9"."""
        return f"{self.low:g} to {self.high:g}"

    def check(self, number: Any, name: str, unit: str = "") -> None:
        """Nothing if a number is in the range.

        Parameters
        ----------
        number : Any
        name : str
            What the number is, for the error.
        unit : str, optional

        Raises
        ------
        InvalidInputError
            If it is not, or is no number.
        """
        allowed = f"{self}, {unit}" if unit else str(self)
        if _as_number(number) not in self:
            shown = repr(number) if isinstance(number, str) else number
            raise InvalidInputError(f"{name} must be {allowed}; got {shown}")


COUNT = Range(1, is_whole=True)
"""How many of something, where there has to be one."""


@dataclass(frozen=True)
class Option:
    """A row of the table of options.

    Attributes
    ----------
    name : str
        The keyword in Python.
    type : type, or union of types
        Of a value; None besides where that is the default.
    help : str
        What is chosen, in a sentence or two. Other options are written as ``unit=``, which
        becomes ``--unit`` on the command line.
    default : object
        None: it depends, and `default_text` or `help` says on what.
    default_text : str
    names : tuple of str
        The values that are allowed, where they are names.
    range : Range or None
        The numbers that are allowed. Of an option that takes text besides, the numbers that it
        may mean.
    unit : str
        Of a number, as it follows the range: "in percent".
    more : str
        What the documentation says besides.
    group : str
        Heading in help and documentation; empty for the first.
    flag : str
        Name on the command line, such as "--modes"; made from `name` where it is empty.
    metavar : str
        Stands for the value in help.
    """

    name: str
    type: Any
    help: str
    default: Any = None
    default_text: str = ""
    names: tuple[str, ...] = ()
    range: Range | None = None
    unit: str = ""
    more: str = ""
    group: str = ""
    flag: str = ""
    metavar: str = ""

    def __post_init__(self) -> None:
        if not self.flag:
            object.__setattr__(self, "flag", f"--{self.name.replace('_', '-')}")

    @property
    def types(self) -> tuple[Any, ...]:
        """The types that a value may have."""
        return get_args(self.type) or (self.type,)

    @property
    def annotation(self) -> Any:
        """The type in a signature."""
        return self.type | None if self.default is None else self.type

    def check(self, value: Any) -> None:
        """Nothing if a value is allowed.

        Lists and text of options that take numbers, too, are left to those who read them.

        Raises
        ------
        InvalidInputError
            If it is not; says which are.
        """
        if value is None and self.default is None:
            return
        if self.type is bool and not isinstance(value, bool):
            raise InvalidInputError(f"{self.name} must be True or False; got {value!r}")
        if self.names:
            if value not in self.names:
                raise InvalidInputError(
                    f"{self.name} {value!r} is unknown; choose {', '.join(self.names)}"
                )
        elif self.range is not None and not self._is_read_elsewhere(value):
            self.range.check(value, self.name, self.unit)

    def _is_read_elsewhere(self, value: Any) -> bool:
        others = [get_origin(one) or one for one in self.types if one not in (int, float)]
        return any(isinstance(value, other) for other in others)


def _as_number(value: Any) -> float:
    """A value as a float; not-a-number if it is none."""
    try:
        return math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
