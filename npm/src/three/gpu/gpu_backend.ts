// Computes attributes on the GPU with WebGL 2.

import type * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { AttributeSetup, Backend, MeshSetup } from "../backend.js";
import type { LoadedBlock, Picture } from "../loaded_block.js";
import { AttributePass } from "./attribute_pass.js";
import { topologySize } from "./normals.js";
import { MODES_PER_TEXEL, PositionPass } from "./position_pass.js";
import { tableSize } from "./tables.js";

/** A renderer of three.js: `WebGLRenderer` or any other. */
export interface Renderer {
  readonly domElement: EventTarget;
}

/** Whether a renderer can decode a mesh: it uses WebGL 2 and renders to float textures. */
export function canDecode(renderer: Renderer, setup: MeshSetup): renderer is THREE.WebGLRenderer {
  if (!isWebGL(renderer)) return false;
  const { capabilities, extensions } = renderer;
  const { height } = tableSize(topologySize(setup));
  return extensions.has("EXT_color_buffer_float") && height <= capabilities.maxTextureSize;
}

function isWebGL(renderer: Renderer): renderer is THREE.WebGLRenderer {
  return "isWebGLRenderer" in renderer;
}

/** Computes sums of fields in a render pass, and attributes of a geometry from them. */
export class GpuBackend implements Backend {
  readonly isOnGpu = true;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #geometry: THREE.BufferGeometry;
  readonly #sums: PositionPass;
  readonly #attributes: AttributePass;

  /** @throws Error if the driver rejects a program */
  constructor(renderer: THREE.WebGLRenderer, geometry: THREE.BufferGeometry, setup: AttributeSetup) {
    this.#renderer = renderer;
    this.#geometry = geometry;
    this.#attributes = new AttributePass(renderer, geometry, setup);
    this.#sums = new PositionPass(renderer, setup.nItems, setup.shift);
  }

  canHold(block: BlockFields): boolean {
    const gl = this.#renderer.getContext() as WebGL2RenderingContext;
    return block.nModes <= MODES_PER_TEXEL * gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS);
  }

  upload(block: BlockFields, loaded: LoadedBlock): void {
    this.#sums.upload(block, loaded);
  }

  release(block: LoadedBlock): void {
    this.#sums.release(block);
  }

  show(picture: Picture): void {
    this.#sums.run(picture);
    this.#attributes.run(this.#sums.target.texture);
  }

  read(items: Uint32Array, into: Float32Array): void {
    this.#sums.read(items, into);
  }

  createAttribute(setup: AttributeSetup): GpuBackend {
    return new GpuBackend(this.#renderer, this.#geometry, setup);
  }

  dispose(): void {
    this.#sums.dispose();
    this.#attributes.dispose();
  }
}
