"""Print the binary interface of `include/meshreel.h`: `python core/abi.py`.

Functions, enum values, and the offsets of structure fields are stored in `reader/abi.txt`; a test
compares them. A changed or removed line breaks compiled programs: raise MESHREEL_ABI with it.
`--write` updates the file.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import compile as core

HEADER = core.INCLUDE / "meshreel.h"
STORED = core.READER / "abi.txt"


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
    start = '    printf("abi %d\\n", MESHREEL_ABI);'
    return "\n".join([includes, "int main(void) {", start, *lines, "    return 0;", "}", ""])


def described() -> str:
    """Return the binary interface, one item per line.

    Raises
    ------
    RuntimeError
        If there is no compiler.
    """
    compiler = core.compiler()
    if compiler is None:
        raise RuntimeError(core.NO_COMPILER)
    with tempfile.TemporaryDirectory() as work:
        source, program = Path(work, "abi.c"), Path(work, "abi.exe")
        source.write_text(_program())
        subprocess.run([*compiler, str(source), "-o", str(program)], check=True)
        done = subprocess.run([program], check=True, capture_output=True, text=True)
    first, *others = done.stdout.splitlines()
    return "\n".join([first, *(f"function {name}" for name in functions()), *others, ""])


def main() -> None:
    """Print the interface, or store it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="update reader/abi.txt")
    options = parser.parse_args()
    try:
        interface = described()
    except RuntimeError as error:
        sys.exit(str(error))
    if options.write:
        STORED.write_text(interface)
    else:
        print(interface, end="")


if __name__ == "__main__":
    main()
