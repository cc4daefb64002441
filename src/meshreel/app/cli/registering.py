"""Options of commands that register raw captures, derived from `registration.options`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import click

from meshreel.app.cli.parameters import Group
from meshreel.codec.error_bounds import bound_of
from meshreel.codec.option import options_of_fields
from meshreel.registration.options import RegisterOptions

_OPTIONS = {option.name: option for option in options_of_fields(RegisterOptions)}
_OUTPUT = replace(
    _OPTIONS["texture_output"],
    annotation=Path,
    help=f"{_OPTIONS['texture_output'].help} Default: a video named after the output.",
)
REGISTERING = Group(
    (_OPTIONS["tolerance"], _OPTIONS["texture"], _OUTPUT, _OPTIONS["keep_holes"]), dict
)
"""Options of `meshreel register`."""

_REGISTER = replace(
    _OPTIONS["tolerance"],
    name="register",
    flag="--register",
    default=None,
    help="Follow the surface of a raw capture, which has a new mesh in every frame, with few "
    "meshes, up to this distance: 0.2% of the diagonal, or 0.5u in model units (needs [register]; "
    "see `meshreel register`).",
    group=_OPTIONS["keep_holes"].group,
    metavar="TOLERANCE",
)


def _registering(values: dict[str, Any]) -> RegisterOptions | None:
    tolerance, keep_holes = values["register"], values["keep_holes"]
    if tolerance is None:
        if keep_holes:
            raise click.UsageError("--keep-holes is for captures; add --register")
        return None
    bound = bound_of(tolerance, option="register")
    return RegisterOptions(tolerance=bound.plain, keep_holes=keep_holes)


RegisteringOption = Annotated[
    RegisterOptions | None, Group((_REGISTER, _OPTIONS["keep_holes"]), _registering, ())
]
"""Options of commands that can register their input before they write it."""
