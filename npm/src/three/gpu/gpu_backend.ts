// Computes positions and normals on the GPU with WebGL 2.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { LoadedBlock, Picture } from "../loaded_block.js";
import type { MeshSetup, Backend, AttributeSetup, AttributeBackend } from "../backend.js";
import { AttributePass } from "./attribute_pass.js";
import { cornerTextureHeight, createCorners, normalShader } from "./normals.js";
import { MODES_PER_TEXEL, PositionPass } from "./position_pass.js";
import { VertexGrid } from "./vertex_grid.js";

/** A renderer of three.js: `WebGLRenderer` or any other. */
export interface Renderer {
  readonly domElement: EventTarget;
}

/** Whether a renderer can decode a mesh: it uses WebGL 2 and renders to float textures. */
export function canDecode(
  renderer: Renderer,
  { info, triangles }: MeshSetup,
): renderer is THREE.WebGLRenderer {
  if (!isWebGL(renderer)) return false;
  const { capabilities, extensions } = renderer;
  const requiredSize = Math.max(new VertexGrid(info.nVerts).height, cornerTextureHeight(triangles));
  return extensions.has("EXT_color_buffer_float") && requiredSize <= capabilities.maxTextureSize;
}

function isWebGL(renderer: Renderer): renderer is THREE.WebGLRenderer {
  return "isWebGLRenderer" in renderer;
}

/** Computes positions of vertices of the file in a render pass, and from them the attributes. */
export class GpuBackend implements Backend {
  readonly isOnGpu = true;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #geometry: THREE.BufferGeometry;
  readonly #positions: PositionPass;
  readonly #corners: THREE.DataTexture;
  readonly #attributes: AttributePass;
  readonly #sources: Uint32Array;
  readonly #maxModes: number;

  /** @throws Error if the driver rejects a program */
  constructor(
    renderer: THREE.WebGLRenderer,
    setup: MeshSetup,
    geometry: THREE.BufferGeometry,
  ) {
    this.#renderer = renderer;
    this.#geometry = geometry;
    const { info, drawing, shift } = setup;
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const maxLayers = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number;
    // Weights of two blocks are rows of one texture.
    const maxRows = renderer.capabilities.maxTextureSize / 2;
    this.#maxModes = MODES_PER_TEXEL * Math.min(maxLayers, maxRows);
    const grid = new VertexGrid(info.nVerts);
    this.#sources = drawing.sources;
    const { corners, inputs } = createCorners(setup);
    this.#corners = corners;
    this.#attributes = new AttributePass(renderer, geometry, normalShader(grid, info.diagonal), inputs);
    this.#positions = new PositionPass(renderer, grid, shift);
    renderer.initTexture(corners);
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
    this.#attributes.run(this.#positions.target.texture, this.#corners);
  }

  read(into: Float32Array): void {
    this.#positions.read(this.#sources, into);
  }

  createAttribute(setup: AttributeSetup): AttributeBackend {
    const { nItems, items, name, width, glsl } = setup;
    const [renderer, geometry, grid] = [this.#renderer, this.#geometry, new VertexGrid(nItems)];
    const shader = {
      ...{ textures: ["values"], inputs: ["item"], attributes: [[name, width] as const] },
      glsl: `${grid.glsl}
uniform sampler2D values;
void main() {
  vec3 value = texelFetch(values, texelOf(int(item)), 0).xyz;
  ${glsl}
}`,
    };
    const previous = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    const attribute = new AttributePass(renderer, geometry, shader, [items]);
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
    this.#corners.dispose();
    this.#attributes.dispose();
  }
}
