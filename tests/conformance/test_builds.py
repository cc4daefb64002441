"""Other builds of the core decode the same bits; streams and their makers run nearly all of it."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LEAST_SHARE = 0.95
TIME_LIMIT_S = 600

pytestmark = pytest.mark.slow


def built(monkeypatch, folder, compiler, *flags):
    """A library of the core, compiled with these flags."""
    if shutil.which(compiler.split()[0]) is None:
        pytest.skip(f"{compiler} is not here")
    spec = importlib.util.spec_from_file_location("core_compile", ROOT / "core" / "compile.py")
    compile_core = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(compile_core)
    monkeypatch.setenv("CC", compiler)
    # Under its own name: gcov finds what it notes by the name of the output.
    target = folder / "core.so"
    files = [str(file) for file in compile_core.sources() if file.suffix == ".c"]
    command = [*compiler.split(), *compile_core.FLAGS, *flags, *files, "-o", str(target)]
    subprocess.run(command, check=True, cwd=folder, timeout=TIME_LIMIT_S)
    return target


def check(library, *options):
    """Run `conformance.check` with another library."""
    paths = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    environment = {**os.environ, "MESHREEL_CORE": str(library), "PYTHONPATH": paths}
    done = subprocess.run(
        [sys.executable, "-m", "conformance.check", *options],
        env=environment,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT_S,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("compiler", "flags"),
    [
        ("gcc", ["-O0"]),
        ("gcc", ["-O3"]),
        ("clang", ["-O0"]),
        ("clang", ["-O3"]),
        ("gcc", ["-O3", "-DREEL_NARROW"]),
        ("clang", ["-O3", "-DREEL_NARROW"]),
    ],
)
def test_streams_hold_the_same_when_the_core_is_built_otherwise(
    compiler, flags, tmp_path, monkeypatch
):
    check(built(monkeypatch, tmp_path, compiler, *flags))


def lines_of(folder):
    """Of each file of the core, its lines that are code, and whether each was run."""
    notes = [path.name for path in folder.glob("*.gcda")]
    assert notes, "nothing was noted"
    command = ["gcov", "--json-format", "--stdout", *notes]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    lines = {}
    for report in map(json.loads, filter(None, done.stdout.splitlines())):
        for file in report["files"]:
            of_file = lines.setdefault(Path(file["file"]).name, {})
            for line in file["lines"]:
                number = line["line_number"]
                of_file[number] = of_file.get(number, False) or line["count"] > 0
    return lines


def test_streams_and_their_makers_run_nearly_all_lines_of_the_core(tmp_path, monkeypatch):
    if shutil.which("gcov") is None:
        pytest.skip("gcov is not here")
    flags = ["--coverage", "-O0", "-fprofile-update=atomic"]
    check(built(monkeypatch, tmp_path, "gcc", *flags), "--make")
    lines = {
        name: found for name, found in lines_of(tmp_path).items() if (ROOT / "core" / name).exists()
    }
    missed = {
        name: [number for number, was_run in sorted(found.items()) if not was_run]
        for name, found in lines.items()
    }
    n_lines, n_missed = (sum(map(len, one.values())) for one in (lines, missed))
    print(f"{n_lines - n_missed} of {n_lines} lines were run; not: {missed}")
    assert n_missed <= (1 - LEAST_SHARE) * n_lines, missed
