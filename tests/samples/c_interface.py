"""The binary interface of `include/meshreel.h`, with which tests compare bindings."""

import re
import subprocess
import tempfile
from pathlib import Path

import compile as core
import pytest

HEADER = core.INCLUDE / "meshreel.h"


def functions() -> list[str]:
    """Return the names of the functions that the header declares."""
    return sorted(re.findall(r"^MESHREEL_API [\w *]*?(\w+)\(", HEADER.read_text(), re.MULTILINE))


def structures() -> dict[str, list[str]]:
    """Return the names of the public structures, with the names of their fields."""
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)
    fields = {}
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\n\}", text, re.DOTALL):
        lines = [line for line in body.split(";") if line.strip()]
        fields[name] = [field for line in lines for field in _names(line)]
    return fields


def _names(declaration: str) -> list[str]:
    """`int a, *b, c[3]` declares a, b and c; `int (*f)(int a)` declares f."""
    if function := re.search(r"\(\*(\w+)\)\(", declaration):
        return [function[1]]
    return [re.findall(r"(\w+)(?:\[\w+\])?$", part.strip())[0] for part in declaration.split(",")]


def _program() -> str:
    """Return the source of a program that prints enum values and field offsets."""
    codes = re.findall(r"\b(MESHREEL_\w+) = ", HEADER.read_text())
    lines = [f'    printf("code {code} %d\\n", (int){code});' for code in codes]
    for name, fields in structures().items():
        lines.append(f'    printf("size {name} %zu\\n", sizeof({name}));')
        for field in fields:
            offset = f"offsetof({name}, {field})"
            lines.append(f'    printf("offset {name}.{field} %zu\\n", {offset});')
    includes = f'#include <stdio.h>\n#include "{HEADER.as_posix()}"\n'
    return "\n".join([includes, "int main(void) {", *lines, "    return 0;", "}", ""])


def layouts() -> list[str]:
    """Return the enum values, and the sizes and field offsets of structures, one per line.
    Without a compiler the test is skipped.
    """
    compiler = core.compiler()
    if compiler is None:
        pytest.skip(core.NO_COMPILER)
    with tempfile.TemporaryDirectory() as work:
        source, program = Path(work, "abi.c"), Path(work, "abi.exe")
        source.write_text(_program())
        subprocess.run([*compiler, str(source), "-o", str(program)], check=True)
        done = subprocess.run([program], check=True, capture_output=True, text=True)
    return done.stdout.splitlines()
