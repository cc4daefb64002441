"""An extension of Griffe: functions that take or list fields are shown with those.

mkdocstrings reads source, where the decorators have not been applied yet.
"""

import inspect
from importlib import import_module
from typing import Any

import griffe

DECORATORS = ("takes_fields(", "lists_fields(")


class FieldsExtension(griffe.Extension):
    """Gives decorated functions the signature and the docstring that they have at run time."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Replace the parameters of a function that has one of the decorators."""
        if not any(str(decorator.value).startswith(DECORATORS) for decorator in func.decorators):
            return
        found = getattr(import_module(func.module.path), func.name)
        source = func.docstring
        func.docstring = griffe.Docstring(
            inspect.getdoc(found) or "",
            parent=func,
            lineno=func.lineno,
            parser=source.parser if source else None,
            parser_options=source.parser_options if source else None,
        )
        *shown, last = inspect.signature(found).parameters.values()
        if last.kind is last.VAR_KEYWORD:  # takes the fields of `options` by name
            options = next(one.default for one in shown if one.name == "options")
            fields = inspect.signature(type(options)).parameters.values()
            shown += [field.replace(kind=field.KEYWORD_ONLY) for field in fields]
        func.parameters = griffe.Parameters(*map(_parameter, [*shown, last]))


def _parameter(one: inspect.Parameter) -> griffe.Parameter:
    is_plain = one.default is None or isinstance(one.default, bool | int | float | str)
    shown = repr(one.default) if is_plain else getattr(one.default, "__name__", "...")
    return griffe.Parameter(
        one.name,
        annotation=inspect.formatannotation(one.annotation).replace("collections.abc.", ""),
        kind=griffe.ParameterKind(one.kind.description),
        default=None if one.default is one.empty else shown,
    )
