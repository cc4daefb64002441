"""Other builds of the core decode the same bits; streams and their makers run nearly all of it."""

import hashlib
import importlib.util
import json
import os
import shutil
import struct
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from conformance.check import wanted
from conformance.make import FOLDER, STREAMS
from meshreel.kernel import library as kernel_library

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
        ("gcc", ["-O0", "-DREEL_NARROW"]),
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


def arrays_of(decoded):
    """The arrays that `check.c` wrote, each behind its size."""
    found, begin = [], 0
    while begin < len(decoded):
        (size,) = struct.unpack_from("<Q", decoded, begin)
        found.append(decoded[begin + 8 : begin + 8 + size])
        begin += 8 + size
    return found


def hash_of(data):
    return hashlib.sha256(data).hexdigest()


def hash_of_integers(data, kind):
    """SHA-256 of integers as little-endian int64, as they are described; None of no array."""
    return hash_of(np.frombuffer(data, kind).astype("<i8").tobytes()) if data else None


def decoded_hashes(said, decoded):
    """Hashes of what `check.c` wrote of a stream, in the shape of `wanted_hashes`."""
    arrays = iter(arrays_of(decoded))
    found = {
        "triangles": hash_of_integers(next(arrays), "<u4"),
        "polygons": hash_of_integers(next(arrays), "<u4"),
        "attributes": [
            (hash_of(next(arrays)), hash_of_integers(next(arrays), "<i4"))
            for _ in said["attributes"]
        ],
        "groups": [hash_of_integers(next(arrays), "<i4") for _ in said["groups"]],
    }
    return found | {"tracks": [hash_of(values) for values in arrays]}


def wanted_hashes(said):
    """Hashes of what a stream is said to hold."""
    positions = [said["hash of positions"]] if "hash of positions" in said else []
    return {
        "triangles": said["hash of faces"],
        "polygons": said["hash of polygons"],
        "attributes": [(one["hash of values"], one["hash of rows"]) for one in said["attributes"]],
        "groups": [one["hash of numbers"] for one in said["groups"]],
        "tracks": positions + [one["hash of values"] for one in said.get("tracks", [])],
    }


ARM = "aarch64-linux-gnu-gcc"
QEMU = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]


# What gcc makes at -O3 here is called from Python above.
@pytest.mark.parametrize(("level", "compiler", "runner"), [("-O0", "gcc", []), ("-O2", ARM, QEMU)])
def test_streams_hold_the_same_when_the_library_for_c_decodes_them(
    compiler, runner, level, tmp_path
):
    need_programs(compiler, *runner[:1])
    flags = [level, f"-I{ROOT / 'core' / 'include'}", str(ROOT / "conformance" / "check.c")]
    program = compiled(tmp_path / "check", compiler, flags)
    failed = []
    for name in STREAMS:
        given = [str(FOLDER / f"{name}.reel"), str(tmp_path / "out")]
        subprocess.run([*runner, str(program), *given], check=True, timeout=TIME_LIMIT_S)
        said = wanted(name)
        if decoded_hashes(said, (tmp_path / "out").read_bytes()) != wanted_hashes(said):
            failed.append(name)
    assert failed == []


def test_decoders_on_threads_do_not_race(tmp_path):
    need_programs("gcc", "g++")
    # Compiled in a third of the time that -O1 takes, and no access is optimized away.
    flags = [*compile_core().FLAGS[1:], "-O0", "-g", "-DREEL_INLINE=static inline"]
    flags += ["-fsanitize=thread", "-pthread", f"-I{ROOT / 'core' / 'include'}"]
    files = [str(file) for file in compile_core().sources() if file.suffix == ".c"]
    reader = tmp_path / "reader"  # some files of both folders have the same name
    reader.mkdir()
    for folder in (tmp_path, reader):
        own = [file for file in files if (Path(file).parent.name == "reader") == (folder == reader)]
        command = ["gcc", "-std=c11", *flags, "-c", *own]
        subprocess.run(command, check=True, cwd=folder, timeout=TIME_LIMIT_S)
    objects = map(str, tmp_path.rglob("*.o"))
    source = ROOT / "tests" / "samples" / "two_decoders.cpp"
    program = tmp_path / "program"
    command = ["g++", "-std=c++11", *flags, str(source), *objects, "-o", str(program)]
    subprocess.run(command, check=True, timeout=TIME_LIMIT_S)
    names = ("corners_in_rows", "key_blocks", "large_resolution", "predicted_tracks", "sphere")
    given = [str(FOLDER / f"{name}.reel") for name in names]
    done = subprocess.run(
        [str(program), *given], capture_output=True, text=True, timeout=TIME_LIMIT_S
    )
    assert (done.returncode, done.stderr) == (0, "")
