// Computes positions and normals on the GPU with WebGL 2.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { LoadedBlock, Picture } from "../loaded_block.js";
import type { MeshSetup, Backend, AttributeSetup, AttributeBackend } from "../backend.js";
import { AttributePass, POSITION_AND_NORMAL } from "./attribute_pass.js";
import { cornerTextureHeight, normalPass } from "./normal_pass.js";
import type { Pass } from "./pass.js";
import { MODES_PER_TEXEL, PositionPass } from "./position_pass.js";
import { VertexGrid } from "./vertex_grid.js";

/** A renderer of three.js: `WebGLRenderer` or any other. */
export interface Renderer {
  readonly domElement: EventTarget;
}

/** Whether a renderer can decode a mesh: it uses WebGL 2 and renders to float textures. */
export function canDecode(
  renderer: Renderer,
  { info, triangles, drawing }: MeshSetup,
): renderer is THREE.WebGLRenderer {
  if (!isWebGL(renderer)) return false;
  const { capabilities, extensions } = renderer;
  const nRows = drawing.shading?.vertices.length ?? info.nVerts;
  const requiredSize = Math.max(new VertexGrid(nRows).height, cornerTextureHeight(triangles));
  return extensions.has("EXT_color_buffer_float") && requiredSize <= capabilities.maxTextureSize;
}

function isWebGL(renderer: Renderer): renderer is THREE.WebGLRenderer {
  return "isWebGLRenderer" in renderer;
}

/** Computes positions and normals of pictures in render passes. */
export class GpuBackend implements Backend {
  readonly isOnGpu = true;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #geometry: THREE.BufferGeometry;
  readonly #positions: PositionPass;
  readonly #normals: Pass;
  readonly #attributes: AttributePass;
  readonly #sources: Uint32Array;
  readonly #maxModes: number;

  /** @throws Error if the driver rejects a program */
  constructor(
    renderer: THREE.WebGLRenderer,
    { info, triangles, drawing, shift }: MeshSetup,
    geometry: THREE.BufferGeometry,
  ) {
    this.#renderer = renderer;
    this.#geometry = geometry;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const maxLayers = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number;
    // Weights of two blocks are rows of one texture.
    const maxRows = renderer.capabilities.maxTextureSize / 2;
    this.#maxModes = MODES_PER_TEXEL * Math.min(maxLayers, maxRows);
    const grid = new VertexGrid(info.nVerts);
    this.#sources = drawing.sources;
    const { shading, sources, rows } = drawing;
    const rowGrid = shading ? new VertexGrid(shading.vertices.length) : grid;
    const ofRows = { grid: rowGrid, numbers: rows };
    this.#attributes = new AttributePass(renderer, grid, sources, geometry, POSITION_AND_NORMAL, ofRows);
    this.#positions = new PositionPass(renderer, grid, shift);
    const { texture } = this.#positions.target;
    const grids = [grid, rowGrid] as const;
    this.#normals = normalPass(renderer, grids, texture, triangles, shading, info.diagonal);
  }

  canHold(block: BlockFields): boolean {
    return block.nModes <= this.#maxModes;
  }

  upload(block: BlockFields, loaded: LoadedBlock): void {
    this.#positions.upload(block, loaded);
  }

  release(block: LoadedBlock): void {
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

  createAttribute(setup: AttributeSetup): AttributeBackend {
    const { nItems, items, name, width, glsl } = setup;
    const [renderer, geometry, grid] = [this.#renderer, this.#geometry, new VertexGrid(nItems)];
    const shader = { textures: ["value"], attributes: [[name, width]], glsl } as const;
    const previous = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    const attribute = new AttributePass(renderer, grid, items, geometry, shader);
    const sums = new PositionPass(renderer, grid, [0, 0, 0]);
    return {
      upload: (block, loaded) => sums.upload(block, loaded),
      release: (block) => sums.release(block),
      show(picture) {
        sums.run(picture);
        attribute.run(sums.target.texture);
      },
      dispose() {
        geometry.deleteAttribute(name);
        if (previous) geometry.setAttribute(name, previous);
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
