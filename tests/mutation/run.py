"""Measures which faults the tests notice: puts mutants into clones, and runs the tests on each.

`PYTHONPATH=tests:core python -m mutation.run --work DIR` clones the repository into DIR, records
once which test of `pytest` alone executes which line (this needs `pip install coverage`), draws
mutants evenly over the packages and the core, and prints how many make the tests of their own
package fail. Results are in DIR/results.jsonl, where a second run continues. `--again` brings the
clones up to date and runs what survived against all cases of the tests of its package. Nothing
outside of DIR is written. The core is compiled with -O1 for this machine, Linux or macOS.
"""

import argparse
import json
import os
import queue
import re
import resource
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path

from compile import FLAGS  # of core/

from mutation.mutants import CORE, MODULES, Mutant, sample
from mutation.plugin import LINES, RECORD, SECONDS, SELECT

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ("unit", "cli", "conformance", "corruption", "properties")
"""Folders of tests that are recorded; the others need browsers, Blender or real sequences."""

OWN = {
    CORE: (
        *("unit/kernel", "unit/connectivity", "unit/entropy", "unit/geometry"),
        "conformance/test_c_reader",
    ),
    MODULES: ("unit/test_",),
    "cli": ("unit/cli", "cli"),
}
"""Beginnings of the tests of a package, below tests/; else unit/ and its name."""

OWN_S, OTHERS_S = 25.0, 12.0
"""Tests run fastest first, up to this time in total: those of the package, and others."""

AGAIN_S = 400.0
SLOWER = 8
"""A run fails if it takes longer than this multiple of the recorded time, plus a minute."""

MOST_MEMORY_BYTES = 12 << 30
COMPILE = ("cc", *FLAGS, "-O1", "-fPIC", "-c")
PYTEST = ("-n0", "-q", "-p", "no:cacheprovider", "-p", "mutation.plugin")
COMMIT = "commit"
"""File with the commit that the tests were recorded at."""

BUILT = ("npm/dist", "npm/wasm")
"""What a build adds to a checkout, and some tests read."""

SURVIVED, BY_OWN, BY_OTHERS, NONE = "survived", "own", "others", "none"
"""What becomes of a mutant; of none nothing is known, for it is no program, or the same one."""

Result = dict[str, str | int]


class Bench:
    """A clone of the repository in which mutants are tried.

    Parameters
    ----------
    work : Path
        The folder with the record of the tests.
    number : int
        Of the clone.
    """

    def __init__(self, work: Path, number: int) -> None:
        self.work, self.number = work, number
        self.clone, self.objects = work / f"clone-{number}", work / f"objects-{number}"
        self.seconds: dict[str, float] = {}

    def prepare(self, *, is_new: bool) -> None:
        """Clone and compile, or restore what an interrupted run has left.

        Parameters
        ----------
        is_new : bool
            Whether to bring the clone up to date.
        """
        if not self.clone.exists():
            _git(ROOT, "clone", "-q", str(ROOT), str(self.clone))
            for built in filter(lambda one: (ROOT / one).exists(), BUILT):
                shutil.copytree(ROOT / built, self.clone / built, dirs_exist_ok=True)
        _git(self.clone, "checkout", "-q", "--", ".")
        if is_new:
            _git(self.clone, "pull", "-q")
        # Times of files are too coarse to tell mutants apart.
        mode = ("--invalidation-mode", "checked-hash")
        compiling = [sys.executable, "-m", "compileall", "-q", *mode, str(self.clone / "src")]
        subprocess.run(compiling, check=True)
        self.objects.mkdir(exist_ok=True)
        if not all(self._compile(file) for file in self._c_files()) or not self._link():
            raise RuntimeError("the core does not compile")

    def record(self) -> None:
        """Record the tests and the commit, unless that is done."""
        if not (self.work / SECONDS).exists():
            (self.work / COMMIT).write_text(_git(self.clone, "rev-parse", "HEAD"))
            folders = [f"tests/{one}" for one in RECORDED]
            self._pytest(["-o", f"testpaths={' '.join(folders)}"], {RECORD: str(self.work)}, None)

    def judge(self, mutant: Mutant, *, is_again: bool) -> dict[str, str]:
        """What becomes of a mutant, and the first test that fails."""
        self.seconds = json.loads((self.work / SECONDS).read_text())
        try:
            if hindrance := self._apply(mutant):
                return {"fate": NONE, "by": hindrance}
            if is_again:
                by = self._failure_in_files(self._own_files(mutant))
                return {"fate": BY_OWN if by else SURVIVED, "by": by}
            own, others = self._tests_of(mutant)
            if by := self._failure_in_tests(_fastest(own, self.seconds, OWN_S)):
                return {"fate": BY_OWN, "by": by}
            by = self._failure_in_tests(_fastest(others, self.seconds, OTHERS_S))
            return {"fate": BY_OTHERS if by else SURVIVED, "by": by}
        finally:
            self._restore(mutant)

    def _apply(self, mutant: Mutant) -> str:
        """Put the fault in; what hinders that, or an empty text."""
        file = self.clone / mutant.file
        try:
            text = mutant.applied(file.read_text("utf-8"))
        except (ValueError, FileNotFoundError) as error:
            return str(error)
        file.write_text(text, "utf-8")
        if mutant.package != CORE:
            return ""
        files = self._compiled_with(file)
        before = [self._object(one).read_bytes() for one in files]
        if not all(self._compile(one) for one in files):
            return "does not compile"
        if before == [self._object(one).read_bytes() for one in files]:
            return "compiles to the same code"
        return "" if self._link() else "does not link"

    def _restore(self, mutant: Mutant) -> None:
        file = self.clone / mutant.file
        if not file.exists():
            return
        _git(self.clone, "checkout", "-q", "--", mutant.file)
        if mutant.package == CORE:
            for one in self._compiled_with(file):
                self._compile(one)
            self._link()

    def _c_files(self) -> list[Path]:
        folders = (self.clone / "core", self.clone / "core/reader")
        return sorted(file for folder in folders for file in folder.glob("*.c"))

    def _compiled_with(self, file: Path) -> list[Path]:
        return [file] if file.suffix == ".c" else self._c_files()

    def _object(self, file: Path) -> Path:
        return self.objects / f"{file.parent.name}-{file.stem}.o"

    def _compile(self, file: Path) -> bool:
        command = [*COMPILE, str(file), "-o", str(self._object(file))]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def _link(self) -> bool:
        name = "libreel.dylib" if sys.platform == "darwin" else "libreel.so"
        library = self.clone / "src/meshreel/kernel" / name
        library.unlink(missing_ok=True)  # a process may have it mapped
        objects = [str(self._object(file)) for file in self._c_files()]
        command = ["cc", "-shared", *objects, "-o", str(library)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def _tests_of(self, mutant: Mutant) -> tuple[list[str], list[str]]:
        """Tests that execute the lines of a mutant: those of its package, and all others."""
        found = list(self.seconds) if mutant.package == CORE else self._executing(mutant)
        beginnings = _own_beginnings(mutant.package)
        own = [name for name in found if name.startswith(beginnings)]
        if not own:  # lines are executed in other processes, or not at all
            own = [name for name in self.seconds if name.startswith(beginnings)]
        return own, sorted(set(found) - set(own))

    def _executing(self, mutant: Mutant) -> list[str]:
        from coverage import CoverageData  # type: ignore[import-not-found, unused-ignore]

        data = CoverageData(str(self.work / LINES))
        data.read()
        by_line = data.contexts_by_lineno(mutant.file)
        lines = range(mutant.line, mutant.line + mutant.old.count("\n") + 1)
        found = {name for line in lines for name in by_line.get(line, ())} - {""}
        if not found:  # executed when the module is imported
            found = {name for names in by_line.values() for name in names} - {""}
        return sorted(found)

    def _own_files(self, mutant: Mutant) -> list[str]:
        """Files of tests of the package that executed the mutant, or have changed since."""
        executing = {name.partition("::")[0] for name in self._tests_of(mutant)[0]}
        commit = (self.work / COMMIT).read_text().strip()
        changed = set(_git(self.clone, "diff", "--name-only", commit, "--", "tests").split())
        beginnings = _own_beginnings(mutant.package)
        tests = (file.relative_to(self.clone) for file in self.clone.glob("tests/**/test_*.py"))
        own = [file.as_posix() for file in tests if file.as_posix().startswith(beginnings)]
        return [file for file in own if file in executing | changed]

    def _failure_in_tests(self, names: Sequence[str]) -> str:
        """The first of some tests that fails; empty if none does."""
        if not names:
            return ""
        listed = self.work / f"listed-{self.number}.json"
        listed.write_text(json.dumps(names))
        files = sorted({name.partition("::")[0] for name in names})
        limit_s = 60 + SLOWER * sum(self.seconds[name] for name in names)
        return self._pytest(
            ["-x", "-o", f"testpaths={' '.join(files)}"], {SELECT: str(listed)}, limit_s
        )

    def _failure_in_files(self, files: Sequence[str]) -> str:
        """The first test with any case that fails in some files; empty if none does."""
        if not files:
            return ""
        return self._pytest(["-x", "-m", "not slow and not real", *files], {}, AGAIN_S)

    def _pytest(
        self, arguments: Sequence[str], variables: dict[str, str], limit_s: float | None
    ) -> str:
        """Run pytest in the clone; what failed, or an empty text."""
        temporary = self.work / f"tmp-{self.number}"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        folders = [self.clone / "src", self.clone / "tests", Path(__file__).parents[1]]
        paths = [*map(str, folders), *filter(None, [os.environ.get("PYTHONPATH")])]
        process = subprocess.Popen(
            [sys.executable, "-m", "pytest", *PYTEST, *arguments],
            cwd=self.clone,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(paths),
                "TMPDIR": str(temporary),
                **variables,
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
            preexec_fn=_limit_memory,
        )
        try:
            output, _ = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            return "time limit"
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # what tests have started, too
            process.wait()
        if process.returncode in (0, 5):  # 5: there is no test
            return ""
        failed = re.search(r"^(?:FAILED|ERROR) (.*)$", output, re.MULTILINE)
        return failed[1][:200] if failed else f"exit status {process.returncode}"


def _own_beginnings(package: str) -> tuple[str, ...]:
    return tuple(f"tests/{one}" for one in OWN.get(package, (f"unit/{package}/",)))


def _fastest(names: Iterable[str], seconds: dict[str, float], limit_s: float) -> list[str]:
    """As many tests as take no longer than a limit together, the fastest first."""
    chosen, whole_s = [], 0.0
    for name in sorted(filter(seconds.__contains__, names), key=seconds.__getitem__):
        whole_s += seconds[name]
        if whole_s > limit_s:
            break
        chosen.append(name)
    return chosen


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))


def _mutant_of(result: Result) -> Mutant:
    return Mutant(**{field.name: result[field.name] for field in fields(Mutant)})  # type: ignore[arg-type]


def print_table(results: Iterable[Result]) -> None:
    """Print how many mutants each package had, and what became of them."""
    by_package: dict[str, Counter[str | int]] = {}
    for one in results:
        for name in (str(one["package"]), "total"):
            by_package.setdefault(name, Counter())[one["fate"]] += 1
    print(f"{'package':14}{'mutants':>8}{BY_OWN:>9}{BY_OTHERS:>9}{SURVIVED:>9}")
    for name in sorted(by_package, key=lambda one: (one == "total", one)):
        fates = [by_package[name][fate] for fate in (BY_OWN, BY_OTHERS, SURVIVED)]
        print(f"{name:14}{sum(fates):8}" + "".join(f"{one:9}" for one in fates))


def main() -> None:
    """Try the mutants that have no result yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, required=True, help="folder of clones and results")
    parser.add_argument("--count", type=int, default=300, help="about how many mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time")
    parser.add_argument("--again", action="store_true", help="run what survived once more")
    given = parser.parse_args()
    work = given.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    benches: queue.Queue[Bench] = queue.Queue()
    for number in range(given.jobs):
        benches.put(Bench(work, number))
        benches.queue[-1].prepare(is_new=given.again)
    benches.queue[0].record()
    stored = work / "results.jsonl"
    lines = stored.read_text().splitlines() if stored.exists() else []
    results: list[Result] = [json.loads(line) for line in lines]

    def judge(mutant: Mutant) -> Result:
        bench = benches.get()
        try:
            return {**asdict(mutant), **bench.judge(mutant, is_again=given.again)}
        finally:
            benches.put(bench)

    if given.again:
        mutants = [_mutant_of(one) for one in results if one["fate"] in (SURVIVED, BY_OTHERS)]
    else:
        known = [_mutant_of(one) for one in results]
        drawn = sample(work / "clone-0", given.count, given.seed)
        mutants = [one for one in drawn if one not in known]
    with ThreadPoolExecutor(given.jobs) as pool:
        for mutant, result in zip(mutants, pool.map(judge, mutants), strict=True):
            results = [one for one in results if _mutant_of(one) != mutant] + [result]
            stored.write_text("".join(json.dumps(one) + "\n" for one in results))
            print(result["fate"], f"{mutant.file}:{mutant.line}", result["by"], flush=True)
    print_table(results)


if __name__ == "__main__":
    main()
