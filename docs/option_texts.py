"""Options of encoding as Markdown tables, derived from their fields.

python docs/option_texts.py
"""

from collections.abc import Iterable

from meshreel.app.cli.options import ENCODING_OPTIONS
from meshreel.codec.method_names import METHOD_NAMES
from meshreel.codec.option import Option, documentation, literal, type_text
from meshreel.codec.options import all_options

_ON_COMMAND_LINE = {option.name for option in ENCODING_OPTIONS}

PLAIN_GROUP = "How to code"


def options_tables() -> str:
    """All options as Markdown: a table for each group, under its name in bold."""
    groups: dict[str, list[Option]] = {}
    for option in all_options():
        groups.setdefault(option.group, []).append(option)
    return "\n\n".join(
        f"**{name or PLAIN_GROUP}**\n\n{_table(rows)}" for name, rows in groups.items()
    )


def _table(options: list[Option]) -> str:
    heads = ("Python", "command line", "type", "default", "methods", "meaning")
    return "\n".join([_cells(heads), _cells(["---"] * len(heads)), *map(_row, options)])


def _row(option: Option) -> str:
    shown = ", ".join(f"`{name}`" for name in option.methods)
    others = [name for name in METHOD_NAMES if name not in option.methods]
    if len(others) < 2:
        shown = f"all but `{others[0]}`" if others else "all"
    kind = ", ".join(f'`"{name}"`' for name in option.names) or type_text(option)
    if option.range is not None:
        allowed = str(option.range).removeprefix("a whole number of ")
        kind = ", ".join(filter(None, (kind, allowed, option.unit)))
    default = "" if option.default is None else f"`{literal(option.default)}`"
    meaning = documentation(option)
    flag = f"`{option.flag}`" if option.name in _ON_COMMAND_LINE else ""
    return _cells((f"`{option.name}`", flag, kind, default, shown, meaning))


def _cells(texts: Iterable[str]) -> str:
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


if __name__ == "__main__":
    print(options_tables())
