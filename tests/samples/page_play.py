"""Scripts and assertions for pages that play the flag."""

import io

import numpy as np
from PIL import Image

import meshreel

PATIENCE_MS = 60_000

WATCHING = """
window.complaints = [];
addEventListener("error", (event) => complaints.push(event.message));
addEventListener("unhandledrejection", (event) => complaints.push(String(event.reason)));
for (const kind of ["error", "warn"]) {
  const say = console[kind];
  console[kind] = (...words) => (complaints.push(words.join(" ")), say(...words));
}
const contextOf = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return contextOf.call(this, kind, { ...options, preserveDrawingBuffer: true });
};
"""
"""Script before all others: records errors, and makes pixels readable."""

PLAYED = """async () => {
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const until = async (what, isSo) => {
    for (const end = performance.now() + PATIENCE_MS; !isSo(); await pause(20)) {
      if (performance.now() > end) throw new Error(`waited for ${what}; ${complaints}`);
    }
  };
  await until("a mesh", () => window.mesh);
  const isReelMesh = mesh.type === "ReelMesh";
  const frames = new Set();
  await until("four frames", () => {
    if (!mesh.isWaiting) frames.add(isReelMesh ? mesh.frame : mesh.metadata.frame);
    return frames.size >= 4;
  });
  let frame, positions;
  if (isReelMesh) {
    mesh.pause();
    mesh.seek({ frame: (frame = 12) });
    await until("frame 12", () => !mesh.isWaiting && mesh.frame === frame);
    const one = mesh.position.clone();
    positions = Array.from(mesh.sources, (_, i) => mesh.getVertexPosition(i, one).toArray()).flat();
  } else {
    frame = mesh.metadata.frame;
    positions = [...mesh.getVerticesData("position")];
  }
  await pause(500); // some pictures
  const picture = document.querySelector("canvas").toDataURL();
  const origin = mesh.reel?.info.center;
  const { isOnGpu } = mesh;
  const { isInWorker } = mesh.reel ?? {};
  const shown = { frame, positions, origin, picture };
  return { frames: [...frames], ...shown, isOnGpu, isInWorker, complaints };
}""".replace("PATIENCE_MS", str(PATIENCE_MS))


def complaints_of(found, name=""):
    """Return the messages of the page, except a warning of three.js about React's renderer."""
    known = "THREE.Clock: This module has been deprecated" if name == "react" else None
    return [one for one in found["complaints"] if not (known and one.startswith(known))]


def assert_played(found, data, name=""):
    """Assert that frames advanced, and that the shown one equals Python's."""
    assert complaints_of(found, name) == []
    assert len(found["frames"]) >= 4
    if name != "babylon":
        assert found["isOnGpu"]
        assert found["isInWorker"]
    decoded = meshreel.decode(data).vertices[found["frame"]]
    positions = np.reshape(found["positions"], (-1, 3))
    if name == "babylon":
        assert np.array_equal(positions, np.float32(decoded))
        return
    origin = found["origin"] if name == "react" else 0
    diagonal = np.linalg.norm(np.ptp(decoded, axis=0))
    assert np.abs(positions + origin - decoded).max() < 1e-4 * diagonal


def assert_shown(png):
    """Assert that the lit front of the mesh is visible."""
    picture = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int)
    is_drawn = np.abs(picture - picture[-3, 2]).max(axis=2) > 12
    assert 0.05 < is_drawn.mean() < 0.9
    assert picture[is_drawn].mean() > 96
