// Settings of coloring by a track, from the command line or the controls.

import type { Component } from "../../three/color/color_range.js";

/** How a track colors the mesh; null selects the default. */
export interface TrackSettings {
  readonly track: string;
  readonly component: string | null;
  /** "LOW:HIGH", each a number or a percentile. */
  readonly range: string | null;
  readonly colormap: "sequential" | "diverging" | null;
}

/** Default range of the color map. */
export const DEFAULT_RANGE = "2%:98%";

/** Parse a component for `colorBy`. */
export function parseComponent(text: string): Component {
  return /^\d+$/.test(text) ? Number(text) : (text as Component);
}

/** Format a component, such as "y" for column 1. */
export function formatComponent(component: number | "magnitude" | "color", nColumns: number): string {
  if (typeof component !== "number") return component;
  return nColumns > 1 && nColumns <= 3 ? "xyz"[component] : String(component);
}
