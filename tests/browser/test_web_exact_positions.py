"""Files without modes in a page: the mesh shows exact positions."""

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track
from samples.web_package import PACKAGE, built_package, serving

PAGE = """<!doctype html><title>exact</title><link rel="icon" href="data:,">
<script type="importmap">{"imports": {"three": "/three/three.module.js",
"meshreel": "/dist/index.js", "meshreel/three": "/dist/three.js"}}</script>"""

OFF = """async ([address, frames]) => {
  const THREE = await import("three");
  const { ReelLoader } = await import("meshreel/three");
  const renderer = new THREE.WebGLRenderer();
  const mesh = await new ReelLoader(undefined, { renderer }).loadAsync(address);
  await mesh.colorBy("height");
  let largest = 0;
  for (const frame of frames) {
    mesh.seek({ frame });
    while (mesh.isWaiting) await new Promise((resolve) => setTimeout(resolve, 5));
    const wanted = await mesh.positionsAt(frame);
    const found = new THREE.Vector3();
    mesh.sources.forEach((vertex, i) => {
      mesh.getVertexPosition(i, found);
      const position = new THREE.Vector3().fromArray(wanted, 3 * vertex);
      largest = Math.max(largest, found.distanceTo(position));
    });
  }
  const { isOnGpu } = mesh;
  const { method, diagonal } = mesh.reel.info;
  mesh.dispose();
  renderer.dispose();
  return [method, isOnGpu, largest / diagonal];
}"""


@pytest.fixture(scope="module", autouse=True)
def _package():
    built_package()


@pytest.mark.parametrize("method", ["lossless", "grid"])
def test_exact_positions_are_shown_in_place(new_page, method):
    flag = meshreel.simulate_flag(70, n_rows=9, n_columns=11)
    height = Track(flag.vertices[:, :, 2].astype(np.float32))
    sequence = meshreel.MeshSequence(flag.vertices, flag.faces, fps=24, tracks={"height": height})
    options = {"max_error": 0.01} if method == "grid" else {}
    stream = meshreel.encode(sequence, method, **options)
    three = PACKAGE / "node_modules" / "three" / "build"
    files = {f"/three/{path.name}": path.read_bytes() for path in three.glob("three*.js")}
    files |= {"/index.html": PAGE.encode(), "/flag.reel": stream}
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", is_shown=False)
        found = page.evaluate(OFF, ["/flag.reel", [0, 31, 32, 69, 40]])
    assert found[:2] == [method, True]
    assert found[2] < 1.1e-5
