"""Options of commands that register raw captures."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import click

from meshreel.app.cli.parameters import Group
from meshreel.codec.option import Option
from meshreel.formats.options import READING

if TYPE_CHECKING:
    from meshreel.operations.registering import Registering

HOLES = Option(
    "Keep the holes of scans, which registered surfaces close: a track scanned is 1 for the faces "
    "that the raw frame has, otherwise 0. Players and pictures hide the others.",
    group=READING,
)
KeepHolesOption = Annotated[bool, HOLES]
_REGISTER = Option(
    "Follow the surface of a raw capture, which has a new mesh in every frame, with few meshes, up "
    "to this distance: 0.2% of the diagonal, or 0.5u in model units (needs [register]; see "
    "`meshreel register`).",
    name="register",
    annotation=str,
    group=READING,
    metavar="TOLERANCE",
    flag="--register",
)
_KEEP_HOLES = replace(HOLES, name="keep_holes", annotation=bool, default=False, flag="--keep-holes")


def _registering(values: dict[str, Any]) -> "Registering | None":
    tolerance, keep_holes = values["register"], values["keep_holes"]
    if tolerance is None:
        if keep_holes:
            raise click.UsageError("--keep-holes is for captures; add --register")
        return None
    from meshreel.codec.error_bounds import bound_of
    from meshreel.operations.registering import Registering

    return Registering(tolerance=bound_of(tolerance, option="register"), keep_holes=keep_holes)


RegisteringOption = Annotated[
    "Registering | None", Group((_REGISTER, _KEEP_HOLES), _registering, ())
]
"""Options of commands that can register their input before they write it."""
