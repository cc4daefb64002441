"""Choices that the paper leaves open, for experiments: `PaperChoices`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any, Literal, get_args, get_type_hints

from meshreel.codec.option import Range
from meshreel.errors import InvalidInputError

AnchorValues = Literal["positions", "coefficients"]
AnchorSet = Literal["farthest", "random"]
QuantizedSignal = Literal["coefficients", "deltas"]
Dictionary = Literal["difference", "whole"]
Rotation = Literal["ritz", "none"]
Centering = Literal["box", "none"]

BITS = Range(2, 24, is_whole=True)
SEED = Range(0, 2**63 - 1, is_whole=True)


@dataclass(frozen=True, kw_only=True)
class PaperChoices:
    """Choices that the paper leaves open; the defaults measured best or are the printed ones.

    Attributes
    ----------
    anchor_values : {"positions", "coefficients"}
        Coded values of each anchor: its positions in all T frames (Eq. 12), or its K
        coefficients. With coefficients, its motion outside the span of the K modes is lost.
    anchor_set : {"farthest", "random"}
        Farthest-point samples in edge counts, or a random subset. Every component gets at least one
        anchor. A list of vertices in ``encode(anchors=[...])`` replaces this choice and
        `anchor_seed`.
    anchor_seed : int
        Seed of the random subset, 0 or larger.
    anchor_bits : int or None
        Bits of the largest position or coefficient, 2 to 24. None: 4 more than the coefficients
        of the deltas have, up to 24, for positions; 16 for coefficients. The paper assumes 16.
    dictionary_bits : int
        Bits of the largest entry of a dictionary, 2 to 24.
    quantize : {"coefficients", "deltas"}
        The quantized signal: the projected deltas (Eq. 10), or the deltas of every frame before
        projection, as the text of the paper describes variant (ii). Projected quantized deltas
        are coded with 16 bits.
    dictionary : {"difference", "whole"}
        How `blocks` codes the dictionary of a block: as the difference from the previous block, or
        whole.
    centering : {"box", "none"}
        Positions from which R = A A^T is computed: relative to the center of the bounding box, or
        as given, as Eq. 7 is printed. Only the eigen-trajectories depend on it, as deltas do not
        change with translation. Not for `v2v`, which codes positions.
    rotation : {"ritz", "none"}
        Whether `blocks` rotates a tracked basis to the eigenvectors of R within its span.

    Raises
    ------
    InvalidInputError
        If a value is not one of these.
    """

    anchor_values: AnchorValues = "positions"
    anchor_set: AnchorSet = "farthest"
    anchor_seed: int = 0
    anchor_bits: int | None = None
    dictionary_bits: int = 16
    quantize: QuantizedSignal = "coefficients"
    centering: Centering = "box"
    dictionary: Dictionary = "difference"
    rotation: Rotation = "ritz"

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(PaperChoices).items():
            allowed, value = get_args(kind), getattr(self, name)
            if allowed and all(isinstance(item, str) for item in allowed) and value not in allowed:
                raise InvalidInputError(
                    f"choice {name} must be {' or '.join(map(repr, allowed))}; got {value!r}"
                )
        BITS.check(self.dictionary_bits, "choice dictionary_bits")
        SEED.check(self.anchor_seed, "choice anchor_seed")
        if self.anchor_bits is not None:
            BITS.check(self.anchor_bits, "choice anchor_bits")

    @property
    def changed(self) -> dict[str, Any]:
        """The choices that differ from the defaults, by name."""
        return {
            field.name: value
            for field in fields(self)
            if (value := getattr(self, field.name)) != field.default
        }


def choices_of(option: str | Mapping[str, Any] | None) -> PaperChoices:
    """Return the choices of an option of `encode` or the command line.

    Parameters
    ----------
    option : str, mapping or None
        A string is a list such as ``"anchor-values=coefficients,dictionary-bits=12"``.

    Raises
    ------
    InvalidInputError
        If a name is unknown or a value is not allowed.
    """
    if option is None:
        return PaperChoices()
    if not isinstance(option, str | Mapping):
        raise InvalidInputError(
            f"choices must be a mapping, or text such as 'anchor-bits=16'; got {option!r}"
        )
    values: dict[str, Any] = {} if isinstance(option, str) else dict(option)
    for part in option.split(",") if isinstance(option, str) else ():
        name, equals, value = (token.strip() for token in part.partition("="))
        if not (name and equals and value):
            raise InvalidInputError(
                f"choices are NAME=VALUE, separated by commas, as in anchor-bits=16; got {part!r}"
            )
        values[name.replace("-", "_")] = int(value) if value.isdecimal() else value
    known = [field.name for field in fields(PaperChoices)]
    for name in values:
        if name not in known:
            near = get_close_matches(name, known, 1)
            advice = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(known)}"
            raise InvalidInputError(f"choice {name!r} is unknown; {advice}")
    return PaperChoices(**values)
