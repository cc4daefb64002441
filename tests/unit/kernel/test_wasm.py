"""The decoder as WebAssembly: small, alone, and of the same bits as the library."""

import base64
import gzip
import hashlib
import importlib.util
import json
import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from meshreel.kernel.connectivity import decode_faces, encode_faces
from meshreel.kernel.fields import encode_fields
from meshreel.kernel.frames import fill_values, packed_fields, time_vectors
from meshreel.kernel.integers import encode_rows
from meshreel.kernel.mesh import hierarchy, neighbours
from meshreel.kernel.predict import decode_values
from samples.meshes import waving_grid

COMPILE = Path(__file__).parents[3] / "core" / "compile.py"
MOST_BYTES = 30_000
"""After gzip."""

TARGETS = ["wasm", "wasm-plain"]
"""With vectors, and for engines that have none."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs ziglang"),
]


@pytest.fixture(scope="module", params=TARGETS)
def module(request, tmp_path_factory):
    core = runpy.run_path(str(COMPILE))
    return core["build"](tmp_path_factory.mktemp("wasm") / "reel.wasm", target=request.param)


def test_the_module_is_small_enough_for_a_page(module):
    assert len(gzip.compress(module.read_bytes(), 9)) < MOST_BYTES


def hash_of(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


@pytest.mark.skipif(shutil.which("node") is None, reason="needs Node")
def test_the_module_decodes_the_same_bits_as_the_library(module, tmp_path):
    given = waving_grid(7, 30, 40)
    n_verts, n_modes, n_frames, stencil_size = given.n_verts, 5, 7, 16
    rng = np.random.default_rng(1)
    residuals = np.rint(rng.laplace(0, 3, (n_modes, n_verts))).astype(np.int32)
    coded_times = np.rint(rng.laplace(0, 900, (n_modes, 3, n_frames))).astype(np.int32)
    placement = (0.37, 1.0, -2.0, 0.1)
    connectivity, _, faces = encode_faces(given.faces, n_verts, listed=False)

    found = hierarchy(neighbours(faces, n_verts), stencil_size)
    values = decode_values(found, residuals, n_modes)
    positions = np.empty((n_frames, n_verts, 3), np.float32)
    times = time_vectors(coded_times)
    packed = packed_fields(values.T, is_single=True)
    fill_values(positions, times, packed, range(n_frames), placement)

    text = {
        "connectivity": connectivity,
        "fields": encode_fields(residuals),
        "times": encode_rows([coded_times.ravel()], [0]),
    }
    stream = {
        **{name: base64.b64encode(data).decode() for name, data in text.items()},
        "n_verts": n_verts,
        "n_faces": len(faces),
        "n_modes": n_modes,
        "n_frames": n_frames,
        "stencil_size": stencil_size,
        "placement": placement,
    }
    path = tmp_path / "stream.json"
    path.write_text(json.dumps(stream))
    script = Path(__file__).with_name("decode_in_wasm.mjs")
    done = subprocess.run(["node", script, module, path], capture_output=True, text=True)
    assert not done.returncode, done.stderr
    told = json.loads(done.stdout)
    np.testing.assert_array_equal(decode_faces(connectivity, n_verts, len(faces)), faces)
    assert told["faces"] == hash_of(faces)
    assert told["values"] == hash_of(values)
    assert told["positions"] == hash_of(positions)
