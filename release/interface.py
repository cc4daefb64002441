"""List the public interface: names, parameters, commands, options and the format.

    python release/interface.py            # prints the list
    python release/interface.py --write    # stores it in interface.txt
    python release/interface.py --release  # also stores it in released.txt, with the version

A test compares `interface.txt`, so that no change of the interface goes unnoticed, and lets no line
of `released.txt` disappear before the next major version; docs/policies.md.
"""

import argparse
import ast
import enum
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import click

import meshreel
from meshreel.app.cli.commands import COMMANDS, command_named
from meshreel.codec.bitstream.layout import FORMAT_VERSION

FOLDER = Path(__file__).parent
ROOT = FOLDER.parent
STORED, RELEASED = FOLDER / "interface.txt", FOLDER / "released.txt"
TORCH = ROOT / "src" / "meshreel" / "torch.py"
"""Read as text, for PyTorch may be missing."""

NPM_MODULES = {
    "meshreel": "index.ts",
    "meshreel/three": "three/index.ts",
    "meshreel/player": "player/index.ts",
}
RETURNED = {
    "Quality",
    "ReelFile",
    "StreamInfo",
    "SurfaceDistances",
    "SurfaceQuality",
}
"""Classes that functions return; their constructors are not public."""

EXPORTED = re.compile(
    r"^export (?:declare )?(?:abstract )?(?:class|function|const|interface|type|enum) (\w+)",
    re.MULTILINE,
)
EXPORT_LIST = re.compile(r"^export (?:type )?\{(.*?)\}", re.MULTILINE | re.DOTALL)
EXPORT_ALL = re.compile(r'^export (?:type )?\* from "(.+)\.js";$', re.MULTILINE)


def described() -> list[str]:
    """Return all lines, sorted."""
    lines = [f"format {FORMAT_VERSION}", *_commands(), *_npm()]
    for name in meshreel.__all__:
        lines += _object(name, getattr(meshreel, name))
    lines += (f"python paper.{name}" for name in meshreel.paper.__all__)
    for node in ast.parse(TORCH.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            lines += _syntax(f"torch.{node.name}", node)
    return sorted(set(lines))


def broken(released: list[str], current: list[str]) -> list[str]:
    """Return the lines of the released interface that are missing now."""
    return sorted(set(released) - set(current))


def read_released() -> tuple[str, list[str]]:
    """Return the version of the last release and its lines."""
    first, *lines = RELEASED.read_text(encoding="utf-8").splitlines()
    return first.removeprefix("version "), lines


def _object(name: str, value: object) -> Iterator[str]:
    """Yield a name of the package, its parameters and, for classes, its members."""
    yield f"python {name}"
    if not inspect.isclass(value):
        assert callable(value)
        yield from _parameters(name, inspect.signature(value))
        return
    if issubclass(value, BaseException):
        yield from (f"python {name}({base.__name__})" for base in value.__bases__)
        return
    if issubclass(value, enum.Enum):
        yield from (
            f"python {name}.{member} = {value[member].value!r}" for member in value.__members__
        )
        return
    if name not in RETURNED:
        yield from _parameters(name, inspect.signature(value))
    for owner in reversed(value.__mro__):
        if owner.__module__.startswith("meshreel"):
            [node] = ast.parse(inspect.cleandoc("\n" + inspect.getsource(owner))).body
            assert isinstance(node, ast.ClassDef)
            yield from _members(name, node)


def _parameters(name: str, signature: inspect.Signature) -> Iterator[str]:
    for parameter in signature.parameters.values():
        optional = "=" if parameter.default is not parameter.empty else ""
        yield f"python {name}({parameter.name}{optional})"


def _syntax(name: str, node: ast.ClassDef | ast.FunctionDef) -> Iterator[str]:
    """Yield a class or a function of a module that cannot be imported everywhere."""
    yield f"python {name}"
    if isinstance(node, ast.FunctionDef):
        yield from _arguments(name, node)
        return
    yield from _members(name, node)
    for member in node.body:
        if isinstance(member, ast.FunctionDef) and member.name == "__init__":
            yield from _arguments(name, member)


def _members(name: str, node: ast.ClassDef) -> Iterator[str]:
    """Yield public methods with their parameters, properties and attributes of a class."""
    for member in ast.walk(node):
        for attribute in _assigned(member, is_field=member in node.body):
            if not attribute.startswith("_"):
                yield f"python {name}.{attribute}"
    for member in node.body:
        if isinstance(member, ast.FunctionDef) and _is_public(member.name):
            yield f"python {name}.{member.name}"
            if not any("property" in ast.unparse(one) for one in member.decorator_list):
                yield from _arguments(f"{name}.{member.name}", member)


def _assigned(node: ast.AST, *, is_field: bool) -> Iterator[str]:
    """Yield the attributes that a statement assigns: fields of the class, or those of self."""
    targets = node.targets if isinstance(node, ast.Assign) else []
    targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
    for target in targets:
        for elt in target.elts if isinstance(target, ast.Tuple) else [target]:
            if isinstance(elt, ast.Attribute) and ast.unparse(elt.value) == "self":
                yield elt.attr
            elif is_field and isinstance(elt, ast.Name):
                yield elt.id


def _is_public(name: str) -> bool:
    return not name.startswith("_") or name in ("__len__", "__getitem__", "__iter__", "__enter__")


def _arguments(name: str, node: ast.FunctionDef) -> Iterator[str]:
    given = [*node.args.posonlyargs, *node.args.args]
    n_required = len(given) - len(node.args.defaults)
    for place, one in enumerate(given):
        if one.arg not in ("self", "cls") and not name.split(".")[-1].startswith("__"):
            yield f"python {name}({one.arg}{'=' if place >= n_required else ''})"
    for kwonlyarg, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True):
        yield f"python {name}({kwonlyarg.arg}{'=' if default is not None else ''})"


def _commands() -> Iterator[str]:
    """Yield all commands with their arguments and options."""
    for name in COMMANDS:
        yield f"command {name}"
        for parameter in command_named(name).params:
            if isinstance(parameter, click.Argument):
                yield f"command {name} {parameter.human_readable_name}"
            else:
                flags = (*parameter.opts, *parameter.secondary_opts)
                yield from (f"command {name} {flag}" for flag in flags)


def _npm() -> Iterator[str]:
    for module, path in NPM_MODULES.items():
        yield from (f"npm {module} {name}" for name in _exports(ROOT / "npm" / "src" / path))


def _exports(path: Path) -> Iterator[str]:
    """Yield the names that a TypeScript module exports."""
    text = path.read_text(encoding="utf-8")
    yield from EXPORTED.findall(text)
    for names in EXPORT_LIST.findall(text):
        yield from (name.split()[-1] for name in names.split(",") if name.strip())
    for other in EXPORT_ALL.findall(text):
        yield from _exports((path.parent / other).with_suffix(".ts"))


def main() -> None:
    """Print the interface, or store it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="update interface.txt")
    parser.add_argument("--release", action="store_true", help="update both files")
    options = parser.parse_args()
    text = "\n".join([*described(), ""])
    if options.write or options.release:
        STORED.write_text(text, encoding="utf-8")
    if options.release:
        RELEASED.write_text(f"version {meshreel.__version__}\n{text}", encoding="utf-8")
    if not (options.write or options.release):
        print(text, end="")


if __name__ == "__main__":
    main()
