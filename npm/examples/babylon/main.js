import { ArcRotateCamera } from "@babylonjs/core/Cameras/arcRotateCamera";
import { Engine } from "@babylonjs/core/Engines/engine";
import { HemisphericLight } from "@babylonjs/core/Lights/hemisphericLight";
import { Material } from "@babylonjs/core/Materials/material";
import { StandardMaterial } from "@babylonjs/core/Materials/standardMaterial";
import { Color3, Color4 } from "@babylonjs/core/Maths/math.color";
import { Vector3 } from "@babylonjs/core/Maths/math.vector";
import { Mesh } from "@babylonjs/core/Meshes/mesh";
import { VertexData } from "@babylonjs/core/Meshes/mesh.vertexData";
import { Scene } from "@babylonjs/core/scene";
import { ReelFile } from "meshreel";

const engine = new Engine(document.querySelector("canvas"), true);
const scene = new Scene(engine);
scene.useRightHandedSystem = true; // as in most file formats
scene.clearColor = new Color4(0.87, 0.89, 0.92, 1);
new HemisphericLight("light", new Vector3(0.3, 1, 1), scene);

const reel = await ReelFile.open("flag.reel");
const { nFrames, nVerts, center, diagonal } = reel.info;
const fps = reel.info.fps || 24;
const distance = 1.5 * diagonal * Math.max(1, innerHeight / innerWidth);
const camera = new ArcRotateCamera(
  "camera", Math.PI / 2, Math.PI / 2, distance, new Vector3(...center), scene,
);
camera.minZ = diagonal / 100;
camera.attachControl();

const mesh = new Mesh("flag", scene);
mesh.sideOrientation = Material.CounterClockWiseSideOrientation; // as in glTF
mesh.material = new StandardMaterial("cloth", scene);
mesh.material.diffuseColor = new Color3(0.6, 0.68, 0.75);
mesh.material.specularColor = new Color3(0.1, 0.1, 0.1);
mesh.material.backFaceCulling = false;
mesh.material.twoSidedLighting = true;

const indices = reel.surface.triangles;
const positions = new Float32Array(3 * nVerts);
const normals = new Float32Array(3 * nVerts);

async function decode(frame) {
  positions.set(await reel.frame(frame)); // converts float64 files
  VertexData.ComputeNormals(positions, indices, normals, { useRightHandedSystem: true });
  mesh.metadata = { frame };
}

await decode(0);
Object.assign(new VertexData(), { positions, normals, indices }).applyToMesh(mesh, true);
mesh.alwaysSelectAsActiveMesh = true; // its bounds are those of the first frame only

let isDecoding = false;
const began = performance.now();
scene.onBeforeRenderObservable.add(async () => {
  const frame = Math.floor(((performance.now() - began) / 1000) * fps) % nFrames;
  if (isDecoding || frame === mesh.metadata.frame) return;
  isDecoding = true;
  await decode(frame);
  mesh.updateVerticesData("position", positions);
  mesh.updateVerticesData("normal", normals);
  isDecoding = false;
});
engine.runRenderLoop(() => scene.render());
addEventListener("resize", () => engine.resize());
window.mesh = mesh; // to try it from the console
