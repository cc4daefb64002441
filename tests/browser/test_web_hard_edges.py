"""Hard edges in a page: faces of a box have one normal each, on the GPU and on the CPU."""

import numpy as np
import pytest

import meshreel
from samples.meshes import hard_box

COLORS = """async (gpu) => {
  const THREE = await import("three");
  const { ReelLoader } = await import("meshreel/three");
  const size = 200;
  const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true, antialias: false });
  renderer.setSize(size, size, false);
  const material = new THREE.MeshNormalMaterial();
  const mesh = await new ReelLoader(undefined, { material, renderer, gpu }).loadAsync("/box.reel");
  mesh.seek({ frame: 1 });
  while (mesh.isWaiting) await new Promise((resolve) => setTimeout(resolve, 5));
  const { center, radius } = mesh.geometry.boundingSphere;
  const camera = new THREE.PerspectiveCamera(40, 1, radius / 50, 20 * radius);
  camera.position.copy(center).add(new THREE.Vector3(1.2, 1.5, 2).multiplyScalar(1.5 * radius));
  camera.lookAt(center);
  const scene = new THREE.Scene();
  scene.add(mesh);
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  const pixels = new Uint8Array(4 * size * size);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const counts = {};
  for (let i = 0; i < pixels.length; i += 4) {
    const [red, green, blue] = pixels.subarray(i, i + 3);
    if (red + green + blue) counts[[red, green, blue]] = (counts[[red, green, blue]] ?? 0) + 1;
  }
  const { isOnGpu } = mesh;
  mesh.dispose();
  renderer.dispose();
  renderer.forceContextLoss();
  return { counts, isOnGpu };
}"""


@pytest.mark.parametrize("gpu", [True, False])
def test_hard_edges_give_each_face_of_a_box_one_normal(three_page, gpu):
    result = three_page({"/box.reel": meshreel.encode(hard_box(3))}).evaluate(COLORS, gpu)
    assert result["isOnGpu"] == gpu
    faces = []
    colors = np.array([key.split(",") for key in result["counts"]], int)
    counts = np.array(list(result["counts"].values()))
    # Three faces are visible; each color may be rounded up or down.
    for color in colors[np.argsort(-counts)]:
        is_near = np.abs(colors - color).max(axis=1) <= 1
        if counts[is_near].sum() > 500:
            faces.append(color.tolist())
            colors, counts = colors[~is_near], counts[~is_near]
    assert len(faces) == 3
    assert counts.sum() < 20
