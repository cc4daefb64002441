// The module of the core that decodes exact values; it is loaded where there are some.

/** The module in base 64; build.mjs puts it here. */
declare const EXACT_MODULE: string;

/** Its bytes, anew each time: they are handed over to engines. */
export function exactModule(): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(EXACT_MODULE), (letter) => letter.charCodeAt(0));
}
