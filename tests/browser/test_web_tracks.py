"""Tracks in a page have the values of Python and color the mesh."""

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track

N_ROWS, N_COLUMNS = 16, 18

VALUES = """async (name) => {
  const { ReelFile } = await import("meshreel");
  const reel = await ReelFile.open("/flag.reel");
  const track = reel.track(name);
  const frames = [];
  const numberOf = (one) => (Number.isNaN(one) ? null : Number(one));
  for (let i = 0; i < reel.info.nFrames; i++) {
    frames.push(Array.from(await track.frame(i), numberOf));
  }
  reel.close();
  return { frames, info: track.info };
}"""


OF_VALUES = """async () => {
  const { ReelLoader } = await import("meshreel/three");
  const mesh = await new ReelLoader(undefined, { gpu: false }).loadAsync("/flag.reel");
  const off = {};
  for (const name of ["stress", "heat", "holes", "part", "paint", "speed"]) {
    await mesh.colorBy(name);
    mesh.seek({ frame: 17 });
    while (mesh.isWaiting) await new Promise((resolve) => setTimeout(resolve, 5));
    const found = mesh.colorAttribute(await mesh.reel.track(name).frame(17));
    const { array } = mesh.geometry.getAttribute(found.name);
    if (array.length !== found.values.length) throw new Error(`${array.length} numbers`);
    off[name] = Math.max(...found.values.map((one, i) => Math.abs(one - array[i])));
  }
  await mesh.colorBy("speed");
  off.refused = [];
  const refuse = (values) => {
    try { mesh.colorAttribute(values); } catch ({ message }) { off.refused.push(message); }
  };
  refuse(new Float32Array(5));
  await mesh.colorBy(null);
  refuse(new Float32Array(5));
  return off;
}"""


@pytest.fixture(scope="module")
def stream():
    """A flag of three blocks, with tracks of all kinds: bounded, exact, with missing values."""
    flag = meshreel.simulate_flag(36, n_rows=N_ROWS, n_columns=N_COLUMNS)
    vertices = flag.vertices.astype(np.float64)
    times = np.arange(36)[:, None]
    phase = 3 * vertices[..., 0] - 2 * vertices[..., 2] + 0.2 * times
    middles = vertices[:, flag.faces].mean(axis=2)
    single = np.float32
    paint = np.stack([0.5 + 0.5 * np.sin(phase / k) for k in (1, 2, 3)], axis=-1)
    holes = np.where(np.sin(2 * phase) < -0.5, np.nan, phase)
    tracks = {
        "stress": Track((2e6 * np.sin(phase)).astype(single), unit="Pa"),
        "heat": Track((300 + 20 * middles[..., 2]).astype(single), domain="face", unit="K"),
        "part": (3 * vertices[..., 0] + 0.3 * times).astype(np.int64),
        "holes": Track(holes.astype(single)),
        "paint": Track((255 * paint).astype(np.uint8), kind="color"),
        "tint": Track(paint.astype(single), kind="color"),
        "speed": Track(np.gradient(vertices, axis=0).astype(single), kind="vector", unit="m/s"),
    }
    sequence = meshreel.MeshSequence(flag.vertices, flag.faces, fps=24, tracks=tracks)
    return meshreel.encode(sequence, quality=90, block_frames=12)


@pytest.fixture(scope="module")
def decoded(stream):
    """Values of each track, of shape (T, N, C)."""
    return {name: track.values for name, track in meshreel.decode(stream).tracks.items()}


@pytest.fixture
def page(three_page, stream):
    return three_page({"/flag.reel": stream})


def test_values_and_descriptions_match_python(page, decoded):
    for name, values in decoded.items():
        answer = page.evaluate(VALUES, name)
        result = np.array(answer["frames"], values.dtype).reshape(values.shape)
        assert result.tobytes() == values.tobytes()
        assert answer["info"]["nItems"] == values.shape[1]
        assert (answer["info"]["errorBound"] > 0) is not answer["info"]["isExact"]
    assert answer["info"]["kind"] == "vector"
    assert answer["info"]["unit"] == "m/s"


def test_range_of_a_track_of_colors_is_refused(page):
    refused = """async () => {
      const { ReelLoader } = await import("meshreel/three");
      const mesh = await new ReelLoader(undefined, { gpu: false }).loadAsync("/flag.reel");
      return mesh.colorBy("paint", { range: [0, 1] }).catch(({ message }) => message);
    }"""
    assert "consists of colors, to which range does not apply" in page.evaluate(refused)


def test_color_values_matches_the_colors_of_the_mesh(page):
    result = page.evaluate(OF_VALUES)
    refused = result.pop("refused")
    assert max(result.values()) < 2e-3, result
    assert "values must have 288 x 3 numbers; got 5" in refused[0]
    assert "call colorBy first" in refused[1]
