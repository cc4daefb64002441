"""Files with several segments in a page: playback across boundaries, on GPU and CPU."""

import numpy as np
import pytest

import meshreel
from meshreel.model.materials import Material
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import FACE_MASKS
from samples.materials import png
from samples.meshes import grid_faces

COLORS = {"red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0)}
SIZES = [(9, 4), (13, 3), (6, 5)]
"""Vertices per side, and frames, of each segment."""

PLAY = """async ({ gpu, frames, texture }) => {
  const THREE = await import("three");
  const { ReelLoader } = await import("meshreel/three");
  const size = 100;
  const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true, antialias: false });
  renderer.setSize(size, size, false);
  const mesh = await new ReelLoader(undefined, { renderer, gpu }).loadAsync("/three.reel");
  const { center: [x, y, z], diagonal } = mesh.file.info;
  const camera = new THREE.PerspectiveCamera(40, 1, diagonal / 100, 10 * diagonal);
  camera.position.set(x, y, z + diagonal);
  const scene = new THREE.Scene();
  scene.add(mesh);
  const gl = renderer.getContext();
  const until = async (isSo) => {
    for (const end = performance.now() + 30000; !isSo(); ) {
      if (performance.now() > end) throw new Error(`frame ${mesh.frame}: no picture`);
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
  };
  const events = [];
  for (const type of ["waiting", "error", "segment"]) {
    mesh.addEventListener(type, ({ segment, error }) => {
      events.push([type, segment ?? String(error)]);
    });
  }
  const show = () => {
    renderer.render(scene, camera);
    const pixel = new Uint8Array(4);
    gl.readPixels(size / 2, size / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    const one = new THREE.Vector3();
    const positions = Array.from(mesh.sources, (_, i) => mesh.getVertexPosition(i, one).toArray());
    const { frame, segment, isOnGpu } = mesh;
    const nTriangles = mesh.geometry.index.count / 3;
    return { frame, segment, nTriangles, positions, pixel: [...pixel.slice(0, 3)], isOnGpu };
  };
  await until(() => !mesh.isWaiting);
  if (texture) await mesh.setTexture(texture);
  const seeking = [];
  for (const frame of frames) {
    mesh.seek({ frame });
    await until(() => !mesh.isWaiting);
    seeking.push(show());
  }
  mesh.seek(0);
  await until(() => !mesh.isWaiting);
  mesh.interpolate = false;
  events.length = 0;
  const playing = [];
  mesh.play();
  for (let i = 0; i < mesh.nFrames; i++) {
    playing.push(show());
    await new Promise((resolve) => setTimeout(resolve, 150)); // time for the next segment to load
    mesh.update(1 / 10);
  }
  mesh.dispose();
  const { geometries, textures } = renderer.info.memory;
  renderer.dispose();
  renderer.forceContextLoss();
  return { seeking, playing, events, left: [geometries, textures] };
}"""


def sheet(n_side, n_frames, color):
    """Return a rising square sheet with one unlit material."""
    y, x = np.mgrid[0:n_side, 0:n_side] / (n_side - 1.0)
    rise = 0.1 * np.arange(n_frames)[:, None, None] + 0.05 * np.sin(9 * x)
    vertices = np.stack(np.broadcast_arrays(x, y, rise), axis=-1).reshape(n_frames, -1, 3)
    faces = grid_faces(n_side, n_side)
    material = Material(color, base_color=(*COLORS[color], 1.0), unlit=True, double_sided=True)
    groups = FaceGroups("material", (color,), np.zeros(len(faces), np.int32))
    uv = Attribute("uv", Kind.UV, Domain.VERTEX, vertices[0, :, :2].astype(np.float32))
    surface = Surface(attributes=(uv,), groups=(groups,), materials=(material,))
    return meshreel.MeshSequence(vertices.astype(np.float32), faces, 10.0, surface=surface)


@pytest.fixture(scope="module")
def data():
    colors = zip(SIZES, COLORS, strict=True)
    return meshreel.encode(meshreel.concatenate([sheet(*size, color) for size, color in colors]))


def assert_right(shown, data, brightness=255):
    """Assert that positions, triangles and colors are those of the frame in its segment."""
    decoded = meshreel.decode(data)
    starts = np.array(decoded.starts)
    for one in shown:
        segment = int(np.searchsorted(starts, one["frame"], "right")) - 1
        expected = decoded.segments[segment]
        local = one["frame"] - starts[segment]
        assert one["segment"] == segment
        assert one["nTriangles"] == len(expected.faces)
        np.testing.assert_allclose(one["positions"], expected.read(local, local + 1)[0], atol=1e-4)
        color = brightness * np.array(list(COLORS.values())[segment])
        np.testing.assert_allclose(one["pixel"], color, atol=2)


@pytest.mark.parametrize("gpu", [True, False])
def test_segments_are_shown_with_their_own_mesh_and_material(three_page, data, gpu):
    frames = [3, 4, 11, 0, 6, 7, 5]
    result = played(three_page, data, gpu=gpu, frames=frames)
    assert [one["frame"] for one in result["seeking"]] == frames
    assert [one["frame"] for one in result["playing"]] == list(range(12))
    assert {one["isOnGpu"] for one in result["playing"]} == {gpu}
    assert_right(result["seeking"], data)
    assert_right(result["playing"], data)
    assert result["events"] == [["segment", 1], ["segment", 2], ["segment", 0]]
    assert result["left"] == [0, 0]


def test_a_texture_is_shown_on_all_segments(three_page, data):
    result = played(three_page, data, gpu=True, frames=[2, 8], texture="/gray.png")
    assert_right(result["seeking"] + result["playing"], data, brightness=128)


@pytest.mark.parametrize("gpu", [True, False])
@pytest.mark.parametrize("name", FACE_MASKS)
def test_faces_are_hidden_where_a_mask_is_zero(three_page, gpu, name):
    """Frames 1 and 3 have a hole in the middle; frames are coded in two blocks."""
    moving = sheet(9, 4, "red")
    middle = np.linalg.norm(moving.vertices[0][moving.faces].mean(axis=1)[:, :2] - 0.5, axis=1)
    is_shown = np.ones((4, moving.n_faces), bool)
    is_shown[1::2] = middle > 0.3
    masked = moving.replace(tracks={name: meshreel.Track(is_shown, "face")})
    data = meshreel.encode(masked, block_frames=2)
    shown = played(three_page, data, gpu=gpu, frames=[1, 0, 3, 2])["seeking"]
    assert [max(one["pixel"]) for one in shown] == [0, 255, 0, 255]
    assert_right(shown[1::2], data)


def played(three_page, data, **arguments):
    """Play a file in a page; returns the pictures and the events."""
    page = three_page({"/three.reel": data, "/gray.png": png(128).data})
    return page.evaluate(PLAY, {"texture": None, **arguments})
