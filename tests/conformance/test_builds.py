"""Other builds of the core decode the same bits; the streams cover nearly all of its lines."""

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

from conformance.check import stored_description
from conformance.make import FOLDER, STREAMS
from meshreel.kernel import library as kernel_library
from samples.programs import output_of

ROOT = Path(__file__).parents[2]
MIN_COVERAGE = 0.95

REGISTRATION = ("closest.c", "closest_lanes.h", "decimate.c")
"""Kernels that no stream runs; tests/unit/kernel and core/fuzz do."""
TIME_LIMIT_S = 600

pytestmark = pytest.mark.slow


@cache
def compile_core():
    spec = importlib.util.spec_from_file_location("core_compile", ROOT / "core" / "compile.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def need_programs(*names):
    for name in names:
        if shutil.which(name) is None:
            pytest.skip(f"{name} is not installed")


def compiled(target, compiler, flags):
    """Compile the core with its default flags, followed by these."""
    files = [str(file) for file in compile_core().sources() if file.suffix == ".c"]
    command = [compiler, *compile_core().FLAGS, *files, *flags, "-o", str(target)]
    subprocess.run(command, check=True, cwd=target.parent, timeout=TIME_LIMIT_S)
    return target


def built(folder, compiler, *flags):
    """Compile a shared library of the core with these flags; warnings are errors."""
    need_programs(compiler)
    shared = ["-shared", *compile_core().WARNINGS, *flags]
    return compiled(folder / "core.so", compiler, shared)


def check(library, *options):
    """Run `conformance.check` with another library."""
    paths = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    environment = {"MESHREEL_CORE": str(library), "PYTHONPATH": paths}
    command = [sys.executable, "-m", "conformance.check", *options]
    output_of(*command, timeout_s=TIME_LIMIT_S, environment=environment, cwd=ROOT)


def fuzz_checksum(library, compiler, folder):
    """Return the checksum of everything that `core/fuzz` encodes and decodes, damaged or not."""
    core, program = ROOT / "core", folder / "fuzz"
    files = sorted(str(file) for file in (core / "fuzz").glob("*.c"))
    flags = ["-std=gnu11", "-O1", "-DREEL_FUZZ_LOOP", f"-I{core}"]
    flags += [f'-DREEL_FUZZ_STREAMS="{ROOT / "conformance"}"']
    linked = [str(library), f"-Wl,-rpath,{library.parent}"]
    command = [compiler, *flags, *files, *linked, "-o", str(program)]
    subprocess.run(command, check=True, timeout=TIME_LIMIT_S)
    return output_of(program, 0, 7, 0, 300, timeout_s=TIME_LIMIT_S).splitlines()[-1]


@pytest.fixture(scope="module")
def default_checksum(tmp_path_factory):
    """Return the checksum of the library that all other tests load."""
    need_programs("gcc")
    library = Path(kernel_library.library()._name)
    return fuzz_checksum(library, "gcc", tmp_path_factory.mktemp("default"))


# The installed library is compiled with -O3 by the default compiler, and with all warnings in
# `.ci/run`; some warnings of gcc depend on optimization. The coverage test below uses gcc with -O0
# and narrow vectors; tests/browser decodes all streams with these by clang, as WebAssembly.
@pytest.mark.parametrize("level", ["-O0", "-O3"])
def test_builds_by_clang_decode_the_same_bits(level, tmp_path, default_checksum):
    library = built(tmp_path, "clang", level)
    check(library)
    assert fuzz_checksum(library, "clang", tmp_path) == default_checksum


def lines_of(folder):
    """Return, for each file of the core, its lines of code and whether each was run."""
    counts = [path.name for path in folder.glob("*.gcda")]
    assert counts, "no coverage was recorded"
    printed = output_of("gcov", "--json-format", "--stdout", *counts, cwd=folder)
    lines = {}
    for report in map(json.loads, filter(None, printed.splitlines())):
        for file in report["files"]:
            of_file = lines.setdefault(Path(file["file"]).name, {})
            for line in file["lines"]:
                number = line["line_number"]
                of_file[number] = of_file.get(number, False) or line["count"] > 0
    return lines


def test_streams_cover_nearly_all_lines_of_the_core(tmp_path, default_checksum):
    if shutil.which("gcov") is None:
        pytest.skip("gcov is not installed")
    flags = ["--coverage", "-O0", "-DREEL_NARROW", "-fprofile-update=atomic"]
    library = built(tmp_path, "gcc", *flags)
    check(library, "--make")
    lines = {
        name: runs
        for name, runs in lines_of(tmp_path).items()
        if (ROOT / "core" / name).exists() and name not in REGISTRATION
    }
    missed = {
        name: [number for number, was_run in sorted(runs.items()) if not was_run]
        for name, runs in lines.items()
    }
    n_lines, n_missed = (sum(map(len, files.values())) for files in (lines, missed))
    print(f"{n_lines - n_missed} of {n_lines} lines were run; missed: {missed}")
    assert n_missed <= (1 - MIN_COVERAGE) * n_lines, missed
    assert fuzz_checksum(library, "gcc", tmp_path) == default_checksum


def arrays_of(decoded):
    """Return the arrays that `check.c` wrote, each preceded by its size."""
    arrays, begin = [], 0
    while begin < len(decoded):
        (size,) = struct.unpack_from("<Q", decoded, begin)
        arrays.append(decoded[begin + 8 : begin + 8 + size])
        begin += 8 + size
    return arrays


def hash_of(data):
    return hashlib.sha256(data).hexdigest()


def hash_of_integers(data, kind):
    """Return the SHA-256 of integers as little-endian int64, or None without data."""
    return hash_of(np.frombuffer(data, kind).astype("<i8").tobytes()) if data else None


def decoded_hashes(description, decoded):
    """Return hashes of the output of `check.c`, in the form of `stored_hashes`."""
    arrays = iter(arrays_of(decoded))
    hashes = {
        "triangles": hash_of_integers(next(arrays), "<u4"),
        "polygons": hash_of_integers(next(arrays), "<u4"),
        "corners": hash_of_integers(next(arrays), "<u4"),
        "attributes": [
            (hash_of(next(arrays)), hash_of_integers(next(arrays), "<i4"))
            for _ in description["attributes"]
        ],
        "groups": [hash_of_integers(next(arrays), "<i4") for _ in description["groups"]],
    }
    return hashes | {"tracks": [hash_of(values) for values in arrays]}


def stored_hashes(description):
    positions = [description["hash of positions"]] if "hash of positions" in description else []
    return {
        "triangles": description["hash of faces"],
        "polygons": description["hash of polygons"],
        "corners": description.get("hash of corners"),
        "attributes": [(a["hash of values"], a["hash of rows"]) for a in description["attributes"]],
        "groups": [group["hash of numbers"] for group in description["groups"]],
        "tracks": positions + [track["hash of values"] for track in description.get("tracks", [])],
    }


ARM = "aarch64-linux-gnu-gcc"
QEMU = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]


# Python tests cover gcc at -O3.
@pytest.mark.parametrize(("level", "compiler", "runner"), [("-O0", "gcc", []), ("-O2", ARM, QEMU)])
def test_c_library_reproduces_the_descriptions(compiler, runner, level, tmp_path):
    need_programs(compiler, *runner[:1])
    flags = [level, f"-I{ROOT / 'core' / 'include'}", str(ROOT / "conformance" / "check.c")]
    program = compiled(tmp_path / "check", compiler, flags)
    failed = []
    for name in STREAMS:
        paths = [str(FOLDER / f"{name}.reel"), str(tmp_path / "out")]
        subprocess.run([*runner, str(program), *paths], check=True, timeout=TIME_LIMIT_S)
        description = stored_description(name)
        if decoded_hashes(description, (tmp_path / "out").read_bytes()) != stored_hashes(
            description
        ):
            failed.append(name)
    assert failed == []


def test_decoders_on_threads_do_not_race(tmp_path):
    need_programs("gcc", "g++")
    # -O0 compiles three times as fast as -O1, and optimizes no access away.
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
    paths = [str(FOLDER / f"{name}.reel") for name in names]
    done = subprocess.run(
        [str(program), *paths], capture_output=True, text=True, timeout=TIME_LIMIT_S
    )
    assert (done.returncode, done.stderr) == (0, "")
