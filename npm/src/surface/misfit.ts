// What does not fit the mesh.

import { CorruptStreamError } from "../errors.js";

/** The error of a surface that does not fit its mesh, for this reason. */
export function misfit(reason: string): CorruptStreamError {
  return new CorruptStreamError(`the surface does not fit the mesh: ${reason}`);
}
