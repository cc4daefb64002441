"""The C library: build, installation, and linking by other programs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from compile import FLAGS

import meshreel
from samples.c_interface import functions

ROOT = Path(__file__).parents[3]
CORE, EXAMPLE = ROOT / "core", ROOT / "examples" / "engine"
SOURCE = EXAMPLE / "frames" / "frames.c"
STREAM = ROOT / "conformance" / "streams" / "key_blocks.reel"
TIME_LIMIT_S = 300
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="tried where libraries are .so or .dylib"),
]


def need(*programs):
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"needs {program}")


def run(*command, **environment):
    """Run a program, which must succeed, and return its output."""
    done = subprocess.run(
        list(map(str, command)),
        capture_output=True,
        timeout=TIME_LIMIT_S,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, (done.stdout + done.stderr).decode()
    return done.stdout


@pytest.fixture(scope="module", params=["gcc", "clang"])
def installed(request, tmp_path_factory):
    """Prefix of the installed library, and its compiler."""
    need("cmake", request.param)
    build, prefix = tmp_path_factory.mktemp("build"), tmp_path_factory.mktemp("prefix")
    settings = f"-DCMAKE_C_COMPILER={request.param}", "-DCMAKE_BUILD_TYPE=Debug"
    run("cmake", "-S", CORE, "-B", build, "-DCMAKE_INSTALL_LIBDIR=lib", *settings)
    run("cmake", "--build", build, "--parallel", "2")
    run("cmake", "--install", build, "--prefix", prefix)
    return prefix, request.param


@pytest.fixture(scope="module")
def expected():
    """Positions of the stream, as the programs write them."""
    return np.ascontiguousarray(meshreel.decode(STREAM).vertices).tobytes()


def flags_of(prefix, *names):
    """Return the output of pkg-config for packages."""
    need("pkg-config")
    paths = os.pathsep.join(
        [str(prefix / "lib" / "pkgconfig"), os.environ.get("PKG_CONFIG_PATH", "")]
    )
    return run("pkg-config", "--cflags", "--libs", *names, PKG_CONFIG_PATH=paths).decode().split()


def has_sdl():
    """Return whether the drawing library of the example is installed."""
    command = ["pkg-config", "--exists", "sdl2"]
    return bool(shutil.which("pkg-config")) and not subprocess.run(command, check=False).returncode


def test_example_of_the_header_links_with_pkg_config_and_decodes_the_same_bits(
    installed, expected, tmp_path
):
    prefix, compiler = installed
    moved = tmp_path / "elsewhere"
    shutil.copytree(prefix, moved, symlinks=True)
    source, program = tmp_path / "example.c", tmp_path / "example"
    head = (CORE / "include" / "meshreel.h").read_text(encoding="utf-8").partition("*/")[0]
    source.write_text("\n".join(line for line in head.split("\n") if line.startswith(" " * 7)))
    options = "-Wall", "-Werror", f"-Wl,-rpath,{moved / 'lib'}"
    run(compiler, source, *flags_of(moved, "meshreel"), *options, "-o", program)
    first, refused = (
        subprocess.run([program], input=data, capture_output=True, timeout=TIME_LIMIT_S)
        for data in (STREAM.read_bytes(), b"other")
    )
    assert first.stdout == expected[: len(first.stdout)] != b""
    assert (refused.returncode, refused.stderr) == (1, b"not a .reel stream\n")


def test_cpp_program_links_the_static_library(installed, expected, tmp_path):
    prefix, compiler = installed
    cpp = {"gcc": "g++", "clang": "clang++"}[compiler]
    need(cpp)
    program = tmp_path / "program"
    strict = "-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"
    inputs = "-x", "c++", SOURCE, "-x", "none", prefix / "lib" / "libmeshreel.a"
    run(cpp, *strict, f"-I{prefix / 'include'}", *inputs, "-o", program)
    assert run(program, STREAM) == expected


@pytest.mark.parametrize("installed", ["gcc"], indirect=True)
def test_program_links_with_cmake(installed, expected, tmp_path):
    prefix, compiler = installed
    settings = f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_C_COMPILER={compiler}"
    run("cmake", "-S", SOURCE.parent, "-B", tmp_path, *settings)
    run("cmake", "--build", tmp_path)
    for program in ("frames", "frames_alone"):
        assert run(tmp_path / program, STREAM) == expected


def threads_program(folder):
    """Build the C++ example, which decodes on threads, with the library of the package."""
    need("c++")
    program = folder / "program"
    flags = run(sys.executable, "-m", "meshreel", "core", "--cflags", "--libs").decode().split()
    strict = "-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-pthread"
    run("c++", *strict, EXAMPLE / "threads" / "threads.cpp", *flags, "-o", program)
    return program


def test_cpp_program_decodes_on_threads(tmp_path):
    program = threads_program(tmp_path)
    shown = run(program, STREAM.with_name("corners_in_rows.reel")).decode().splitlines()
    assert shown[0] == "29 triangles, 0 attributes"
    assert shown[1] == "16 frames of 22 vertices"
    assert shown[2] == "track wave: 59 values of 2 numbers"
    assert len(shown) == 7
    damaged = tmp_path / "damaged.reel"
    damaged.write_bytes(STREAM.read_bytes()[:100])
    failed = subprocess.run([program, damaged], capture_output=True, timeout=TIME_LIMIT_S)
    assert (failed.returncode, failed.stdout) == (1, b"")
    assert failed.stderr == b"the file ends too early; fetch it again\n"


@pytest.mark.parametrize("installed", ["gcc"], indirect=True)
def test_threaded_example_builds_with_cmake(installed, tmp_path):
    need("g++")
    settings = f"-DCMAKE_PREFIX_PATH={installed[0]}", "-DCMAKE_CXX_COMPILER=g++"
    run("cmake", "-S", EXAMPLE / "threads", "-B", tmp_path, *settings)
    run("cmake", "--build", tmp_path)
    assert run(tmp_path / "threads", STREAM)


def test_shared_library_exports_the_header_and_needs_no_other_library(installed):
    prefix, _ = installed
    if sys.platform == "darwin":
        pytest.skip("names of libraries differ")
    need("nm")

    def symbols(*options):
        lines = run("nm", "-D", *options, prefix / "lib" / "libmeshreel.so").decode().splitlines()
        kinds = [line.split()[-2:] for line in lines]
        return {name.partition("@")[0] for kind, name in kinds if kind in "TU"}

    assert {name for name in symbols("--defined-only") if name[0] != "_"} == set(functions())
    called_by_compilers = {"bcmp", "memcmp", "memcpy", "memmove", "memset", "__stack_chk_fail"}
    assert symbols("--undefined-only") <= called_by_compilers
    number = re.search(r"MESHREEL_ABI (\d+)", (CORE / "include" / "meshreel.h").read_text())[1]
    assert (prefix / "lib" / f"libmeshreel.so.{number}").exists()


def test_example_plays_a_file_in_a_window(installed, tmp_path):
    prefix, compiler = installed
    if not has_sdl():
        pytest.skip("needs SDL 2 (Debian: libsdl2-dev)")
    program = tmp_path / "play"
    warnings = "-Wall", "-Wextra", "-Werror"
    flags = flags_of(prefix, "meshreel", "sdl2")
    at_run_time = f"-Wl,-rpath,{prefix / 'lib'}"
    run(compiler, *warnings, EXAMPLE / "play.c", *flags, at_run_time, "-o", program)
    shown = run(program, STREAM, "3", SDL_VIDEODRIVER="dummy")  # without a screen
    assert shown == b"3 frames of 42 vertices\n"


@pytest.mark.parametrize("installed", ["gcc"], indirect=True)
def test_example_builds_with_cmake(installed, tmp_path):
    prefix, compiler = installed
    if not has_sdl():
        pytest.skip("needs SDL 2 (Debian: libsdl2-dev)")
    settings = f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_C_COMPILER={compiler}"
    run("cmake", "-S", EXAMPLE, "-B", tmp_path, *settings)
    run("cmake", "--build", tmp_path)
    assert run(tmp_path / "play", STREAM, "1", SDL_VIDEODRIVER="dummy")


def test_code_of_the_guide_compiles(tmp_path):
    need("cc")
    page = (ROOT / "docs" / "guides" / "engines.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^```c\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    include, body = shown.split("\n", 1)
    parameters = "void *bytes, size_t size, uint32_t frame, float *positions, float *normals"
    callbacks = (
        "void *allocate(void *user, size_t size);\n"
        "void release(void *user, void *memory, size_t size);\n"
    )
    program = tmp_path / "shown.c"
    program.write_text(f"{include}\n{callbacks}void play({parameters}) {{\n{body}}}\n")
    warnings = "-Wall", "-Wno-unused-variable", "-Werror"
    run("cc", "-fsyntax-only", *warnings, f"-I{CORE / 'include'}", program)


def test_versions_and_flags_are_those_of_the_package():
    header = (CORE / "include" / "meshreel.h").read_text()
    assert f'#define MESHREEL_VERSION "{meshreel.__version__}"' in header
    recipe = (CORE / "CMakeLists.txt").read_text()
    said_otherwise = {"-std=c11", "-fvisibility=hidden", "-DMESHREEL_BUILD"}
    assert [flag for flag in FLAGS if flag not in recipe] == [
        flag for flag in FLAGS if flag in said_otherwise
    ]
