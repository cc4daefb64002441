"""Files without modes in a page: the mesh shows exact positions."""

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track

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


@pytest.mark.parametrize("method", ["lossless", "grid"])
def test_exact_positions_are_shown_in_place(three_page, method):
    flag = meshreel.simulate_flag(70, n_rows=9, n_columns=11)
    height = Track(flag.vertices[:, :, 2].astype(np.float32))
    sequence = meshreel.MeshSequence(flag.vertices, flag.faces, fps=24, tracks={"height": height})
    options = {"max_error": 0.01} if method == "grid" else {}
    stream = meshreel.encode(sequence, method, **options)
    page = three_page({"/flag.reel": stream})
    *facts, error = page.evaluate(OFF, ["/flag.reel", [0, 31, 32, 69, 40]])
    assert facts == [method, True]
    assert error < 1.1e-5
