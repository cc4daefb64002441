// The kinds of tracks, as `KIND_ROWS` of meshreel.model.tracks.

/** In the order of their numbers in files. */
export const KINDS = ["other", "vector", "velocity", "normal", "color", "uv", "scalar"] as const;

/** What distinguishes the tracks of a kind from those of quantities. */
interface KindRow {
  /** Error of a value: an angle, or the largest difference of a number. Otherwise the length of the difference. */
  readonly error: "angle" | "number";
  /** Component that is shown by default, or all as a color. Otherwise the magnitude. */
  readonly component: "x" | "color";
  /** Default range of the color map, unless it is the one of quantities. */
  readonly range?: string;
}

export const KIND_ROWS: Partial<Record<(typeof KINDS)[number], KindRow>> = {
  normal: { error: "angle", component: "x", range: "-1:1" },
  color: { error: "number", component: "color" },
};
