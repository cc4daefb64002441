"""PCA textures as the shaders of `integrations/pca-textures` play them, number by number.

three.js and Godot draw in a browser. HLSL is translated to the language of WebGL, and runs there.
"""

import base64
import io
import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.formats.options import WriteOptions
from meshreel.formats.save import save
from meshreel.formats.vat.pca.texture import read_header, section_offsets, texel_coordinates
from meshreel.formats.vat.textures import read_texture
from meshreel.model.geometry.normals import vertex_normals
from samples.web_package import PACKAGE, ROOT, built_package, serving

pytest.importorskip("imagecodecs")
FOLDER = Path(__file__).parent / "pca_textures"
SHADERS = ROOT / "integrations" / "pca-textures"
GODOT = Path(os.environ.get("MESHREEL_GODOT", "none"))
"""A folder with index.js and index.wasm of Godot 4 for web pages."""

N_FRAMES, FRAMES = 36, (0.0, 35.0, 12.25)
ROUNDING = 1e-6
"""Tolerance of float32, in lengths of the flag."""

PAGE = b"""<!doctype html><title>pca</title><link rel="icon" href="data:,">
<script type="importmap">{"imports": {"three": "/three/three.module.js",
"three/addons/": "/addons/"}}</script><script type="module" src="/read_back.js"></script>"""
GODOT_PAGE = b"""<!doctype html><title>godot</title><link rel="icon" href="data:,">
<canvas id="canvas" width="64" height="64"></canvas><script src="/index.js"></script><script>
window.told = {};
new Engine({ executable: "/index", mainPack: "/game.zip", args: [], canvasResizePolicy: 0,
  fileSizes: {}, focusCanvas: false, gdextensionLibs: [] }).startGame();
</script>"""
ADDONS = ("loaders/GLTFLoader.js", "utils/BufferGeometryUtils.js", "utils/SkeletonUtils.js")
READING = """
	seen = what == 0 ? VERTEX : NORMAL;
	vec2 pixel = vec2(float(VERTEX_ID % int(size.x)), float(VERTEX_ID / int(size.x))) + 0.5;
	POSITION = vec4(2.0 * pixel / size - 1.0, 0.5, 1.0);
	POINT_SIZE = 1.0;
}
void fragment() {
	ALBEDO = vec3((floatBitsToUint(seen) >> uvec3(uint(bit))) & uvec3(1u));
}
"""
"""Replaces the end of the Godot shader: draws one bit of each vertex as a pixel."""


class Written:
    """A folder of textures written by the command, and the values that it plays."""

    def __init__(self, folder):
        self._sequence = sequence = meshreel.simulate_flag(N_FRAMES, n_rows=16, n_columns=18)
        files = save(sequence, folder, options=WriteOptions(layout="pca", max_error=0.1))
        self.mesh, self.texture, self.data = files
        self.texels = read_texture(self.texture)
        self.n_verts = sequence.n_verts
        self.rest = meshreel.load(self.mesh).vertices[0]
        header = read_header(self.texels)
        self._positions, self._normals = (
            section_offsets(self.texels, header, one, self.n_verts)
            for one in (header.positions, header.normals)
        )

    def moved(self, number):
        """Positions between two frames, of shape (V, 3)."""
        return self.rest + self._between(self._positions, number)

    def turned(self, number, rest_normals):
        """Unit normals between two frames."""
        found = rest_normals + self._between(self._normals, number)
        return found / np.linalg.norm(found, axis=1, keepdims=True)

    def mean_angle_deg(self, normals, number):
        """Angle between played and original normals, at a frame or between two."""
        first, second = (self._sequence.vertices[(int(number) + k) % N_FRAMES] for k in (0, 1))
        own = (1 - number % 1) * first + number % 1 * second
        cosines = (normals * vertex_normals(own, self._sequence.faces)).sum(axis=1)
        return np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean()

    @staticmethod
    def _between(offsets, number):
        first, part = int(number), number % 1
        return (1 - part) * offsets.frame(first) + part * offsets.frame((first + 1) % N_FRAMES)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return Written(tmp_path_factory.mktemp("pca") / "walk.vat")


@pytest.fixture(scope="module")
def site(written):
    built_package()
    three = PACKAGE / "node_modules" / "three"
    files = {
        "/index.html": PAGE,
        "/read_back.js": (FOLDER / "read_back.js").read_bytes(),
        "/meshreel_pca.js": (SHADERS / "meshreel_pca.js").read_bytes(),
        "/walk.glb": written.mesh.read_bytes(),
        "/walk.png": written.texture.read_bytes(),
        **{f"/three/{one.name}": one.read_bytes() for one in (three / "build").glob("three*.js")},
        **{f"/addons/{one}": (three / "examples" / "jsm" / one).read_bytes() for one in ADDONS},
    }
    with serving(files) as (url, _):
        yield url


@pytest.fixture
def ask(new_page, site):
    def answer(script, given):
        page = new_page(f"{site}/index.html", is_shown=False)
        page.wait_for_function("window.isReady")
        return page.evaluate(script, given)

    return answer


@pytest.mark.slow
def test_three_js_plays_vertices_and_normals_like_python(ask, written):
    found = ask("(frames) => readThree(frames)", FRAMES)
    seen = [np.reshape(one, (-1, 4))[:, :3] for one in found]
    for number, positions in zip(FRAMES, seen[::2], strict=True):
        np.testing.assert_allclose(positions, written.moved(number), atol=ROUNDING)
    for number, normals in zip(FRAMES, seen[1::2], strict=True):
        assert written.mean_angle_deg(normals, number) < 4


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("glslangValidator") and shutil.which("spirv-cross")),
    reason="needs glslangValidator and spirv-cross",
)
@pytest.mark.parametrize("engine", ["unity", "unreal"])
def test_hlsl_plays_vertices_like_python(ask, written, tmp_path, engine):
    rest = written.rest.copy()
    places = texel_coordinates(written.texels, written.n_verts).astype(float)
    mirror = np.array([-1, 1, 1]) if engine == "unity" else np.ones(3)
    if engine == "unity":
        places[:, 1] = 1 - places[:, 1]
    found = ask(
        "(given) => readShader(given)",
        {
            "source": translated(FOLDER / f"{engine}.hlsl", tmp_path),
            "attributes": {
                "position": (mirror * rest).ravel().tolist(),
                "normal": np.tile([0.0, 0.0, 1.0], len(rest)).tolist(),
                "uv": places.ravel().tolist(),
            },
            "outputs": ["_entryPointOutput_position", "_entryPointOutput_normal"],
            "frames": FRAMES,
            "n": len(rest),
        },
    )
    normals_at_rest = np.tile([0.0, 0.0, 1.0], (len(rest), 1))
    for number, values in zip(FRAMES, found, strict=True):
        positions, normals = np.reshape(values, (-1, 2, 3)).transpose(1, 0, 2) * mirror
        np.testing.assert_allclose(positions, written.moved(number), atol=ROUNDING)
        expected = written.turned(number, normals_at_rest)
        np.testing.assert_allclose(normals, expected, atol=10 * ROUNDING)


@pytest.mark.slow
@pytest.mark.skipif(not GODOT.is_dir(), reason="needs Godot for web pages (MESHREEL_GODOT)")
def test_godot_plays_vertices_like_python(browser, written):
    with serving(godot_files(written)) as (url, _):
        page = browser.new_page()
        page.goto(f"{url}/index.html")
        page.wait_for_function("window.told.done", timeout=120_000)
        told = page.evaluate("told")
        page.close()
    rest, places = (numbers_of(told[name], size) for name, size in (("rest", 3), ("places", 2)))
    column, row = np.rint(places).astype(int).T
    verts = row * written.texels.shape[1] + column
    assert sorted(verts) == list(range(written.n_verts))
    for number in FRAMES:
        moved = written.moved(number)[verts] - written.rest[verts]
        # Godot rounds the rest mesh on import; the displacements of the shader are exact.
        found = floats_of_bits(told[f"{number} 0"])[: len(rest)]
        np.testing.assert_allclose(found, rest + moved, atol=ROUNDING)
    np.testing.assert_allclose(rest, written.rest[verts], atol=1e-4)


def godot_files(written):
    """Return the files of a Godot project that reads back the output of the shader."""
    code = (SHADERS / "meshreel_pca.gdshader").read_text()
    reading = "uniform int what; uniform int bit; uniform vec2 size; varying flat vec3 seen;"
    head, _, _ = code.replace(
        "shader_type spatial;", f"shader_type spatial;\nrender_mode unshaded;\n{reading}"
    ).partition("void fragment()")
    project = io.BytesIO()
    with zipfile.ZipFile(project, "w") as file:
        for name in ("main.gd", "main.tscn", "project.godot"):
            file.write(FOLDER / name, name)
        file.write(written.texture, "walk.png")
        file.write(written.mesh, "walk.glb")
        file.writestr("reading.gdshader", head.rstrip().removesuffix("}") + READING)
        file.writestr("frames.json", json.dumps(FRAMES))
    program = {f"/{one.name}": one.read_bytes() for one in GODOT.glob("index.*")}
    return {**program, "/index.html": GODOT_PAGE, "/game.zip": project.getvalue()}


def numbers_of(text, size):
    return np.frombuffer(base64.b64decode(text), np.float32).reshape(-1, size)


def floats_of_bits(text):
    """Numbers of shape (pixels, 3), of 32 pictures each of which shows a bit of them."""
    shown = np.frombuffer(base64.b64decode(text), np.uint8).reshape(32, -1, 3) > 127
    places = np.arange(32, dtype=np.uint32)[:, None, None]
    return (shown.astype(np.uint32) << places).sum(axis=0, dtype=np.uint32).view(np.float32)


def translated(path, folder):
    """A vertex shader of HLSL in the language of WebGL 2.

    Not optimized: what glslang 12 makes of the loops then leaves them after their first pass.
    """
    for shader in SHADERS.glob("*.hlsl"):
        plain = shader.read_text().replace("UnityTexture2D Tex", "Texture2D<float4> Tex")
        (folder / shader.name).write_text(plain.replace("Tex.tex", "Tex"))
    compiled = folder / "shader.spv"
    options = ["-D", "-Od", "-V", "-S", "vert", "-e", "main", f"-I{folder}", "-o", compiled]
    compile_it = ["glslangValidator", *options, path]
    done = subprocess.run(compile_it, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    translate = ["spirv-cross", "--es", "--version", "300", compiled]
    return subprocess.run(translate, capture_output=True, text=True, check=True).stdout
