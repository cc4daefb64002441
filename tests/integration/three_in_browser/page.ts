// Functions of a page that tests of `meshreel/three` call; results are plain numbers.

import * as THREE from "three";
import { WebGPURenderer } from "three/webgpu";

import { SegmentedReelFile } from "../../../npm/src/index";
import { ReelLoader, ReelMesh, type ReelMeshOptions } from "../../../npm/src/three/index";
import { asSegments } from "../../../npm/src/three/mesh_segment";
import type { ColorOptions } from "../../../npm/src/three/index";
import { createItemLookup } from "../../../npm/src/three/corners";
import { type GridOptions, truth, wavingGrid } from "./waving_grid";

let shownStand: Stand | null = null;

/** A new canvas with a scene; the page shows one at a time. */
class Stand {
  readonly canvas = document.createElement("canvas");
  readonly renderer = new THREE.WebGLRenderer({
    canvas: this.canvas,
    preserveDrawingBuffer: true,
  });
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(40, 4 / 3, 0.1, 100);
  readonly complaints: string[] = [];
  private picture: Uint8Array | null = null; // pixels of the last drawing, if requested
  private readonly said = { error: console.error, warn: console.warn };

  constructor() {
    shownStand?.dispose();
    shownStand = this;
    document.body.replaceChildren(this.canvas);
    this.renderer.setSize(640, 480, false);
    this.scene.background = new THREE.Color(0xdde3ea);
    this.camera.position.set(1.5, -4, 5);
    this.camera.up.set(0, 0, 1);
    this.camera.lookAt(0, 0, -0.4);
    this.camera.updateMatrixWorld();
    const { error, warn } = this.said;
    console.error = (...words) => error(...this.complain(words));
    console.warn = (...words) => warn(...this.complain(words));
  }

  /** Release the context, because browsers limit their number, and restore the console. */
  private dispose(): void {
    Object.assign(console, this.said);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private complain(words: unknown[]): unknown[] {
    this.complaints.push(words.join(" "));
    return words;
  }

  draw(): void {
    this.renderer.render(this.scene, this.camera);
    this.picture = null;
  }

  /** A color of the picture, 0..255; x and y are 0..1, from the lower left. */
  pixel(x: number, y: number): number[] {
    if (!this.picture) {
      const gl = this.renderer.getContext();
      this.picture = new Uint8Array(4 * 640 * 480);
      gl.readPixels(0, 0, 640, 480, gl.RGBA, gl.UNSIGNED_BYTE, this.picture);
    }
    const at = 4 * (640 * Math.floor(y * 480) + Math.floor(x * 640));
    return [...this.picture.slice(at, at + 3)];
  }

  /** Return the place of a point of the scene in the picture, 0..1 from the lower left. */
  project(x: number, y: number, z: number): [number, number] {
    const place = new THREE.Vector3(x, y, z).project(this.camera);
    return [(place.x + 1) / 2, (place.y + 1) / 2];
  }
}

type Events = { type: string; [more: string]: unknown }[];

function record(mesh: ReelMesh): Events {
  const events: Events = [];
  for (const type of ["frame", "loop", "ended", "waiting", "playing", "error"] as const) {
    mesh.addEventListener(type, (event) => {
      const { target: _, ...rest } = event as { type: string; target: unknown };
      events.push(rest);
    });
  }
  return events;
}

/** Wait until a picture is drawn. */
async function shown(mesh: ReelMesh): Promise<void> {
  while (mesh.isWaiting) await new Promise((resolve) => setTimeout(resolve, 5));
}

/** Return the numbers of an attribute of materials, from a WebGL buffer or from memory. */
function drawnValues(stand: Stand, mesh: ReelMesh, name: "position" | "normal"): Float32Array {
  const attribute = mesh.geometry.getAttribute(name) as unknown as
    | THREE.GLBufferAttribute
    | THREE.BufferAttribute;
  if (!("buffer" in attribute)) return attribute.array as Float32Array;
  const gl = stand.renderer.getContext() as WebGL2RenderingContext;
  const found = new Float32Array(3 * attribute.count);
  gl.bindBuffer(gl.ARRAY_BUFFER, attribute.buffer);
  gl.getBufferSubData(gl.ARRAY_BUFFER, 0, found);
  gl.bindBuffer(gl.ARRAY_BUFFER, null);
  return found;
}

/** Compute the normal of each vertex from its faces, in plain loops. */
function trueNormals(positions: Float64Array, triangles: Uint32Array): THREE.Vector3[] {
  const at = (vertex: number) => new THREE.Vector3().fromArray(positions, 3 * vertex);
  const sums = Array.from({ length: positions.length / 3 }, () => new THREE.Vector3());
  for (let i = 0; i < triangles.length; i += 3) {
    const corners = [...triangles.slice(i, i + 3)];
    const [a, b, c] = corners.map(at);
    const normal = b.sub(a).cross(c.sub(a));
    for (const corner of corners) sums[corner].add(normal);
  }
  return sums.map((sum) => sum.normalize());
}

/** Return the largest errors at a time: of positions in diagonals, and of normals. */
function errorsAt(stand: Stand, mesh: ReelMesh, place: number, origin = [0, 0, 0]) {
  const { info, surface } = mesh.reel;
  const expected = truth(place, info.center).map((one, i) => one - origin[i % 3]);
  const normals = trueNormals(expected, surface.triangles);
  const [drawn, drawnNormals] = [
    drawnValues(stand, mesh, "position"),
    drawnValues(stand, mesh, "normal"),
  ];
  let [position, normal, read] = [0, 0, 0];
  mesh.sources.forEach((source, i) => {
    const right = new THREE.Vector3().fromArray([...expected.slice(3 * source, 3 * source + 3)]);
    position = Math.max(position, right.distanceTo(new THREE.Vector3().fromArray(drawn, 3 * i)));
    const given = new THREE.Vector3().fromArray(drawnNormals, 3 * i);
    normal = Math.max(normal, normals[source].distanceTo(given));
    read = Math.max(read, right.distanceTo(mesh.getVertexPosition(i, new THREE.Vector3())));
  });
  return { position: position / info.diagonal, normal, read: read / info.diagonal };
}

async function made(stand: Stand, grid: GridOptions, options: ReelMeshOptions = {}) {
  const mesh = new ReelMesh(await wavingGrid(grid), { renderer: stand.renderer, ...options });
  stand.scene.add(mesh);
  await shown(mesh);
  return mesh;
}

function removed(mesh: ReelMesh): void {
  mesh.removeFromParent();
  mesh.dispose();
}

/** Return the shown value of each item of a track at a time. */
async function trackTruth(mesh: ReelMesh, name: string, place: number, component: unknown) {
  const track = mesh.reel.track(name);
  const { nColumns, nItems } = track.info;
  const [here, there] = [
    await track.frame(Math.floor(place)),
    await track.frame(Math.min(Math.ceil(place), mesh.reel.info.nFrames - 1)),
  ];
  return Float64Array.from({ length: nItems }, (_, item) => {
    const value = Array.from({ length: nColumns }, (_, column) => {
      const at = item * nColumns + column;
      return here[at] + (place % 1) * (there[at] - here[at]);
    });
    return component === "magnitude" ? Math.hypot(...value) : value[component as number];
  });
}

/** In pixels; of triangles seen from the side only half a pixel is visible. */
const LEAST_AREA = 60;

/** Colors and values at the center of each clearly visible triangle. */
function middleColors(
  stand: Stand,
  mesh: ReelMesh,
  values: Float64Array,
  domain: "vertex" | "face" | "corner",
  [low, high]: readonly [number, number],
  place: number,
) {
  const { surface } = mesh.reel;
  const itemOf = createItemLookup(surface)(domain);
  const vertices = truth(place);
  const found: { color: number[]; value: number }[] = [];
  const ray = new THREE.Raycaster();
  for (let triangle = 0; 3 * triangle < surface.triangles.length; triangle++) {
    const middle = new THREE.Vector3();
    const seen: [number, number][] = [];
    let value = 0;
    for (let corner = 3 * triangle; corner < 3 * triangle + 3; corner++) {
      const vertex = surface.triangles[corner];
      const [x, y, z] = vertices.slice(3 * vertex, 3 * vertex + 3);
      middle.addScaledVector(new THREE.Vector3(x, y, z), 1 / 3);
      seen.push(stand.project(x, y, z));
      // Values are clamped to the range at each corner.
      const one = values[itemOf(corner)];
      value += (one < low ? low : one > high ? high : one) / 3;
    }
    const [[a, b], [c, d], [e, f]] = seen;
    const area = (640 * 480 * Math.abs((c - a) * (f - b) - (e - a) * (d - b))) / 2;
    if (area < LEAST_AREA) continue;
    ray.setFromCamera(new THREE.Vector2(...middle.clone().project(stand.camera)), stand.camera);
    if (ray.intersectObject(mesh)[0]?.faceIndex !== triangle) continue; // hidden by another
    found.push({ color: stand.pixel(...stand.project(middle.x, middle.y, middle.z)), value });
  }
  return found;
}

/** Lose and restore the context; calls `during` in between. */
async function lostContext(stand: Stand, during = () => {}): Promise<void> {
  const extension = stand.renderer.getContext().getExtension("WEBGL_lose_context");
  const told = (type: string) =>
    new Promise((resolve) => stand.canvas.addEventListener(type, resolve, { once: true }));
  const lost = told("webglcontextlost");
  extension?.loseContext();
  await lost;
  during();
  const restored = told("webglcontextrestored");
  await new Promise((resolve) => setTimeout(resolve, 20));
  extension?.restoreContext();
  await restored;
}

/** A floor with a lamp above it that casts shadows. */
function furnish(stand: Stand, light: THREE.DirectionalLight | THREE.PointLight): THREE.Mesh {
  stand.renderer.shadowMap.enabled = true;
  const floor = new THREE.Mesh(
    new THREE.PlaneGeometry(12, 12),
    new THREE.MeshStandardMaterial({ color: 0xcccccc }),
  );
  floor.position.z = -1.2;
  floor.receiveShadow = true;
  light.position.set(-1, 1, 6);
  light.castShadow = true;
  light.shadow.mapSize.set(1024, 1024);
  light.shadow.camera.far = 20;
  light.shadow.bias = -0.002;
  stand.scene.add(floor, light, new THREE.AmbientLight(0xffffff, 0.6));
  return floor;
}

const tests = {
  /** Return errors at times; `path` selects how positions are computed. */
  async errors(places: number[], options: ReelMeshOptions, grid: GridOptions = {}) {
    const stand = new Stand();
    const mesh = await made(stand, grid, options);
    const found = [];
    for (const place of places) {
      mesh.seek({ frame: place });
      await shown(mesh);
      stand.draw();
      found.push(errorsAt(stand, mesh, place, options.origin as number[] | undefined));
    }
    const { isOnGpu } = mesh;
    removed(mesh);
    return { isOnGpu, found, complaints: stand.complaints };
  },

  /** Colors in the shadow, with and without the mesh casting it. */
  async shadow(isPoint: boolean) {
    const stand = new Stand();
    const light = isPoint
      ? new THREE.PointLight(0xffffff, 120)
      : new THREE.DirectionalLight(0xffffff, 3);
    furnish(stand, light);
    const mesh = await made(stand, {});
    // The camera sees the center of the shadow next to the grid, which is lifted.
    mesh.position.z = 1;
    light.position.set(-4, 3, 6);
    const middle = isPoint ? [1.76, -1.32] : [1.47, -1.1];
    const place = stand.project(middle[0], middle[1], -1.2);
    const colors: Record<string, number[]> = {};
    for (const castShadow of [true, false]) {
      mesh.castShadow = castShadow;
      stand.draw();
      colors[castShadow ? "shaded" : "lit"] = stand.pixel(...place);
    }
    removed(mesh);
    return { ...colors, complaints: stand.complaints };
  },

  /** Return the picture. */
  async picture(place: number) {
    const stand = new Stand();
    furnish(stand, new THREE.DirectionalLight(0xffffff, 3));
    const mesh = await made(stand, {});
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.seek({ frame: place });
    await shown(mesh);
    const image = () => (mesh.material as THREE.MeshStandardMaterial[])[0].map;
    while (!image()) await new Promise((resolve) => setTimeout(resolve, 5));
    stand.draw();
    const [vertices, color] = [truth(place), (vertex: number) => {
      const [x, y, z] = vertices.slice(3 * vertex, 3 * vertex + 3);
      return stand.pixel(...stand.project(x, y, z));
    }];
    const row = (number: number, column: number) => color(24 * number + column);
    return {
      top: row(14, 9),
      left: row(9, 1),
      hem: row(2, 12),
      plain: row(5, 12),
      complaints: stand.complaints,
    };
  },

  /** Colors of the mesh with another material, and of lines over it. */
  async otherMaterials() {
    const stand = new Stand();
    stand.scene.overrideMaterial = new THREE.MeshBasicMaterial({ color: 0xff0000 });
    const mesh = await made(stand, { isPlain: true });
    mesh.seek({ frame: 8.5 });
    await shown(mesh);
    const vertices = truth(8.5);
    const [x, y, z] = vertices.slice(3 * 200, 3 * 200 + 3);
    const corner = stand.project(x, y, z);
    stand.draw();
    const overridden = stand.pixel(...corner);
    stand.scene.overrideMaterial = null;
    const raw = new THREE.RawShaderMaterial({
      vertexShader: `uniform mat4 modelViewMatrix, projectionMatrix; attribute vec3 position;
        void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
      fragmentShader: "void main() { gl_FragColor = vec4(0.0, 1.0, 0.0, 1.0); }",
      side: THREE.DoubleSide,
    });
    mesh.material = raw;
    stand.draw();
    const own = stand.pixel(...corner);
    removed(mesh);
    return { overridden, own, complaints: stand.complaints };
  },

  /** A color of the mesh drawn by the WebGPU renderer, with its WebGL 2 backend. */
  async otherRenderer(isGiven: boolean) {
    const stand = new Stand();
    const other = document.body.appendChild(document.createElement("canvas"));
    const renderer = new WebGPURenderer({ canvas: other, forceWebGL: true });
    await renderer.init();
    renderer.setSize(640, 480, false);
    stand.scene.add(new THREE.AmbientLight(0xffffff, 3));
    const red = new THREE.MeshBasicMaterial({ color: 0xff0000, side: THREE.DoubleSide });
    const options = isGiven ? { renderer, material: red } : { material: red };
    const mesh = new ReelMesh(await wavingGrid(), options);
    stand.scene.add(mesh);
    mesh.seek({ frame: 8.5 });
    renderer.render(stand.scene, stand.camera);
    await shown(mesh);
    renderer.render(stand.scene, stand.camera);
    const flat = document.createElement("canvas").getContext("2d") as CanvasRenderingContext2D;
    [flat.canvas.width, flat.canvas.height] = [640, 480];
    flat.drawImage(other, 0, 0);
    const [x, y, z] = truth(8.5).slice(600, 603);
    const [right, up] = stand.project(x, y, z);
    const { data } = flat.getImageData(Math.floor(640 * right), Math.floor(480 * (1 - up)), 1, 1);
    const { isOnGpu } = mesh;
    removed(mesh);
    return { isOnGpu, color: [...data.slice(0, 3)], complaints: stand.complaints };
  },

  /** Return hits of rays from above through the centers of triangles, and their errors. */
  async pick(place: number, options: ReelMeshOptions) {
    const stand = new Stand();
    const mesh = await made(stand, {}, options);
    mesh.position.set(0.5, 0, 2);
    mesh.updateMatrixWorld(true);
    mesh.seek({ frame: place });
    await shown(mesh);
    const vertices = truth(place);
    const { triangles } = mesh.reel.surface;
    const found = [];
    for (const triangle of [0, 77, 230, 689]) {
      const middle = new THREE.Vector3();
      for (const vertex of triangles.slice(3 * triangle, 3 * triangle + 3)) {
        const corner = new THREE.Vector3().fromArray([...vertices], 3 * vertex);
        middle.addScaledVector(corner, 1 / 3);
      }
      middle.add(mesh.position);
      const above = middle.clone().add(new THREE.Vector3(0, 0, 5));
      const hits = new THREE.Raycaster(above, new THREE.Vector3(0, 0, -1)).intersectObject(mesh);
      const [hit] = hits;
      found.push({
        count: hits.length,
        off: hit?.point.distanceTo(middle),
        faceIndex: hit?.faceIndex,
        triangle,
        isMesh: hit?.object === mesh,
        corners: hit?.face && [hit.face.a, hit.face.b, hit.face.c].map((i) => mesh.sources[i]),
        expected: [...triangles.slice(3 * triangle, 3 * triangle + 3)],
        hasUv: hit?.uv !== undefined,
      });
    }
    const away = new THREE.Raycaster(new THREE.Vector3(9, 9, 9), new THREE.Vector3(0, 0, -1));
    const missed = away.intersectObject(mesh).length;
    removed(mesh);
    return { found, missed };
  },

  /** Return the counts of the renderer, first without a mesh, then after each disposal. */
  async disposal(rounds: number) {
    const stand = new Stand();
    const floor = furnish(stand, new THREE.DirectionalLight(0xffffff, 3));
    floor.castShadow = true;
    const { memory, programs } = stand.renderer.info;
    const { alive } = window as unknown as { alive: Record<string, number> };
    const count = () => ({ ...memory, programs: programs?.length, ...alive });
    stand.draw();
    const counts = [];
    for (let round = 0; round < rounds; round++) {
      const mesh = await made(stand, {}, { gpu: round !== 1 });
      mesh.castShadow = mesh.receiveShadow = true;
      await mesh.colorBy("faces");
      await mesh.colorBy("scalar");
      mesh.play();
      for (let i = 0; i < 5; i++) {
        mesh.update(0.6); // passes the end of the file
        stand.draw();
        mesh.raycast(new THREE.Raycaster(), []);
        await new Promise((resolve) => setTimeout(resolve, 1));
      }
      const during = count();
      removed(mesh);
      stand.draw();
      counts.push({ during, after: count() });
    }
    return { counts, complaints: stand.complaints };
  },

  /** Errors before and after the context was lost. */
  async contextLoss() {
    const stand = new Stand();
    const mesh = await made(stand, {});
    mesh.seek({ frame: 7.5 });
    await shown(mesh);
    const before = errorsAt(stand, mesh, 7.5);
    await lostContext(stand, () => {
      mesh.update(0);
      stand.draw();
    });
    await shown(mesh);
    stand.draw();
    const after = errorsAt(stand, mesh, 7.5);
    removed(mesh);
    return { before, after };
  },

  /** Return the events of a file that plays once with a damaged block. */
  async events(damaged: number[]) {
    const stand = new Stand();
    const reel = await wavingGrid({ damaged });
    const { open } = SegmentedReelFile;
    Object.assign(SegmentedReelFile, { open: async () => asSegments(reel) });
    const mesh = await new ReelLoader().loadAsync("grid.reel");
    Object.assign(SegmentedReelFile, { open });
    let isClosed = false;
    reel.close = () => {
      isClosed = true;
    };
    const events = record(mesh);
    stand.scene.add(mesh);
    mesh.loop = false;
    mesh.play();
    const early = { isOnGpu: mesh.isOnGpu, isWaiting: mesh.isWaiting, hits: 0 };
    const ray = new THREE.Raycaster(new THREE.Vector3(0.05, 0.03, 9), new THREE.Vector3(0, 0, -1));
    early.hits = ray.intersectObject(mesh).length;
    for (let i = 0; i < 60 && !events.some((event) => event.type === "ended"); i++) {
      mesh.update(0.05);
      stand.draw();
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
    const hits = ray.intersectObject(mesh).length;
    const last = mesh.frame;
    removed(mesh);
    return {
      early,
      hits,
      last,
      isClosed,
      events: events.map(({ type, frame, block, error }) => ({
        type,
        frame: frame ?? null,
        block: block ?? null,
        error: (error as Error | undefined)?.name ?? null,
      })),
      complaints: stand.complaints,
    };
  },

  /**
   * Return the largest error of colors at times; `isLost`: with a
   * context that was lost before.
   */
  async colors(
    name: string,
    places: number[],
    options: ColorOptions,
    of: ReelMeshOptions = {},
    grid: GridOptions = {},
    isLost = false,
  ) {
    const stand = new Stand();
    const material = new THREE.MeshBasicMaterial({ color: 0x305070, side: THREE.DoubleSide });
    const mesh = await made(stand, { isPlain: true, ...grid }, { material, ...of });
    const nVertices = mesh.sources.length;
    const errors = record(mesh);
    const legend = await mesh.colorBy(name, options);
    const { domain } = mesh.reel.track(name).info;
    const found = [];
    if (isLost) await lostContext(stand);
    for (const place of places) {
      mesh.seek({ frame: place });
      await shown(mesh);
      stand.draw();
      const values = await trackTruth(mesh, name, place, legend.component);
      const colors = middleColors(stand, mesh, values, domain as "vertex", legend.range, place);
      const isGray = (color: number[]) => color.every((one) => Math.abs(one - 128) < 2);
      const numbers = colors.filter(({ value }) => !Number.isNaN(value));
      const off = numbers.map(({ color, value }) => {
        const right = legend.colorOf(value);
        return Math.max(...color.map((one, i) => Math.abs(one - right[i])));
      });
      const missing = colors.filter(({ value }) => Number.isNaN(value));
      found.push({
        n: colors.length,
        off: Math.max(...off),
        nMissing: missing.length,
        areGray: missing.every(({ color }) => isGray(color)),
        nGray: numbers.filter(({ color }) => isGray(color)).length,
      });
    }
    const nSplit = mesh.sources.length;
    await mesh.colorBy(null);
    await shown(mesh);
    stand.draw();
    const [x, y, z] = truth(places[places.length - 1]).slice(600, 603);
    const bare = stand.pixel(...stand.project(x, y, z));
    const { isOnGpu } = mesh;
    const { range, component, unit } = legend;
    const [hasMap, nBare] = [material.map !== null, mesh.sources.length];
    removed(mesh);
    return {
      ...{ isOnGpu, found, range, component, unit, nVertices, nSplit, nBare, bare, hasMap },
      errors: errors.filter(({ type }) => type === "error").map(({ block }) => block),
      complaints: stand.complaints,
    };
  },

  /** A PNG of a lit, colored mesh. */
  async coloredPicture(name: string, options: ColorOptions, place: number) {
    const stand = new Stand();
    furnish(stand, new THREE.DirectionalLight(0xffffff, 3));
    const mesh = await made(stand, {});
    await mesh.colorBy(name, options);
    mesh.seek({ frame: place });
    await shown(mesh);
    stand.draw();
    return { url: stand.canvas.toDataURL(), complaints: stand.complaints };
  },

  /** Return the errors of `colorBy` by names and options, and whether the last call applies. */
  async refusedColors(calls: [name: string, options: object][]) {
    const stand = new Stand();
    const mesh = await made(stand, { isPlain: true });
    const words = [];
    for (const [name, options] of calls) {
      words.push(await mesh.colorBy(name, options).then(String, (error: Error) => error.message));
    }
    const first = mesh.colorBy("scalar").then(
      () => "done",
      (error: Error) => error.name,
    );
    const second = await mesh.colorBy("high");
    const last = [await first, second.name];
    mesh.material = new THREE.ShaderMaterial();
    const other = await mesh.colorBy("scalar").then(String, (error: Error) => error.message);
    removed(mesh);
    return { words, last, other };
  },

  /** Return whether the box and the sphere of the geometry contain all frames. */
  async bounds() {
    const stand = new Stand();
    const mesh = await made(stand, { center: [10, 20, 30] });
    const { boundingBox, boundingSphere } = mesh.geometry;
    let isInside = true;
    for (let frame = 0; frame < mesh.reel.info.nFrames; frame++) {
      const vertices = truth(frame, [10, 20, 30]);
      for (let i = 0; i < vertices.length; i += 3) {
        const place = new THREE.Vector3().fromArray([...vertices], i);
        isInside &&= Boolean(boundingBox?.containsPoint(place));
        isInside &&= Boolean(boundingSphere?.containsPoint(place));
      }
    }
    const exact = await mesh.positionsAt(4);
    const off = Math.max(...exact.map((one, i) => Math.abs(one - truth(4, [10, 20, 30])[i])));
    const duration = mesh.duration;
    removed(mesh);
    return { isInside, off, duration };
  },
};

Object.assign(window, { tests });
