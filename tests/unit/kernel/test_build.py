"""Compilation of the core, and errors without a compiler or library."""

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from meshreel.kernel import library

ROOT = Path(__file__).parents[3]
COMPILE = ROOT / "core" / "compile.py"
FUZZ = ROOT / "core" / "fuzz" / "run.py"


@pytest.fixture
def core(monkeypatch):
    """`core/compile.py` on a machine without compilers and without $CC."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "ziglang", None)
    module = runpy.run_path(str(COMPILE))
    module["compiler"].__globals__["COMPILERS"] = ("cc", "clang", "gcc")
    module["compiler"].__globals__["zig"] = lambda: None
    return module


def install(folder, *names):
    for name in names:
        program = folder / name
        program.write_text("#!/bin/sh\nexit 1\n")
        program.chmod(0o755)


needs_shell = pytest.mark.skipif(sys.platform == "win32", reason="programs end in .exe there")


@needs_shell
@pytest.mark.parametrize(
    ("there", "chosen"),
    [(["gcc", "clang", "cc"], "cc"), (["gcc", "clang"], "clang"), (["gcc"], "gcc")],
)
def test_compiler_is_that_of_the_machine_if_available(core, monkeypatch, tmp_path, there, chosen):
    install(tmp_path, *there)
    monkeypatch.setenv("PATH", str(tmp_path))
    core["compiler"].__globals__["zig"] = lambda: ["zig"]
    assert core["compiler"]() == [chosen]


@needs_shell
def test_compiler_and_flags_are_those_of_cc_when_it_is_set(core, monkeypatch, tmp_path):
    install(tmp_path, "cc")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "ccache 'my gcc' -m64")
    assert core["compiler"]() == ["ccache", "my gcc", "-m64"]


def test_zig_compiles_for_the_baseline_processor_without_another_compiler(core):
    core["compiler"].__globals__["zig"] = lambda: ["python", "-m", "ziglang", "cc"]
    assert core["compiler"]() == ["python", "-m", "ziglang", "cc", "-mcpu=baseline"]


def test_error_is_one_line_with_a_remedy_without_a_compiler(core, tmp_path):
    with pytest.raises(RuntimeError) as caught:
        core["build"](tmp_path / "libreel.so")
    assert str(caught.value) == core["NO_COMPILER"]
    assert "\n" not in core["NO_COMPILER"]
    assert not list(tmp_path.iterdir())


def test_error_names_the_missing_compiler_of_cc(core, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(RuntimeError, match=r"^CC names the compiler 'no-such-compiler'.*$"):
        core["build"](tmp_path / "libreel.so")


@needs_shell
def test_error_contains_compiler_output_and_no_file_remains(core, monkeypatch, tmp_path):
    program = tmp_path / "bad-cc"
    program.write_text("#!/bin/sh\necho syntax error >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("CC", str(program))
    (tmp_path / "out").mkdir()
    with pytest.raises(RuntimeError, match="syntax error"):
        core["build"](tmp_path / "out" / "libreel.so")
    assert not list((tmp_path / "out").iterdir())


def test_library_is_current_until_a_source_is_newer(core, tmp_path):
    built = tmp_path / "libreel.so"
    assert not core["is_current"](built)
    newest = max(file.stat().st_mtime for file in [*core["sources"](), COMPILE])
    built.touch()
    os.utime(built, (newest + 1, newest + 1))
    assert core["is_current"](built)
    os.utime(built, (newest - 1, newest - 1))
    assert not core["is_current"](built)


@pytest.mark.parametrize("release", ["", "1"])
def test_library_is_compiled_for_speed_only_when_it_is_for_a_release(
    monkeypatch, tmp_path, release
):
    monkeypatch.setenv("MESHREEL_RELEASE", release)
    monkeypatch.setenv("CC", "cc")
    steps, _ = runpy.run_path(str(COMPILE))["commands"](tmp_path / "libreel.so")
    levels = {[flag for flag in step if flag.startswith("-O")][-1] for step in steps}
    assert levels == ({"-O3"} if release else {"-O1", "-O2", "-O3"})
    assert any("REEL_INLINE" in flag for flag in steps[0]) != bool(release)


def test_wheel_tag_names_the_deployment_target_when_built_for_macos(core, monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr("platform.machine", lambda: "arm64")
    monkeypatch.setattr("platform.mac_ver", lambda: ("15.1", ("", "", ""), ""))
    assert core["wheel_tag"]() == "macosx_15_0_arm64"
    monkeypatch.setenv("MACOSX_DEPLOYMENT_TARGET", "11.0")
    assert core["wheel_tag"]() == "macosx_11_0_arm64"


def test_page_build_exports_the_public_header_and_imports_its_host(core):
    declared = (COMPILE.parent / "include" / "meshreel.h").read_text()
    declared += (COMPILE.parent / "reader" / "page.c").read_text()
    declared += (COMPILE.parent / "reel.h").read_text()  # of cells, which the page cuts
    for name in core["PAGE_FUNCTIONS"] + core["CELL_FUNCTIONS"]:
        assert f" {name}(" in declared or f"*{name}(" in declared, name


def test_error_is_one_line_with_a_remedy_without_the_library(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "FOLDER", tmp_path)
    library.library.cache_clear()
    with pytest.raises(ImportError, match=r"core/compile\.py") as caught:
        library.library()
    library.library.cache_clear()
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("clang") or shutil.which("gcc")) or sys.platform == "win32",
    reason="needs clang or gcc, with sanitizers",
)
def test_fuzzer_finds_no_crash():
    """Run the fuzzer for 5 s; a thorough run takes hours."""
    options = ["--seconds", "5", "--plain"]
    done = subprocess.run([sys.executable, FUZZ, *options], capture_output=True, text=True)
    assert not done.returncode, done.stdout + done.stderr
