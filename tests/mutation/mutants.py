"""Mutants: sources with one fault each, sampled from all packages and the core."""

import random
from dataclasses import dataclass
from pathlib import Path

from mutation.edits import Edit, c_edits, python_edits

CORE, MODULES = "core", "modules"
"""Names for the C core, and for the modules outside of packages."""

OWN_TESTS = {
    CORE: ("unit/kernel/", "unit/codec/connectivity/", "unit/codec/entropy/", "conformance/"),
    MODULES: ("unit/test_",),
    "app": ("unit/app/", "cli/"),
}
"""Prefixes of the tests of a package, below tests/; by default unit/ and its name."""

NOT_MUTATED = ("flag.py", "__main__.py")
MIN_MUTANTS = 6
"""Smallest number of mutants of a package."""


@dataclass(frozen=True)
class Mutant:
    """A fault: lines of a file, and their replacement.

    Attributes
    ----------
    package : str
        Its name, or `CORE` or `MODULES`.
    file : str
        Relative to the repository.
    line : int
        Number of the first replaced line, from 1.
    kind : str
        As in `Edit`.
    old, new : str
    """

    package: str
    file: str
    line: int
    kind: str
    old: str
    new: str

    def applied(self, text: str) -> str:
        """Return the text of the file with the fault; finds lines that have moved.

        Raises
        ------
        ValueError
            If the file does not contain the lines.
        """
        lines, old = text.split("\n"), self.old.split("\n")
        results = [at for at in range(len(lines)) if lines[at : at + len(old)] == old]
        if not results:
            raise ValueError(f"{self.file} no longer contains {self.old.strip()!r}")
        at = min(results, key=lambda item: abs(item - self.line + 1))
        return "\n".join([*lines[:at], *self.new.split("\n"), *lines[at + len(old) :]])


def mutant_of(edit: Edit, package: str, file: str, source: bytes) -> Mutant:
    first = source.rfind(b"\n", 0, edit.start) + 1
    last = source.find(b"\n", edit.end)
    last = len(source) if last < 0 else last
    new = source[first : edit.start] + edit.new.encode() + source[edit.end : last]
    line = source.count(b"\n", 0, first) + 1
    return Mutant(package, file, line, edit.kind, source[first:last].decode(), new.decode())


def own_prefixes(package: str) -> tuple[str, ...]:
    """Return the prefixes of the paths of a package's tests."""
    return tuple(f"tests/{path}" for path in OWN_TESTS.get(package, (f"unit/{package}/",)))


def sources(root: Path) -> dict[str, list[Path]]:
    """Return the source files of the core, of each package, and of other modules."""
    folders = (root / "core", root / "core/reader")
    results = {CORE: sorted(file for folder in folders for file in folder.glob("*.[ch]"))}
    top = root / "src/meshreel"
    for file in sorted(top.rglob("*.py")):
        parts = file.relative_to(top).parts
        results.setdefault(parts[0] if len(parts) > 1 else MODULES, []).append(file)
    return {
        name: [file for file in files if file.name not in NOT_MUTATED]
        for name, files in results.items()
    }


def sample(root: Path, n_mutants: int, seed: int) -> list[Mutant]:
    """Return about `n_mutants` mutants, in a random order determined by the seed.

    The share of a package is proportional to the square root of its size, at least `MIN_MUTANTS`,
    with equal numbers of each kind.
    """
    files = sources(root)
    weights = {
        name: sum(file.stat().st_size for file in found) ** 0.5 for name, found in files.items()
    }
    chosen: list[Mutant] = []
    for package, weight in weights.items():
        n_here = max(MIN_MUTANTS, round(n_mutants * weight / sum(weights.values())))
        chosen += _sample_of(package, files[package], root, n_here, f"{seed} {package}")
    random.Random(seed).shuffle(chosen)
    return chosen


def _sample_of(
    package: str, files: list[Path], root: Path, n_mutants: int, seed: str
) -> list[Mutant]:
    by_kind: dict[str, list[tuple[Path, Edit]]] = {}
    for file in files:
        edits_of = python_edits if file.suffix == ".py" else c_edits
        for edit in edits_of(file.read_bytes()):
            by_kind.setdefault(edit.kind, []).append((file, edit))
    rng = random.Random(seed)
    for result in by_kind.values():
        rng.shuffle(result)
    drawn: list[tuple[Path, Edit]] = []
    while len(drawn) < n_mutants and any(by_kind.values()):
        drawn += [found.pop() for found in by_kind.values() if found]
    return [
        mutant_of(edit, package, file.relative_to(root).as_posix(), file.read_bytes())
        for file, edit in drawn[:n_mutants]
    ]
