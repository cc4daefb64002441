"""The program without the libraries that only extras install."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import meshreel
from samples.meshes import waving_grid

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

COMMANDS = """
demo --frames 2 --out demo
encode walk.npz -o near.reel --max-error 0.1
encode walk.npz -o exact.reel --lossless
encode walk.npz -o same.reel --sted 0.05
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
    "register walk.npz -o other.reel --texture images": "register,video",
    "register walk.npz -o a.reel --texture images --texture-output t_%d.png": "register",
    "register frame.drc -o other.reel": "draco,register",
    "encode frame.drc -o other.reel --register 0.2%": "draco,register",
    "convert run.vtkhdf -o walk.abc": "hdf,alembic",
    "decode walk.reel -o walk.abc": "alembic",
    "decode walk.reel -o walk.usdc": "usd",
    "decode walk.reel -o walk.vtkhdf": "hdf",
    "decode walk.reel -o walk.h5": "hdf",
    "decode walk.reel -o walk.xdmf": "hdf",
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
    return done.stderr.splitlines()


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
    lines = COMMANDS.strip().splitlines()
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
    (tmp_path / "run.vtkhdf").touch()
    (tmp_path / "frame.drc").write_bytes(b"DRACO\2\2\1")  # a triangle mesh
    messages = run_without_extras(tmp_path, MISSING)
    assert messages[1::2] == ["exit 1"] * len(MISSING)
    for (command, extras), message in zip(MISSING.items(), messages[::2], strict=True):
        assert f"pip install 'meshreel[{extras}]'" in message, command


def test_base_dependencies_exclude_those_of_extras():
    stated = " ".join(PROJECT["project"]["dependencies"])
    assert not [name for name in ("scipy", "pillow") if name in stated]
