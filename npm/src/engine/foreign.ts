// Files that are often taken for `.reel` files.

/** What a file is, in words, by how it begins. */
const KINDS: readonly (readonly [begin: RegExp, words: string])[] = [
  [/^(\xef\xbb\xbf)?\s*<(!doctype|html|!--)/i, "this is an HTML page; is the address right?"],
  [/^glTF/, "this is a GLB file; `meshreel encode` makes a .reel of it"],
  [/^version https:\/\/git-lfs/, "this is a Git LFS pointer; serve the file it points to"],
  [/^\x1f\x8b/, "this is compressed by gzip; serve the file as it is"],
];

/** What a file is that is no `.reel`, and what to do; null where its first bytes do not tell. */
export function foreignKind(data: Uint8Array): string | null {
  const begin = String.fromCharCode(...data.subarray(0, 64));
  return KINDS.find(([pattern]) => pattern.test(begin))?.[1] ?? null;
}
