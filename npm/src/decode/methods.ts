// Methods of streams, by their codes.

export const METHODS: readonly string[] = [
  "pca-qp",
  "pca",
  "pca-q",
  "v2v",
  "pca-qs",
  "blocks",
  "gft",
  "reel",
  "lossless",
  "grid",
];

/** Those behind it have no modes: positions are exact, or on a grid. */
export const REEL = 7;
export const GRID = 9;
