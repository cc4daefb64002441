"""Start of the program: imports, completion, help, singular nouns, and missing extras."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.app.cli import evaluate, paper
from meshreel.app.cli.commands import COMMANDS, command_named
from samples.commands import run, run_ok
from samples.meshes import waving_grid
from samples.programs import output_of

HEAVY = {"numpy", "scipy", "PIL", "pydantic"}
"""Modules that are slow to import."""


@pytest.fixture
def offered(folder, monkeypatch):
    """Function that returns the completions of a line in bash, except files that bash completes."""

    def offer(line):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setenv("_MESHREEL_COMPLETE", "bash_complete")
        lines = [line.split(",", 1) for line in run(cwd=folder).stdout.split()]
        return [word for kind, word in lines if kind == "plain"]

    return offer


@pytest.fixture
def folder(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(waving_grid()))
    (tmp_path / "walk.txt").write_text("words")
    (tmp_path / "waves").mkdir()
    return tmp_path


def test_python_m_runs_the_program():
    printed = output_of(sys.executable, "-m", "meshreel", "--version")
    assert printed == f"meshreel {meshreel.__version__}\n"


def imported(*arguments):
    program = (
        "import atexit, sys; from meshreel.app.cli import main; "
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return set(done.stderr.split())


REGISTRY = {
    "meshreel.methods", "meshreel.codec", "meshreel.codec.methods", "meshreel.codec.method_names",
    "meshreel.model", "meshreel.model.showing", "meshreel.runtime", "meshreel.runtime.version",
}  # fmt: skip
"""The version, and modules that register methods and the viewer without loading them."""


def test_version_imports_no_heavy_modules():
    modules = imported("--version")
    ours = {name for name in modules if name.startswith("meshreel.")}
    version = {"meshreel.runtime", "meshreel.runtime.version"}
    light = {"meshreel.errors", "meshreel.app", *version, *REGISTRY}
    assert {name for name in ours if not name.startswith("meshreel.app.cli")} == light
    assert not HEAVY & modules


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_imports_no_heavy_modules(words):
    modules = imported(*words)
    assert not HEAVY & modules
    of_commands = {name for name in modules if name.removeprefix("meshreel.app.cli.") in COMMANDS}
    assert of_commands == {f"meshreel.app.cli.{name}" for name in words[:-1] or COMMANDS}


@pytest.mark.slow
def test_info_of_other_formats_imports_no_codec(folder):
    modules = imported("info", folder / "walk.npz")
    codec = {name for name in modules if name.startswith("meshreel.codec")}
    light = {*REGISTRY, "meshreel.codec.option"}
    light |= {"meshreel.codec.bitstream", "meshreel.codec.bitstream.layout"}
    # The limit of --memory, the ranges of options, and the options of all commands.
    options = {"config", "options", "paper_options", "reel_options", "image_options"}
    light |= {f"meshreel.codec.{name}" for name in {"memory", "targets", "error_bounds"} | options}
    assert codec <= light
    assert not {"scipy", "DracoPy"} & modules


@pytest.mark.slow
def test_info_of_a_stream_imports_no_decoder(folder):
    modules = imported("info", folder / "walk.reel")
    assert not {"scipy", "meshreel.codec.reel.encoding.whole", "meshreel.codec.encoder"} & modules


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_script_is_printed_when_the_variable_of_click_asks_for_it(shell, monkeypatch):
    monkeypatch.setenv("_MESHREEL_COMPLETE", f"{shell}_source")
    assert f"_MESHREEL_COMPLETE={shell}_complete" in run_ok().stdout


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("meshreel ", list(COMMANDS)),
        ("meshreel encode wa", []),  # the shell completes files
        ("meshreel encode walk.npz --max-e", ["--max-error"]),
        ("meshreel encode walk.npz --method pca-", ["pca-qp", "pca-q", "pca-qs"]),
        ("meshreel render walk.reel --heatmap a", ["angle"]),
    ],
)
def test_completion_offers_commands_options_and_names(offered, line, expected):
    assert offered(line) == expected


def test_names_in_help_equal_those_of_the_evaluation():
    from meshreel.codec.method_names import METHOD_NAMES
    from meshreel.evaluation.positions import DEFAULT_METHODS, PEERS
    from meshreel.paper import sweeps
    from meshreel.paper.sweeps import PRESETS

    assert evaluate.METHODS.split(", ") == [*METHOD_NAMES]
    assert evaluate.DEFAULT.split(",") == [*DEFAULT_METHODS]
    assert evaluate.PEERS.split(",") == [peer.name for peer in PEERS]
    assert paper.METHODS.split(",") == [*sweeps.METHOD_NAMES]
    [preset] = [param for param in command_named("paper").params if param.name == "preset"]
    assert tuple(PRESETS) == tuple(vars(preset.type)["choices"])


def test_help_is_ascii_when_the_terminal_requires_it():
    done = subprocess.run(
        [sys.executable, "-m", "meshreel", "encode", "--help"],
        capture_output=True,
        timeout=60,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"},
    )
    text = done.stdout.decode("ascii")
    assert "\n  - meshreel encode sim.vtkhdf --track stress=500Pa" in text
    assert "\n    --track velocity=0.1% --track id=exact" in text


def test_help_shows_common_options_and_help_all_every_one():
    shown, every = run_ok("encode", "--help").stdout, run_ok("encode", "--help-all").stdout
    flags = re.compile(r"^  (?:-\w, )?(--[a-z-]+)", re.MULTILINE)
    common, all_flags = (
        {*flags.findall(text)} - {"--help", "--help-all"} for text in (shown, every)
    )
    assert len(common) <= 16
    assert {"--output", "--quality", "--max-error", "--lossless", "--fps", "--track"} <= common
    assert {*all_flags} == {
        max(param.opts, key=len)
        for param in command_named("encode").params
        if param.name != "inputs"
    } - {"--help-all"}
    assert "--block-frames" not in shown
    assert "--block-frames" in every


def test_ctrl_c_is_reported_with_the_exit_code_of_its_signal(monkeypatch, tmp_path):
    def interrupt(*_args, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr("meshreel.operations.compare.compare", interrupt)
    done = run("compare", tmp_path, tmp_path)
    assert (done.returncode, done.stderr.strip()) == (130, "meshreel: stopped")


@pytest.mark.parametrize("words", [[], ["encode"], ["convert", "a.npz", "b.npz"]])
def test_the_short_option_shows_the_help(words):
    assert run_ok(*words, "-h").stdout == run_ok(*words, "--help").stdout != ""


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_examples_and_no_type_of_flags(command):
    shown = run_ok(command, "--help").stdout
    assert f"meshreel {command} " in shown
    assert "--json" in shown or command in ("view", "core")
    assert "bool" not in shown.lower()


NOUNS = "frames|vertices|faces|modes|files|targets|meshes"
PLURAL_OF_ONE = re.compile(rf"(?<![\d.,])1 [a-z ]*?({NOUNS})\b")


@pytest.fixture
def triangle(tmp_path):
    """A folder with one frame of a triangle in several formats."""
    sequence = meshreel.MeshSequence(np.eye(3, dtype=np.float32)[None], [[0, 1, 2]])
    meshreel.save(sequence, tmp_path / "one.npz")
    meshreel.save(sequence, tmp_path / "one.usda")
    (tmp_path / "one.reel").write_bytes(meshreel.encode(sequence))
    return tmp_path


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("encode one.npz -o a.reel", "1 frame, 3 vertices, 1 face"),
        ("info one.npz", "1 frame, 3 vertices, 1 face"),
        ("info one.usda", "1 frame, 3 vertices, 1 face"),
        ("info one.reel", "1 frame, 3 vertices, 1 face"),
        ("decode one.reel -o b.glb", "1 frame, 3 vertices, 1 face"),
        ("decode one.reel -o b_%d.obj", "1 frame, 3 vertices, 1 face"),
        ("demo --frames 1 --out demo", "1 frame, 2704 vertices"),
        ("convert one.npz -o b.usda", "1 frame, 3 vertices, 1 face"),
    ],
)
def test_output_uses_the_singular_for_one_item(triangle, command, expected):
    done = run(*command.split(), cwd=triangle)
    assert expected in done.stdout
    assert not PLURAL_OF_ONE.search(done.stdout + done.stderr)


PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))

OPTIONAL = (
    "scipy", "xatlas", "matplotlib", "PIL", "imageio_ffmpeg", "DracoPy",
    "blosc2", "fpzip", "pcodec", "pysz", "zfpy", "meshoptimizer", "distributed", "alembic3d",
    "imath", "pxr", "h5py", "fsspec", "imagecodecs", "OpenEXR", "torch",
)  # fmt: skip
"""Modules of the extras that users install."""

PROGRAM = f"""
import json, sys
sys.modules.update(dict.fromkeys({OPTIONAL!r}))  # an import of these fails
from meshreel.app.cli import main

for words in json.loads(sys.argv[1]):
    sys.argv = ["meshreel", *words]
    try:
        main()
    except SystemExit as end:
        print("exit", end.code, file=sys.stderr)
"""

BASE_COMMANDS = """
demo --frames 2 --out demo
encode walk.npz -o near.reel --max-error 0.1
encode walk.npz -o exact.reel --lossless
encode walk.npz -o same.reel --kg 0.5
info near.reel
compare walk.npz near.reel
decode near.reel -o walk.glb
decode near.reel -o walk.pvd
decode near.reel -o frames/frame_%02d.obj
encode frames/ -o part.reel --fps 30
convert walk.glb -o back.npz
formats
export near.reel -o walk.html --original walk.npz
batch demo streams
"""


MISSING = {
    "encode walk.npz -o pca.reel --method pca-qp": "paper",
    "decode paper.reel -o back.npz": "paper",
    "paper walk.npz --quick": "paper,plot",
    "compare walk.npz other.npz": "surfaces",
    "compare run.vtkhdf walk.npz": "hdf",
    "evaluate walk.npz --quick": "plot,peers,paper",
    "evaluate walk.npz --methods reel --peers npz": "plot,peers",
    "evaluate run.vtkhdf --methods reel": "plot,peers,hdf",
    "render walk.reel -o walk.png": "render",
    "render walk.reel -o walk.gif": "render",
    "render walk.reel -o walk.mp4": "video",
    "render run.vtkhdf -o walk.mp4": "video,hdf",
    "register walk.npz -o other.mp4 --texture images": "register,video",
    "register walk.npz -o a.reel --texture images --texture-output t_%d.png": "register",
    "register frame.drc -o other.reel": "draco,register",
    "encode frame.drc -o other.reel --register 0.2%": "draco,register",
    "convert run.vtkhdf -o walk.abc": "hdf,alembic",
    "decode walk.reel -o walk.abc": "alembic",
    "decode walk.reel -o walk.usdc": "usd",
    "decode walk.reel -o walk.vtkhdf": "hdf",
    "decode walk.reel -o walk.h5": "hdf",
    "decode walk.reel -o walk.vat": "textures",
    "encode frame.drc -o frame.reel": "draco",
    "encode https://example.invalid/walk.npz -o walk.reel": "remote",
    "batch frames streams --scheduler tcp://127.0.0.1:1": "dask",
}
"""Commands that need extras, by the extras that their error names."""


def run_without_extras(folder, lines):
    words = json.dumps([line.split() for line in lines])
    command = [sys.executable, "-c", PROGRAM, words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=folder)
    assert done.returncode == 0, done.stderr
    # A busy machine shows progress.
    return [line for line in done.stderr.splitlines() if not line.endswith(" so far)")]


def test_base_commands_import_no_optional_library(tmp_path):
    lines = ["demo --frames 2", "info meshreel-demo/flag.reel"]
    lines += ["export meshreel-demo/flag.reel -o flag.html --original meshreel-demo/flag.npz"]
    messages = run_without_extras(tmp_path, lines)
    assert messages == ["exit 0"] * len(lines)
    assert not (tmp_path / "meshreel-demo" / "flag.png").exists()


@pytest.mark.slow
def test_base_installation_runs_every_base_command(tmp_path):
    original = waving_grid(12)
    meshreel.save(original, tmp_path / "walk.npz")
    lines = BASE_COMMANDS.strip().splitlines()
    messages = run_without_extras(tmp_path, lines)
    assert messages.count("exit 0") == len(lines), messages
    near = meshreel.decode((tmp_path / "near.reel").read_bytes())
    assert meshreel.compare(original, near).max_error_percent <= 0.1


@pytest.mark.slow
def test_missing_extras_are_an_error_of_one_line_that_names_all(tmp_path):
    sequence = waving_grid()
    meshreel.save(sequence, tmp_path / "walk.npz")
    (tmp_path / "frames").mkdir()
    meshreel.save(sequence, tmp_path / "frames" / "walk.npz")
    other = meshreel.MeshSequence(sequence.vertices, sequence.faces[1:])
    meshreel.save(other, tmp_path / "other.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(sequence))
    (tmp_path / "paper.reel").write_bytes(meshreel.encode(sequence, "pca-qp"))
    (tmp_path / "run.vtkhdf").write_bytes(b"HDF")
    (tmp_path / "frame.drc").write_bytes(b"DRACO\2\2\1")  # a triangle mesh
    messages = run_without_extras(tmp_path, MISSING)
    assert messages[1::2] == ["exit 1"] * len(MISSING)
    for (command, extras), message in zip(MISSING.items(), messages[::2], strict=True):
        assert f"pip install 'meshreel[{extras}]'" in message, command


def test_base_dependencies_exclude_those_of_extras():
    stated = " ".join(PROJECT["project"]["dependencies"])
    assert not [name for name in ("scipy", "pillow") if name in stated]
