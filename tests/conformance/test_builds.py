"""Other builds of the core decode the same bits; streams and their makers run nearly all of it."""

import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from conformance.check import wanted
from conformance.make import FOLDER, STREAMS
from meshreel.bitstream.reader import read_stream
from meshreel.codec.open_stream import OpenStream
from meshreel.kernel import library as kernel_library
from meshreel.surface import Domain

ROOT = Path(__file__).parents[2]
LEAST_SHARE = 0.95
TIME_LIMIT_S = 600

pytestmark = pytest.mark.slow


@cache
def compile_core():
    """The module core/compile.py."""
    spec = importlib.util.spec_from_file_location("core_compile", ROOT / "core" / "compile.py")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def need_programs(*names):
    for name in names:
        if shutil.which(name) is None:
            pytest.skip(f"{name} is not here")


def compiled(target, compiler, flags):
    """What a compiler makes of the core, with its usual flags and these behind them."""
    files = [str(file) for file in compile_core().sources() if file.suffix == ".c"]
    usual = compile_core().FLAGS
    command = [compiler, *usual, *files, *flags, "-o", str(target)]
    subprocess.run(command, check=True, cwd=target.parent, timeout=TIME_LIMIT_S)
    return target


def built(folder, compiler, *flags):
    """A library of the core, compiled with these flags; a warning is an error."""
    need_programs(compiler)
    shared = ["-shared", *compile_core().WARNINGS, *flags]
    return compiled(folder / "core.so", compiler, shared)


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


def number_of_hostile_runs(library, compiler, folder):
    """What stands for all that `core/fuzz` finds: encoded, decoded, also from damaged bytes."""
    core, program = ROOT / "core", folder / "fuzz"
    files = sorted(str(file) for file in (core / "fuzz").glob("*.c"))
    flags = ["-std=gnu11", "-O1", "-DREEL_FUZZ_LOOP", f"-I{core}"]
    linked = [str(library), f"-Wl,-rpath,{library.parent}"]
    command = [compiler, *flags, *files, *linked, "-o", str(program)]
    subprocess.run(command, check=True, timeout=TIME_LIMIT_S)
    given = [str(program), "0", "7", "0", "300"]
    told = subprocess.run(given, check=True, capture_output=True, text=True, timeout=TIME_LIMIT_S)
    return told.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def usual_number(tmp_path_factory):
    """That number of the library that all other tests load."""
    need_programs("gcc")
    library = Path(kernel_library.library()._name)
    return number_of_hostile_runs(library, "gcc", tmp_path_factory.mktemp("usual"))


# What is installed is compiled with -O3, by the compiler of the machine, and with all warnings in
# `.ci/run`: gcc finds some of what it warns of as it optimises, clang all of it before. What has
# all its lines counted, below, is compiled by gcc with -O0; narrow vectors by clang are what
# tests/browser runs over all streams, as WebAssembly.
@pytest.mark.parametrize(
    ("compiler", "flags"),
    [
        ("gcc", ["-O1", "-DREEL_NARROW"]),
        ("clang", ["-O0"]),
        ("clang", ["-O3"]),
    ],
)
def test_streams_and_damaged_bytes_hold_the_same_when_the_core_is_built_otherwise(
    compiler, flags, tmp_path, usual_number
):
    library = built(tmp_path, compiler, *flags)
    check(library)
    assert number_of_hostile_runs(library, compiler, tmp_path) == usual_number


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


def test_streams_and_their_makers_run_nearly_all_lines_of_the_core(tmp_path, usual_number):
    if shutil.which("gcov") is None:
        pytest.skip("gcov is not here")
    flags = ["--coverage", "-O0", "-fprofile-update=atomic"]
    library = built(tmp_path, "gcc", *flags)
    check(library, "--make")
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
    assert number_of_hostile_runs(library, "gcc", tmp_path) == usual_number


def hash_of(numbers, kind):
    """SHA-256 of numbers as little-endian ones of a kind."""
    return hashlib.sha256(np.asarray(numbers).astype(kind).tobytes()).hexdigest()


def differs(name, decoded):
    """Whether what `check.c` wrote of a stream is not what is said of it."""
    said, begin = wanted(name), 0

    def take(count, kind):
        nonlocal begin
        found = np.frombuffer(decoded, kind, count, begin)
        begin += found.nbytes
        return found

    if hash_of(take(3 * said["faces"], "<i4"), "<i8") != said["hash of internal faces"]:
        return True
    if said["method"] not in ("reel", "lossless", "grid"):
        return begin != len(decoded)

    def is_read(block, width):
        """Whether the integers of a track in a block are as they should be."""
        n_own = block["modes"] - block.get("reused", 0)
        counts = {
            "basis": block["modes"] * width * block["frames"],
            "coefficients": n_own * said["vertices"],
        }
        return all(
            hash_of(take(count, "<i4"), "<i8") == block[f"hash of {part}"]
            for part, count in counts.items()
        )

    opened = OpenStream(read_stream((FOLDER / f"{name}.reel").read_bytes()))
    floats = f"<f{said['vertex type']}"
    n_coded = 0 if said["method"] in ("lossless", "grid") else 3
    tracks = [(said["blocks"], 3, floats, said["hash of positions"], n_coded)]
    for header, of in zip(opened.tracks, said.get("tracks", []), strict=True):
        if header.domain is Domain.VERTEX:
            kind, wanted_hash = header.dtype.str, of["hash of values"]
            n_coded = 0 if header.is_exact else header.n_coded
            tracks.append((of["blocks"], header.n_columns, kind, wanted_hash, n_coded))
    found = [[] for _ in tracks]
    for number in range(len(said["blocks"])):
        for values, (blocks, width, kind, _, n_coded) in zip(found, tracks, strict=True):
            block = blocks[number]
            if n_coded and not is_read(block, n_coded):
                return True
            taken = take(width * block["frames"] * said["vertices"], kind)
            values.append(taken.reshape(block["frames"], -1, width)[:, opened.order])
    return begin != len(decoded) or any(
        hash_of(np.concatenate(values), kind) != wanted_hash
        for values, (_, _, kind, wanted_hash, _) in zip(found, tracks, strict=True)
    )


ARM = "aarch64-linux-gnu-gcc"
QEMU = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]


# What gcc makes at -O3 here is called from Python above.
@pytest.mark.parametrize(("level", "compiler", "runner"), [("-O0", "gcc", []), ("-O2", ARM, QEMU)])
def test_streams_hold_the_same_when_the_core_alone_decodes_them(compiler, runner, level, tmp_path):
    need_programs(compiler, *runner[:1])
    core, check_c = ROOT / "core", ROOT / "conformance" / "check.c"
    flags = [level, f"-I{core}", str(check_c), "-lm"]
    program = compiled(tmp_path / "check", compiler, flags)
    failed = []
    for name in STREAMS:
        given = [str(FOLDER / f"{name}.reel"), str(tmp_path / "out")]
        subprocess.run([*runner, str(program), *given], check=True, timeout=TIME_LIMIT_S)
        if differs(name, (tmp_path / "out").read_bytes()):
            failed.append(name)
    assert failed == []
