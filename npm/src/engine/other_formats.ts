// Recognizes other formats that are often opened in place of `.reel` files.

/** First bytes of a file, and the description of its format. */
const SIGNATURES: readonly (readonly [start: RegExp, description: string])[] = [
  [/^(\xef\xbb\xbf)?\s*<(!doctype|html|!--)/i, "this is an HTML page; check the address"],
  [/^glTF/, "this is a GLB file; convert it with `meshreel encode`"],
  [/^version https:\/\/git-lfs/, "this is a Git LFS pointer; serve the file itself"],
  [/^\x1f\x8b/, "this is compressed by gzip; serve it uncompressed"],
];

/** Describe a file of another format and what to do; null if its first bytes are not recognized. */
export function identifyOtherFormat(data: Uint8Array): string | null {
  const start = String.fromCharCode(...data.subarray(0, 64));
  return SIGNATURES.find(([pattern]) => pattern.test(start))?.[1] ?? null;
}
