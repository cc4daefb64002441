// The material of meshes that are colored by a track: weakly lit, so that colors match the legend.

import * as THREE from "three";

import { POLYGON_OFFSET } from "../shading/faces.js";

/** A material for `ReelMesh.colorBy` with slight shading, so that folds remain visible. */
export class TrackMaterial extends THREE.MeshBasicMaterial {
  constructor() {
    super({ side: THREE.DoubleSide, ...POLYGON_OFFSET });
  }

  /** Copy the color settings of another material. */
  copyColors({ map, vertexColors }: TrackMaterial): void {
    Object.assign(this, { map, vertexColors, needsUpdate: true });
  }

  override onBeforeCompile(shader: THREE.WebGLProgramParametersWithUniforms): void {
    shader.vertexShader = `varying vec3 vSeen;\n${shader.vertexShader}`.replace(
      "#include <project_vertex>",
      "#include <project_vertex>\nvSeen = mvPosition.xyz;",
    );
    shader.fragmentShader = `varying vec3 vSeen;\n${shader.fragmentShader}`.replace(
      "#include <opaque_fragment>",
      `vec3 facing = normalize(cross(dFdx(vSeen), dFdy(vSeen)));
      outgoingLight *= 0.70 + 0.30 * max(dot(facing, normalize(vec3(-0.45, 0.65, 0.62))), 0.0);
      #include <opaque_fragment>`,
    );
  }
}
