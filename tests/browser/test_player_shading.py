"""The renderer of <reel-player> draws materials as three.js does."""

import io

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.model.materials import AlphaMode, Material, Texture
from meshreel.model.materials import Image as FileImage
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.rendering.colormap import colorize
from meshreel.rendering.studio import studio_light
from samples.element_pages import until
from samples.web_package import THREE_PAGE, serving, three_files

pytestmark = pytest.mark.slow

SIZE = 320
ALLOWED_MEAN = 4.5  # of 255; most on the metal, since the player approximates how gloss blurs
ALLOWED = 50
"""Largest difference, in 255: of a pixel at an edge, whose samples may differ."""

ENVIRONMENT_SIZE = 512, 256

HTML = f"""{THREE_PAGE}<style>
body {{ margin: 0; background: white }}
reel-player, canvas {{ display: block; width: {SIZE}px; height: {SIZE}px }}</style>
<reel-player src="/sheet.reel" camera-orbit="20deg 60deg auto" background="white"></reel-player>
<script type="module" src="/page.js"></script>"""

SCRIPT = """
import * as THREE from "three";
import { ReelLoader } from "meshreel/three";
import "/dist/player.js";

const player = (window.player = document.querySelector("reel-player"));
await new Promise((resolve) => player.addEventListener("load", resolve));

const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
renderer.setSize(player.clientWidth, player.clientHeight);
renderer.toneMapping = THREE.NeutralToneMapping;
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(player.getFieldOfView(), 1);
const { theta, phi, radius } = player.getCameraOrbit();
const { x, y, z } = player.getCameraTarget();
const target = new THREE.Vector3(x, y, z);
camera.position.setFromSphericalCoords(radius, phi, theta).add(target);
camera.lookAt(target);
camera.updateMatrixWorld();
const pixels = new Uint16Array(await (await fetch("/studio.bin")).arrayBuffer());
const studio = new THREE.DataTexture(pixels, SIZE, THREE.RGBAFormat, THREE.HalfFloatType);
studio.mapping = THREE.EquirectangularReflectionMapping;
studio.minFilter = studio.magFilter = THREE.LinearFilter;
studio.needsUpdate = true;
scene.environment = studio; // in the axes of the camera, so that the model moves instead
const mesh = await new ReelLoader().loadAsync("/sheet.reel");
mesh.material[6].toneMapped = false; // as glTF defines unlit materials
const model = new THREE.Group();
model.applyMatrix4(camera.matrixWorld.clone().invert());
scene.add(model.add(mesh));
const eye = new THREE.PerspectiveCamera(player.getFieldOfView(), 1, 0.01, 100);
mesh.setRenderer(renderer);
renderer.setAnimationLoop(() => {
  mesh.update(0);
  renderer.render(scene, eye);
});
const isShown = (one) => !one.isWaiting && one.geometry.drawRange.count > 0;
const hasImages = ({ material: [, tiles, bumps, mixed, glow, , flat] }) =>
  tiles.map && bumps.normalMap && mixed.aoMap && glow.emissiveMap && flat.map;
window.isReady = () => [mesh, player.mesh].every((one) => isShown(one) && hasImages(one));
"""


def png(pixels):
    stored = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(stored, "png")
    return stored.getvalue()


def sheet():
    """A wavy sheet in stripes, each of another material."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, 43), np.linspace(0, 1, 31)))
    z = 0.06 * np.sin(9 * x) * np.cos(8 * y)
    corner = np.arange(43 * 31).reshape(31, 43)[:-1, :-1].ravel()
    first, second = [corner, corner + 1, corner + 44], [corner, corner + 44, corner + 43]
    faces = np.concatenate([np.stack(three, -1) for three in (first, second)])
    row, column = np.mgrid[0:64, 0:64]
    tiles = 150 * ((row // 8 + column // 8) % 2) + 60
    tilt = np.stack([np.sin(row / 5), np.cos(column / 5), 0 * row + 2.0], -1)
    normals = 127.5 * (tilt / np.linalg.norm(tilt, axis=-1, keepdims=True) + 1)
    images = [np.stack([tiles, 255 - tiles, 0 * row + 90], -1), normals,
              np.stack([4 * row, 4 * column, tiles], -1)]  # fmt: skip
    color, bumps = Texture(0), Texture(1)
    red, green, blue = (Texture(2, channels=one) for one in "rgb")
    plain = {"double_sided": True, "metallic": 0.0}
    materials = (
        Material("gold", (1, 0.8, 0.3, 1), roughness=0.3, double_sided=True),
        Material("tiles", roughness=0.4, base_color_texture=color, **plain),
        Material("bumps", (0.5, 0.6, 0.8, 1), roughness=0.5, normal_texture=bumps, **plain),
        Material("mixed", metallic_texture=blue, roughness_texture=green, occlusion_texture=red,
                 **plain),
        Material("glow", (0.1, 0.1, 0.1, 1), emissive=(1, 0.5, 0), emissive_texture=color, **plain),
        Material("glass", (0.2, 0.4, 1, 0.4), alpha_mode=AlphaMode.BLEND, **plain),
        Material("flat", unlit=True, base_color_texture=color, **plain),
    )  # fmt: skip
    stripe = np.minimum(7 * x[faces[:, 0]], 6).astype(np.int32)
    surface = Surface(
        attributes=(Attribute("uv", Kind.UV, Domain.VERTEX, np.stack([3 * x, 3 * y], -1)),),
        groups=(FaceGroups("material", tuple(material.name for material in materials), stripe),),
        materials=materials,
        images=tuple(FileImage("", "image/png", png(pixels)) for pixels in images),
    )
    frames = [np.stack([x, y, height * z], -1) for height in (1, 1.2)]
    return meshreel.MeshSequence(np.stack(frames).astype(np.float32), faces, surface=surface)


def environment():
    """The studio of pictures as an equirectangular map of half floats."""
    width, height = ENVIRONMENT_SIZE
    turn, up = np.meshgrid(
        (np.arange(width) + 0.5) / width * 2 * np.pi - np.pi,
        (np.arange(height) + 0.5) / height * np.pi - np.pi / 2,
    )
    x, y, z = np.cos(up) * np.cos(turn), np.sin(up), np.cos(up) * np.sin(turn)
    light = studio_light(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), 0)
    return np.stack([light, light, light, np.ones_like(light)], -1).astype(np.float16).tobytes()


def test_materials_look_as_in_three_js(new_page):
    files = {
        **three_files(HTML),
        "/page.js": SCRIPT.replace("SIZE", "{}, {}".format(*ENVIRONMENT_SIZE)).encode(),
        "/studio.bin": environment(),
        "/sheet.reel": meshreel.encode(sheet(), max_error=0.01, effort=3),
    }
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", is_shown=False, height=700)
        until(page, "window.isReady?.()")
        page.wait_for_timeout(1000)
        shots = [page.locator(name).screenshot() for name in ("reel-player", "body > canvas")]
    ours, theirs = (np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), int) for shot in shots)
    difference = np.abs(ours - theirs).max(axis=2)
    assert (ours.min(axis=2) < 240).mean() > 0.1  # it is drawn
    assert difference.mean() < ALLOWED_MEAN
    assert np.quantile(difference, 0.999) < ALLOWED


def test_colors_of_values_match_the_legend_on_any_material(new_page):
    """Three stripes that face the camera, of a metal and in the light of the studio."""
    x = np.array([0, 1, 2, 3], np.float32)
    corners = np.concatenate([np.stack([x, 0 * x + y, 0 * x], -1) for y in (0, 2)])
    left = np.arange(3)
    triangles = [[left, left + 1, left + 5], [left, left + 5, left + 4]]
    faces = np.concatenate([np.stack(three, -1) for three in triangles]).astype(np.int32)
    material = Material("metal", (0.9, 0.3, 0.1, 1), roughness=0.2, double_sided=True)
    groups = FaceGroups("material", ("metal",), np.zeros(6, np.int32))
    values = np.array([0, 0.5, 1] * 2, np.float32)
    track = meshreel.Track(values[None], domain="face")
    sequence = meshreel.MeshSequence(
        corners[None], faces, surface=Surface(groups=(groups,), materials=(material,)),
        tracks={"value": track},
    )  # fmt: skip
    html = HTML.replace("20deg 60deg", "0deg 90deg").replace(
        "<reel-player", '<reel-player track="value" range="0:1"'
    )
    script = 'import "/dist/player.js"; window.player = document.querySelector("reel-player");'
    files = {**three_files(html), "/page.js": script.encode()}
    files["/sheet.reel"] = meshreel.encode(sequence)
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", is_shown=False)
        until(page, "player.mesh && player.shadowRoot.querySelector('.legend:not([hidden])')")
        page.wait_for_timeout(500)
        shot = page.locator("reel-player").screenshot()
    pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), int).reshape(-1, 3)
    for expected in colorize([0, 0.5, 1], 0, 1).astype(int):
        assert (np.abs(pixels - expected).max(axis=1) <= 2).mean() > 0.1
