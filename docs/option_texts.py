"""What is written from the table of options: code, a docstring, and a page's tables.

    python docs/option_texts.py             prints the options as Markdown tables
    python docs/option_texts.py --write     brings EncoderConfig and encode up to date

Editors and type checkers read fields and signatures from source, so these are written there; a
test says when they are not what the table of options says.
"""

import re
import sys
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.option import Option
from meshreel.codec.options import all_options, methods_taking

ROOT = Path(__file__).parents[1]
CODEC = ROOT / "src" / "meshreel" / "codec"
WIDTH = 100
PLAIN_GROUP = "How to code"


def options_tables() -> str:
    """All options as Markdown: a table for each group, under its name in bold."""
    groups: dict[str, list[Option]] = {}
    for option in all_options():
        groups.setdefault(option.group, []).append(option)
    return "\n\n".join(
        f"**{name or PLAIN_GROUP}**\n\n{_table(rows)}" for name, rows in groups.items()
    )


def with_fields(source: str) -> str:
    """The source of `codec.config` with the fields of `EncoderConfig` as in the table."""
    fields = "".join(f"    {_declared(option)}\n" for option in _method_first())
    return _replaced(r"    method: str = .*?\n(?=\n    def )", fields, source)


def with_parameters(source: str) -> str:
    """The source of `codec.encoder` with signature and docstring of `encode` as in the table."""
    method, *others = _method_first()
    declared = [_declared(method), "*", *map(_declared, others)]
    signature = "".join(f"    {text},\n" for text in declared)
    source = _replaced(r"    method: str = .*?\n(?=    attributes: )", signature, source)
    described = "".join(map(_described, (method, *others)))
    return _replaced(r"    method : .*?\n(?=    attributes : )", described, source)


WRITTEN = {CODEC / "config.py": with_fields, CODEC / "encoder.py": with_parameters}
"""Files that hold texts from the table, and how each is brought up to date."""


def _replaced(lines: str, by: str, source: str) -> str:
    """A source with other lines in place of the first that match."""
    return re.sub(rf"(?<=\n){lines}", lambda _: by, source, count=1, flags=re.DOTALL)


def _method_first() -> tuple[Option, ...]:
    """All options, with the one first that is no keyword only."""
    (method,) = (option for option in all_options() if option.name == "method")
    return method, *(option for option in all_options() if option is not method)


def _declared(option: Option) -> str:
    return f"{option.name}: {_annotation(option.annotation)} = {_literal(option.default)}"


def _literal(default: Any) -> str:
    return f'"{default}"' if isinstance(default, str) else repr(default)


def _annotation(given: Any) -> str:
    is_plain = isinstance(given, type) and not get_args(given)
    return given.__name__ if is_plain else str(given).replace("collections.abc.", "")


def _described(option: Option) -> str:
    """An option as numpydoc has a parameter."""
    names, text = ", ".join(map(_literal, option.names)), _help(option)
    default = "optional" if option.default is None else f"default {_literal(option.default)}"
    head = f"{option.name} : {{{names}}}, {default}"
    if not names or len(head) > WIDTH - 4:
        head = f"{option.name} : {_type_text(option)}, {default}"
        text = f"One of {names}. {text}" if names else text
    lines = [head, *(f"    {line}" for line in _wrapped(text))]
    return textwrap.indent("\n".join(lines), "    ") + "\n"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH - 8, break_on_hyphens=False)


def _type_text(option: Option) -> str:
    return " or ".join(map(_type_name, option.types))


def _type_name(kind: Any) -> str:
    if get_origin(kind) is Mapping:
        return "mapping"
    return f"sequence of {get_args(kind)[0].__name__}" if get_origin(kind) else kind.__name__


def _help(option: Option) -> str:
    texts = [re.sub(r"\b(\w+)=", r"`\1`", option.help)]
    if option.default_text:
        texts.append(f"Default: {option.default_text}.")
    return " ".join(filter(None, [*texts, option.more]))


def _table(options: list[Option]) -> str:
    heads = ("Python", "command line", "type", "default", "methods", "meaning")
    return "\n".join([_cells(heads), _cells(["---"] * len(heads)), *map(_row, options)])


def _row(option: Option) -> str:
    shown = ", ".join(f"`{name}`" for name in methods_taking(option))
    others = [name for name in METHOD_NAMES if name not in methods_taking(option)]
    if len(others) < 2:
        shown = f"all but `{others[0]}`" if others else "all"
    kind = ", ".join(f'`"{name}"`' for name in option.names) or _type_text(option)
    if option.range is not None:
        allowed = str(option.range).removeprefix("a whole number of ")
        kind = ", ".join(filter(None, (kind, allowed, option.unit)))
    default = "" if option.default is None else f"`{_literal(option.default)}`"
    return _cells((f"`{option.name}`", f"`{option.flag}`", kind, default, shown, _help(option)))


def _cells(texts: Iterable[str]) -> str:
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        for path, updated in WRITTEN.items():
            path.write_text(updated(path.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        print(options_tables())
