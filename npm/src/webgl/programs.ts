// Compiled shaders and their uniforms.

import type { UniformValue } from "./materials.js";
import type { Texture } from "./textures.js";

/** A value by the name of its uniform. */
export type UniformValues = Readonly<Record<string, UniformValue | undefined>>;

const [FLOAT, INT, BOOL] = [0x1406, 0x1404, 0x8b56];
const [VEC2, VEC3, VEC4, MAT3, MAT4] = [0x8b50, 0x8b51, 0x8b52, 0x8b5b, 0x8b5c];

/** A linked program. */
export class Program {
  readonly handle: WebGLProgram;
  /** Locations of attributes. */
  readonly attributes: readonly (readonly [name: string, location: number])[];
  readonly #gl: WebGL2RenderingContext;
  readonly #uniforms: readonly { name: string; type: number; location: WebGLUniformLocation; unit: number }[];

  constructor(gl: WebGL2RenderingContext, vertexShader: string, fragmentShader: string) {
    this.#gl = gl;
    const program = (this.handle = gl.createProgram());
    const sources = [vertexShader, fragmentShader];
    sources.forEach((source, i) => {
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER) as WebGLShader;
      gl.shaderSource(shader, `#version 300 es\n${source}`);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
    });
    gl.linkProgram(program);
    const isLinked = gl.getProgramParameter(program, gl.LINK_STATUS) || gl.isContextLost();
    if (!isLinked) console.error(`the driver rejects a shader: ${gl.getProgramInfoLog(program)}`, ...sources);
    const length = (kind: number) => (gl.getProgramParameter(program, kind) as number | null) ?? 0;
    this.#uniforms = Array.from({ length: length(gl.ACTIVE_UNIFORMS) }, (_, unit) => {
      const { name, type } = gl.getActiveUniform(program, unit) as WebGLActiveInfo;
      return { name, type, unit, location: gl.getUniformLocation(program, name) as WebGLUniformLocation };
    });
    this.attributes = Array.from({ length: length(gl.ACTIVE_ATTRIBUTES) }, (_, i) => {
      const { name } = gl.getActiveAttrib(program, i) as WebGLActiveInfo;
      return [name, gl.getAttribLocation(program, name)] as const;
    });
  }

  /** Use the program with these values. */
  use(values: UniformValues, bind: (texture: Texture | null, unit: number) => void): void {
    const gl = this.#gl;
    gl.useProgram(this.handle);
    for (const { name, type, location, unit } of this.#uniforms) {
      const value = values[name] as any; // matches the type of the uniform
      const numbers = (): number[] => value.elements ?? value.toArray?.() ?? value;
      if (type === FLOAT) gl.uniform1f(location, value);
      else if (type === INT || type === BOOL) gl.uniform1i(location, value);
      else if (type === MAT3) gl.uniformMatrix3fv(location, false, numbers());
      else if (type === MAT4) gl.uniformMatrix4fv(location, false, numbers());
      else if (type === VEC2) gl.uniform2fv(location, numbers());
      else if (type === VEC3) gl.uniform3fv(location, numbers());
      else if (type === VEC4) gl.uniform4fv(location, numbers());
      else {
        bind(value, unit);
        gl.uniform1i(location, unit);
      }
    }
  }
}
