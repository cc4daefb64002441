// Edges of triangles.

/** Return the unique edges of triangles, as pairs of vertices. */
export function uniqueEdges(faces: Uint32Array, nVerts: number): Uint32Array {
  const keys = new Float64Array(faces.length);
  for (let i = 0; i < faces.length; i++) {
    const a = faces[i];
    const b = faces[i % 3 === 2 ? i - 2 : i + 1];
    keys[i] = Math.min(a, b) * nVerts + Math.max(a, b);
  }
  keys.sort();
  const edges = [];
  for (let i = 0; i < keys.length; i++) {
    if (i === 0 || keys[i] !== keys[i - 1])
      edges.push(Math.floor(keys[i] / nVerts), keys[i] % nVerts);
  }
  return Uint32Array.from(edges);
}
