// Pictures on the GPU, by WebGL 2.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { HeldBlock, Picture } from "../held_block.js";
import type { Setting, Stage, ValueSetup, ValueStage } from "../stage.js";
import { AttributePass, SHAPE } from "./attribute_pass.js";
import { cornerRows, normalPass } from "./normal_pass.js";
import type { Pass } from "./pass.js";
import { MODES_A_TEXEL, PositionPass } from "./position_pass.js";
import { VertexGrid } from "./vertex_grid.js";

/** What draws: a `WebGLRenderer`, or any other renderer of three.js. */
export interface Renderer {
  readonly domElement: EventTarget;
}

/** A renderer that can do this for a mesh: of WebGL 2, which draws into textures of floats. */
export function canDecode(
  renderer: Renderer,
  { info, triangles, drawing }: Setting,
): renderer is THREE.WebGLRenderer {
  if (!isWebGL(renderer)) return false;
  const { capabilities, extensions } = renderer;
  const nRows = drawing.shading?.vertices.length ?? info.nVerts;
  const most = Math.max(new VertexGrid(nRows).height, cornerRows(triangles));
  return extensions.has("EXT_color_buffer_float") && most <= capabilities.maxTextureSize;
}

function isWebGL(renderer: Renderer): renderer is THREE.WebGLRenderer {
  return "isWebGLRenderer" in renderer;
}

/** Computes positions and normals of pictures in passes over textures. */
export class GpuStage implements Stage {
  readonly isOnGpu = true;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #geometry: THREE.BufferGeometry;
  readonly #positions: PositionPass;
  readonly #normals: Pass;
  readonly #attributes: AttributePass;
  readonly #sources: Uint32Array;
  readonly #mostModes: number;

  /** @throws Error if the driver refuses */
  constructor(
    renderer: THREE.WebGLRenderer,
    { info, triangles, drawing, shift }: Setting,
    geometry: THREE.BufferGeometry,
  ) {
    this.#renderer = renderer;
    this.#geometry = geometry;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const mostLayers = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number;
    // Weights of two blocks are rows of a texture.
    const mostRows = renderer.capabilities.maxTextureSize / 2;
    this.#mostModes = MODES_A_TEXEL * Math.min(mostLayers, mostRows);
    const grid = new VertexGrid(info.nVerts);
    this.#sources = drawing.sources;
    const { shading, sources, rows } = drawing;
    const rowGrid = shading ? new VertexGrid(shading.vertices.length) : grid;
    const ofRows = { grid: rowGrid, numbers: rows };
    this.#attributes = new AttributePass(renderer, grid, sources, geometry, SHAPE, ofRows);
    this.#positions = new PositionPass(renderer, grid, shift);
    const { texture } = this.#positions.target;
    const grids = [grid, rowGrid] as const;
    this.#normals = normalPass(renderer, grids, texture, triangles, shading, info.diagonal);
  }

  canHold(block: BlockFields): boolean {
    return block.nModes <= this.#mostModes;
  }

  hold(block: BlockFields, held: HeldBlock): void {
    this.#positions.hold(block, held);
  }

  release(block: HeldBlock): void {
    this.#positions.release(block);
  }

  show(picture: Picture): void {
    this.#positions.run(picture);
    this.#normals.run();
    this.#attributes.run(this.#positions.target.texture, this.#normals.target.texture);
  }

  read(into: Float32Array): void {
    this.#positions.read(this.#sources, into);
  }

  values(setup: ValueSetup): ValueStage {
    const { nItems, items, name, width, glsl } = setup;
    const [renderer, geometry, grid] = [this.#renderer, this.#geometry, new VertexGrid(nItems)];
    const shader = { textures: ["value"], attributes: [[name, width]], glsl } as const;
    const before = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    const attribute = new AttributePass(renderer, grid, items, geometry, shader);
    const sums = new PositionPass(renderer, grid, [0, 0, 0]);
    return {
      hold: (block, held) => sums.hold(block, held),
      release: (block) => sums.release(block),
      show(picture) {
        sums.run(picture);
        attribute.run(sums.target.texture);
      },
      dispose() {
        geometry.deleteAttribute(name);
        if (before) geometry.setAttribute(name, before);
        sums.dispose();
        attribute.dispose();
      },
    };
  }

  dispose(): void {
    this.#positions.dispose();
    this.#normals.dispose();
    this.#attributes.dispose();
  }
}
