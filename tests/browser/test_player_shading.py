"""The renderer of <reel-player> draws materials as three.js does."""

import io

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.model.materials import AlphaMode, Material, Texture
from meshreel.model.materials import Image as FileImage
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from samples.element_pages import until
from samples.web_package import THREE_PAGE, serving, three_files

pytestmark = pytest.mark.slow

SIZE = 320
ALLOWED_MEAN = 1  # of 255
ALLOWED = 40
"""Largest difference, in 255: of a pixel at an edge, whose samples may differ."""

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
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(player.getFieldOfView(), 1);
const { theta, phi, radius } = player.getCameraOrbit();
const { x, y, z } = player.getCameraTarget();
const target = new THREE.Vector3(x, y, z);
camera.position.setFromSphericalCoords(radius, phi, theta).add(target);
camera.lookAt(target);
const sky = 0.32 * Math.PI;
const key = new THREE.DirectionalLight(0xffffff, 0.75 * Math.PI);
key.position.set(-1.2, 1.4, 2);
const rim = new THREE.DirectionalLight(0xffffff, sky);
rim.position.set(1.6, 0.6, -0.8);
camera.add(key, key.target, rim, rim.target);
scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, sky));
const mesh = await new ReelLoader().loadAsync("/sheet.reel");
scene.add(camera, mesh);
mesh.setRenderer(renderer);
renderer.setAnimationLoop(() => {
  mesh.update(0);
  renderer.render(scene, camera);
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
    """A wavy sheet in stripes, each of another material, but no metals."""
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
        Material("gold", (1, 0.8, 0.3, 1), roughness=0.3, **plain),
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


def test_materials_look_as_in_three_js(new_page):
    files = {
        **three_files(HTML),
        "/page.js": SCRIPT.encode(),
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
