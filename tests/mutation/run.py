"""Mutation testing: insert faults into clones of the repository, and run the tests on each.

`PYTHONPATH=tests:core python -m mutation.run --work DIR` clones the repository into DIR and records
once which quick tests execute which line (this needs `pip install coverage`). It samples mutants
from all packages and the core, and prints how many the tests of the package detect. Results
are in DIR/results.jsonl; a second run continues them. `--again` updates the clones and tests
survivors with all tests of their package, slow ones too, which `.ci/run` runs before a merge.
Nothing outside of DIR is written. The core is compiled with -O1 for this machine, Linux or macOS.
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

from mutation.mutants import CORE, Mutant, own_prefixes, sample
from mutation.plugin import LINES, RECORD, SECONDS, SELECT

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ("unit", "cli", "conformance", "corruption", "properties")
"""Folders of tests to record; the others need browsers, Blender or real sequences."""

OWN_S, OTHERS_S = 25.0, 12.0
"""Time limits of the tests of the package and of others; the fastest run first."""

AGAIN_S = 3600.0
"""Time limit of all tests of a package, many times what they take, or else it detects mutants."""

SLOWER = 8
"""A run fails if it takes longer than this multiple of the recorded time, plus a minute."""

MAX_MEMORY_BYTES = 12 << 30
WITH_SANITIZERS = ("test_fuzzer_finds_no_crash", "test_decoders_on_threads_do_not_race")
"""Tests that need more than this, with every mutant: sanitizers reserve terabytes of addresses."""

COMPILE = ("cc", *FLAGS, "-O1", "-fPIC", "-c")
PYTEST = ("-n0", "-q", "-p", "no:cacheprovider", "-p", "mutation.plugin")
COMMIT = "commit"
"""File with the commit at which the tests were recorded."""

BUILT = ("npm/dist", "npm/wasm")
"""Build outputs that some tests read."""

SURVIVED, BY_OWN, BY_OTHERS, NONE = "survived", "own", "others", "none"
"""Outcomes of a mutant: it survives, tests of its package detect it, or only other tests do; "none"
if it is not tested, because it does not compile, or compiles to the same code."""

Result = dict[str, str | int]


class Bench:
    """A clone of the repository in which mutants are tested.

    Parameters
    ----------
    work : Path
        The folder with the record of the tests.
    number : int
        Number of the clone.
    """

    def __init__(self, work: Path, number: int) -> None:
        self.work, self.number = work, number
        self.clone, self.objects = work / f"clone-{number}", work / f"objects-{number}"
        self.seconds: dict[str, float] = {}

    def prepare(self, *, is_new: bool) -> None:
        """Clone and compile, or restore the clone of an interrupted run.

        Parameters
        ----------
        is_new : bool
            Whether to bring the clone up to date.
        """
        if not self.clone.exists():
            _git(ROOT, "clone", "-q", str(ROOT), str(self.clone))
            for built in filter(lambda item: (ROOT / item).exists(), BUILT):
                shutil.copytree(ROOT / built, self.clone / built, dirs_exist_ok=True)
        if is_new:
            _git(self.clone, "fetch", "-q", "origin", "HEAD")
        _git(self.clone, "reset", "-q", "--hard", "FETCH_HEAD" if is_new else "HEAD")
        # Modification times are too coarse to distinguish mutants.
        mode = ("--invalidation-mode", "checked-hash")
        command = [sys.executable, "-m", "compileall", "-q", *mode, str(self.clone / "src")]
        subprocess.run(command, check=True)
        self.objects.mkdir(exist_ok=True)
        if not all(self._compile(file) for file in self._c_files()) or not self._link():
            raise RuntimeError("the core does not compile")

    def record(self) -> None:
        """Record the tests and the commit, unless they are recorded."""
        if not (self.work / SECONDS).exists():
            (self.work / COMMIT).write_text(_git(self.clone, "rev-parse", "HEAD"))
            folders = [f"tests/{folder}" for folder in RECORDED]
            self._pytest(["-o", f"testpaths={' '.join(folders)}"], {RECORD: str(self.work)}, None)

    def judge(self, mutant: Mutant, *, is_again: bool) -> dict[str, str]:
        """Return the outcome of a mutant, and the first test that fails or why none ran."""
        self.seconds = json.loads((self.work / SECONDS).read_text())
        try:
            if reason := self._apply(mutant):
                return {"outcome": NONE, "by": reason}
            if is_again:
                by = self._failure_in_files(self._own_files(mutant))
                return {"outcome": BY_OWN if by else SURVIVED, "by": by}
            own, others = self._tests_of(mutant)
            if by := self._failure_in_tests(_fastest(own, self.seconds, OWN_S)):
                return {"outcome": BY_OWN, "by": by}
            by = self._failure_in_tests(_fastest(others, self.seconds, OTHERS_S))
            return {"outcome": BY_OTHERS if by else SURVIVED, "by": by}
        finally:
            self._restore(mutant)

    def _apply(self, mutant: Mutant) -> str:
        """Apply the fault; return why that failed, or an empty text."""
        file = self.clone / mutant.file
        try:
            text = mutant.applied(file.read_text("utf-8"))
        except (ValueError, FileNotFoundError) as error:
            return str(error)
        file.write_text(text, "utf-8")
        if mutant.package != CORE:
            return ""
        files = self._compiled_with(file)
        before = [self._object(source).read_bytes() for source in files]
        if not all(self._compile(source) for source in files):
            return "does not compile"
        if before == [self._object(source).read_bytes() for source in files]:
            return "compiles to the same code"
        return "" if self._link() else "does not link"

    def _restore(self, mutant: Mutant) -> None:
        file = self.clone / mutant.file
        if not file.exists():
            return
        _git(self.clone, "checkout", "-q", "--", mutant.file)
        if mutant.package == CORE:
            for source in self._compiled_with(file):
                self._compile(source)
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
        library.unlink(missing_ok=True)  # another process may have mapped it
        objects = [str(self._object(file)) for file in self._c_files()]
        command = ["cc", "-shared", *objects, "-o", str(library)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def _tests_of(self, mutant: Mutant) -> tuple[list[str], list[str]]:
        """Return the tests that execute the lines of a mutant: those of its package, and others."""
        actual = list(self.seconds) if mutant.package == CORE else self._executing(mutant)
        prefixes = own_prefixes(mutant.package)
        own = [name for name in actual if name.startswith(prefixes)]
        if not own:  # lines are executed in other processes, or not at all
            own = [name for name in self.seconds if name.startswith(prefixes)]
        return own, sorted(set(actual) - set(own))

    def _executing(self, mutant: Mutant) -> list[str]:
        from coverage import CoverageData  # type: ignore[import-not-found, unused-ignore]

        data = CoverageData(str(self.work / LINES))
        data.read()
        by_line = data.contexts_by_lineno(mutant.file)
        lines = range(mutant.line, mutant.line + mutant.old.count("\n") + 1)
        actual = {name for line in lines for name in by_line.get(line, ())} - {""}
        if not actual:  # executed when the module is imported
            actual = {name for names in by_line.values() for name in names} - {""}
        return sorted(actual)

    def _own_files(self, mutant: Mutant) -> list[str]:
        """Return test files of the package that executed the mutant or have changed since."""
        executing = {name.partition("::")[0] for name in self._tests_of(mutant)[0]}
        commit = (self.work / COMMIT).read_text().strip()
        changed = set(_git(self.clone, "diff", "--name-only", commit, "--", "tests").split())
        prefixes = own_prefixes(mutant.package)
        tests = (file.relative_to(self.clone) for file in self.clone.glob("tests/**/test_*.py"))
        own = [file.as_posix() for file in tests if file.as_posix().startswith(prefixes)]
        return [file for file in own if file in executing | changed]

    def _failure_in_tests(self, names: Sequence[str]) -> str:
        """Return the first of these tests that fails, or an empty text."""
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
        """Return the first failing test of these files, slow ones included, or an empty text."""
        if not files:
            return ""
        chosen = ["-m", "not real", "-k", f"not ({' or '.join(WITH_SANITIZERS)})"]
        return self._pytest(["-x", *chosen, *files], {}, AGAIN_S)

    def _pytest(
        self, arguments: Sequence[str], variables: dict[str, str], limit_s: float | None
    ) -> str:
        """Run pytest in the clone; return the first failure, or an empty text."""
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
                os.killpg(process.pid, signal.SIGKILL)  # includes processes started by tests
            process.wait()
        if process.returncode in (0, 5):  # 5: no tests
            return ""
        failed = re.search(r"^(?:FAILED|ERROR) (.*)$", output, re.MULTILINE)
        return failed[1][:200] if failed else f"exit status {process.returncode}"


def _fastest(names: Iterable[str], seconds: dict[str, float], limit_s: float) -> list[str]:
    """Return the fastest tests that fit a time limit."""
    selected, total_s = [], 0.0
    for name in sorted(filter(seconds.__contains__, names), key=seconds.__getitem__):
        total_s += seconds[name]
        if total_s > limit_s:
            break
        selected.append(name)
    return selected


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))


def _mutant_of(result: Result) -> Mutant:
    return Mutant(**{field.name: result[field.name] for field in fields(Mutant)})  # type: ignore[arg-type]


def print_table(results: Iterable[Result]) -> None:
    """Print how many mutants each package has, and how many had each outcome."""
    by_package: dict[str, Counter[str | int]] = {}
    for result in results:
        for name in (str(result["package"]), "total"):
            by_package.setdefault(name, Counter())[result["outcome"]] += 1
    print(f"{'package':14}{'mutants':>8}{BY_OWN:>9}{BY_OTHERS:>9}{SURVIVED:>9}")
    for name in sorted(by_package, key=lambda item: (item == "total", item)):
        counts = [by_package[name][outcome] for outcome in (BY_OWN, BY_OTHERS, SURVIVED)]
        print(f"{name:14}{sum(counts):8}" + "".join(f"{count:9}" for count in counts))


def main() -> None:
    """Test mutants without results, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, required=True, help="folder of clones and results")
    parser.add_argument("--count", type=int, default=300, help="approximate number of mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="mutants tested in parallel")
    parser.add_argument("--again", action="store_true", help="test survivors again")
    options = parser.parse_args()
    work = options.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    benches: queue.Queue[Bench] = queue.Queue()
    for number in range(options.jobs):
        benches.put(Bench(work, number))
        benches.queue[-1].prepare(is_new=options.again)
    benches.queue[0].record()
    stored = work / "results.jsonl"
    lines = stored.read_text().splitlines() if stored.exists() else []
    results: list[Result] = [json.loads(line) for line in lines]

    def judge(mutant: Mutant) -> Result:
        bench = benches.get()
        try:
            return {**asdict(mutant), **bench.judge(mutant, is_again=options.again)}
        finally:
            benches.put(bench)

    if options.again:
        again = (SURVIVED, BY_OTHERS)
        mutants = [_mutant_of(result) for result in results if result["outcome"] in again]
    else:
        known = [_mutant_of(result) for result in results]
        drawn = sample(work / "clone-0", options.count, options.seed)
        mutants = [mutant for mutant in drawn if mutant not in known]
    with ThreadPoolExecutor(options.jobs) as pool:
        for mutant, result in zip(mutants, pool.map(judge, mutants), strict=True):
            results = [other for other in results if _mutant_of(other) != mutant] + [result]
            stored.write_text("".join(json.dumps(other) + "\n" for other in results))
            print(result["outcome"], f"{mutant.file}:{mutant.line}", result["by"], flush=True)
    print_table(results)


if __name__ == "__main__":
    main()
