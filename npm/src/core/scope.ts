// What a bundle of the engine decodes: everything, or what the small module decodes.

/** Inserted by build.mjs. */
declare const SMALL_ENGINE: boolean;

/** Whether this bundle omits what the small module refuses: code behind `refuse`. */
export const IS_SMALL = SMALL_ENGINE;

/** Refuse the file, as the small module does: an engine with the whole module decodes it instead. */
export function refuse(): never {
  throw new WebAssembly.RuntimeError();
}
