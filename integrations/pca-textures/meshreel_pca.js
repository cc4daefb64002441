/**
 * Plays PCA textures of meshreel with three.js: copy this file into your project.
 *
 *   const { scene } = await new GLTFLoader().loadAsync("walk.glb");
 *   const texture = await loadPcaTexture("walk.png");
 *   const mesh = scene.getObjectByProperty("isMesh", true);
 *   const frame = playPcaTexture(mesh, texture);
 *   renderer.setAnimationLoop((ms) => {
 *     frame.value = (ms / 1000) * fps;
 *     renderer.render(world, camera);
 *   });
 */
import { ImageBitmapLoader, MeshDepthMaterial, NearestFilter, RGBADepthPacking, Texture } from "three";

/** What is added to a vertex at rest (section 0) or to its normal (section 1) in a frame from 0. */
export const PCA_GLSL = /* glsl */ `
uniform highp sampler2D pcaTexture;
uniform float pcaFrame;

uvec4 pcaBytes(ivec2 place) {
  return uvec4(texelFetch(pcaTexture, place, 0) * 255.0 + 0.5);
}
uvec4 pcaTexel(int index) {
  int width = textureSize(pcaTexture, 0).x;
  return pcaBytes(ivec2(index % width, index / width));
}
int pcaNumber(int index) {
  uvec4 b = pcaTexel(index);
  return int(b.r | b.g << 8u | b.b << 16u);
}
float pcaWeight(int index) {
  uvec4 b = pcaTexel(index);
  return uintBitsToFloat(b.r << 24u | b.g << 16u | b.b << 8u | b.a);
}
vec4 pcaWeights(ivec2 at, float part) {
  vec4 before = vec4(pcaWeight(at.x), pcaWeight(at.x + 1), pcaWeight(at.x + 2), pcaWeight(at.x + 3));
  vec4 after = vec4(pcaWeight(at.y), pcaWeight(at.y + 1), pcaWeight(at.y + 2), pcaWeight(at.y + 3));
  return mix(before, after, part);
}
vec3 pcaOffset(vec2 uv, float frame, int section) {
  int nFrames = pcaNumber(0), sliceRows = pcaNumber(1);
  int nPositions = 4 * pcaNumber(3) + 8 * pcaNumber(4), nNormals = 4 * pcaNumber(6) + 8 * pcaNumber(7);
  int nPairs = pcaNumber(3 + 3 * section), nTexels = nPairs + pcaNumber(4 + 3 * section);
  ivec2 place = ivec2(uv + 0.5);
  place.y += pcaNumber(2 + 3 * section);
  int number = int(frame);
  ivec2 frames = ivec2(number % nFrames, (number + 1) % nFrames);
  ivec2 at = 8 + section * nPositions + (nPositions + nNormals) * frames;
  vec3 added = vec3(0.0);
  for (int texel = 0; texel < nTexels; texel++) {
    vec4 lowerWeights = pcaWeights(at, fract(frame)), upperWeights = 15.0 * lowerWeights;
    at += 4;
    if (texel >= nPairs) {
      upperWeights = lowerWeights;
      lowerWeights = pcaWeights(at, fract(frame));
      at += 4;
    }
    for (int axis = 0; axis < 3; axis++) {
      uvec4 b = pcaBytes(place);
      added[axis] += dot(vec4(b >> 4u) - 8.0, upperWeights) + dot(vec4(b & 15u) - 8.0, lowerWeights);
      place.y += sliceRows;
    }
  }
  return added;
}
`;

/** The texture of a file, its bytes as they are. */
export async function loadPcaTexture(url) {
  const loader = new ImageBitmapLoader();
  loader.setOptions({ premultiplyAlpha: "none", colorSpaceConversion: "none" });
  const texture = new Texture(await loader.loadAsync(url));
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.generateMipmaps = texture.flipY = false;
  texture.needsUpdate = true;
  return texture;
}

/** Plays a texture on a mesh, also in its shadows; gives the uniform with the number of the frame. */
export function playPcaTexture(mesh, texture, frame = { value: 0 }) {
  const addTo = (material) => {
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, { pcaTexture: { value: texture }, pcaFrame: frame });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>\nattribute vec2 pcaPlace;\n${PCA_GLSL}`)
        .replace(
          "#include <beginnormal_vertex>",
          "#include <beginnormal_vertex>\nobjectNormal = normalize(objectNormal + pcaOffset(pcaPlace, pcaFrame, 1));",
        )
        .replace(
          "#include <begin_vertex>",
          "#include <begin_vertex>\ntransformed += pcaOffset(pcaPlace, pcaFrame, 0);",
        );
    };
    material.customProgramCacheKey = () => "meshreel-pca";
    material.needsUpdate = true;
  };
  mesh.geometry.setAttribute("pcaPlace", mesh.geometry.getAttribute("uv1"));
  mesh.customDepthMaterial = new MeshDepthMaterial({ depthPacking: RGBADepthPacking });
  [mesh.material, mesh.customDepthMaterial].flat().forEach(addTo);
  mesh.frustumCulled = false; // the bounding box of the geometry is that of the rest pose
  return frame;
}
